"""Planned duty: cycles and blocks that a programme takes, against a walk through its cycles one by one."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.degradation.programme import Programme, uncertain_work

BLOCKS = st.lists(st.tuples(st.integers(1, 40), st.floats(0.05, 20.0)), min_size=1, max_size=5)


def programme(blocks: list[tuple[int, float]]) -> Programme:
    lengths, rates = zip(*blocks, strict=True)
    return Programme(cycles=np.array(lengths, dtype=float), rates=np.array([rates]))


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
    two = Programme(cycles=np.array([100.0, 50.0]), rates=np.array([[1.0, 4.0], [2.0, 1.0], [1.0, 1.0]]))
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
        Programme(cycles=np.array(cycles), rates=np.array(rates))
