"""ζ over cycles by the severity of duty: straight between blocks, invertible, the identity where all blocks are alike."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.degradation.general_order import DegradationLaw, first_passage, value
from models.degradation.severity import (
    IDENTITY,
    Block,
    DutyProgramme,
    Severity,
    SeverityBasis,
    severity_map,
    uncertain_work,
)
from models.prognosis.first_passage import ends_of_life, weighted_quantiles
from tests.models.prognosis.sample_scores import crps_of_sample
from tests.models.tracking.tracked_series import on_grid, sent

ENERGY = Severity(basis=SeverityBasis.DISSIPATED_ENERGY)


def blocks(energies: Sequence[float | None], length: float = 1000.0) -> list[Block]:
    return [Block(end=length * (i + 1), cycles=length, energy=energy) for i, energy in enumerate(energies)]


def test_blocks_that_are_all_alike_leave_the_count_of_cycles() -> None:
    found = severity_map(ENERGY, blocks([18e3] * 7))
    at = np.linspace(0.0, 20_000.0, 201)
    assert found.progress(at) == pytest.approx(at, rel=1e-12)
    assert found.cycles_at(at) == pytest.approx(at, rel=1e-12)
    assert severity_map(Severity(), blocks([18e3, 90e3])) is IDENTITY
    assert severity_map(ENERGY, [Block(end=500.0, cycles=500.0)]) is IDENTITY


def test_severity_by_hand() -> None:
    # a block of twice the energy counts two to the power of the exponent
    severity = Severity(basis=SeverityBasis.DISSIPATED_ENERGY, exponent=1.5)
    found = severity_map(severity, blocks([10e3, 20e3]))
    assert found.progress(2000.0) == pytest.approx(1000.0 + 1000.0 * 2**1.5)
    assert found.unit == pytest.approx(0.5**1.5)
    # beyond the last block recent duty goes on: the last 1,000 cycles
    assert found.progress(3000.0) - found.progress(2000.0) == pytest.approx(1000.0 * 2**1.5)
    # what says nothing takes the usual
    found = severity_map(ENERGY, blocks([10e3, None, 30e3, None]))
    steps = np.diff(found.progress(np.arange(0.0, 4001.0, 1000.0)))
    assert steps == pytest.approx([1000.0, 2000.0, 3000.0, 2000.0])
    # overlaps count once and a run in before zero not at all
    made = [
        Block(end=0.0, cycles=200.0, energy=5e3),
        *blocks([10e3, 10e3]),
        Block(end=2500.0, cycles=2500.0, energy=40e3),
    ]
    found = severity_map(ENERGY, made)
    assert found.progress(np.array([1000.0, 2000.0, 2500.0])) == pytest.approx([1000.0, 2000.0, 4000.0])
    # recent duty is the last tenth or a thousand cycles
    made = blocks([10e3] * 28 + [20e3] * 2)
    assert severity_map(ENERGY, made).rate == pytest.approx((2.0 * 2000.0 + 1000.0) / 3000.0)
    assert severity_map(ENERGY, blocks([10e3, 20e3], length=500.0)).rate == pytest.approx(1.5)
    # sliding distance assumes a duration only where none is stated
    told = Block(end=1.0, cycles=1.0, speed=200.0, duration=0.5)
    assumed = Block(end=1.0, cycles=1.0, speed=200.0)
    assert told.work(SeverityBasis.SLIDING_DISTANCE) == pytest.approx(50.0)
    assert assumed.work(SeverityBasis.SLIDING_DISTANCE) == pytest.approx(100.0)
    assert told.work(SeverityBasis.DISSIPATED_ENERGY) is None


@pytest.mark.parametrize("severity", [ENERGY, Severity(basis=SeverityBasis.SLIDING_DISTANCE, exponent=0.7)])
def test_the_inverse_leads_back(severity: Severity) -> None:
    rng = np.random.default_rng(7)
    made = [
        Block(end=700.0 * (i + 1), cycles=600.0, energy=1e3 * (1 + i % 4), speed=100.0 + 20 * (i % 3)) for i in range(9)
    ]
    found = severity_map(severity, made)
    at = rng.uniform(0.0, 9000.0, 300)
    assert found.cycles_at(found.progress(at)) == pytest.approx(at, rel=1e-10)
    assert (np.diff(found.progress(np.sort(at))) > 0).all()


@pytest.mark.parametrize("wrong", [{"cycles": 0.0}, {"energy": -1.0}, {"speed": math.nan}, {"end": math.inf}])
def test_impossible_blocks_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Block(**{"end": 1000.0, "cycles": 1000.0} | wrong)


def test_a_life_of_light_and_heavy_blocks_is_predicted_better_by_energy() -> None:
    """Heavy blocks wear four times as fast. By count of cycles the same law is fitted to a staircase."""
    scores = {"cycles": [], "energy": []}  # type: dict[str, list[float]]
    for seed in range(6):
        rng = np.random.default_rng(seed)
        energies: list[float | None] = [40e3 if (i // 4 + seed) % 2 else 10e3 for i in range(40)]
        truth = DegradationLaw(initial=0.13, change=-0.1, scale=20_000.0 * rng.uniform(0.8, 1.25), exponent=1.0)
        true_map = severity_map(ENERGY, blocks(energies))
        end = float(true_map.cycles_at(first_passage(0.065, truth)))
        last = int(0.6 * end // 1000)
        at = np.arange(last + 1, dtype=np.float64) * 1000
        y = value(true_map.progress(at), truth) * (1 + 0.003 * rng.standard_normal(at.size))
        known = severity_map(ENERGY, blocks(energies[:last]))
        for name, mapped in (("cycles", IDENTITY), ("energy", known)):
            drawn = on_grid(sent(mapped.progress(at), y), 1000, rng)
            ends = mapped.cycles_at(np.minimum(ends_of_life(drawn, 0.5), 1e6))
            scores[name].append(crps_of_sample(ends, drawn.weight, end) / end)
            assert weighted_quantiles(ends, drawn.weight, (0.5,))[0] > at[-1] * 0.5
    assert np.mean(scores["energy"]) < 0.75 * np.mean(scores["cycles"])


# --- Planned duty: cycles and blocks that a programme takes, against a walk through its cycles one by one.

BLOCKS = st.lists(st.tuples(st.integers(1, 40), st.floats(0.05, 20.0)), min_size=1, max_size=5)


def programme(blocks: list[tuple[int, float]]) -> DutyProgramme:
    lengths, rates = zip(*blocks, strict=True)
    return DutyProgramme(cycles=np.array(lengths, dtype=float), rates=np.array([rates]))


@given(BLOCKS, st.floats(0.0, 3_000.0))
def test_it_takes_the_cycles_that_a_walk_takes(blocks: list[tuple[int, float]], progress: float) -> None:
    walked, ahead = 0.0, progress
    for length, rate in itertools.cycle(blocks):
        step = min(length, ahead / rate)
        walked, ahead = walked + step, ahead - step * rate
        if step < length:
            break
    found = programme(blocks).cycles_until(np.array([progress]))
    assert found[0] == pytest.approx(walked, rel=1e-9, abs=1e-6)


def test_each_draw_goes_its_own_pace_and_never_is_never() -> None:
    two = DutyProgramme(cycles=np.array([100.0, 50.0]), rates=np.array([[1.0, 4.0], [2.0, 1.0], [1.0, 1.0]]))
    found = two.cycles_until(np.array([700.0, 225.0, np.inf]))
    assert found.tolist() == [400.0, 125.0, np.inf]
    assert [two.blocks_in(cycles) for cycles in (0.0, 50.0, 125.0, 150.0, 400.0)] == [0.0, 0.5, 1.5, 2.0, 5.0]


def test_uncertain_work_has_the_mean_and_deviation_that_are_planned() -> None:
    normals = np.random.default_rng(4).standard_normal(400_000)
    work = uncertain_work(25e3, 5e3, normals)
    assert work.mean() == pytest.approx(25e3, rel=2e-3)
    assert work.std() == pytest.approx(5e3, rel=1e-2)
    assert (work > 0.0).all()
    assert uncertain_work(25e3, 0.0, normals[:3]).tolist() == [25e3] * 3


@pytest.mark.parametrize(("cycles", "rates"), [([], [[]]), ([0.0], [[1.0]]), ([5.0], [[0.0]]), ([5.0], [[-1.0]])])
def test_a_programme_that_leads_nowhere_is_refused(cycles: list[float], rates: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="programme"):
        DutyProgramme(cycles=np.array(cycles), rates=np.array(rates))
