"""Whole simulated campaigns: the order of runs, the same bits of a seed, and ageing by cycles or by energy."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from models.friction.speed_protocol import RPM
from models.rig.campaign import end_of_life, simulate, simulated_clutch
from models.rig.programme import CYCLE_ENERGY, WHOLE, Ageing, RigProgramme
from models.rig.sampled import RawTest
from models.rig.simulated_runs import DutyBlock, RunKind, SimulatedRun
from models.rig.stationary import stationary_test
from models.rig.truth import SimulatedClutch
from tests.models.rig.exact import NOISELESS

BAR = 1e5


def bits(run: SimulatedRun) -> tuple[object, ...]:
    tables = [table for table in (run.plateaus, run.record) if table is not None]
    columns = [column for table in tables for column in (table.torque, table.oil_temperature) if column is not None]
    return run.run_id, run.kind, run.cycles, run.duty, *(column.tobytes() for column in columns)


def test_runs_come_in_rig_order_as_in_fig_2() -> None:
    runs = list(itertools.islice(simulate(7), 8))
    assert [(run.run_id, run.kind.value, run.cycles) for run in runs] == [
        ("sim-7-run-in-00000", "run_in", 0),
        ("sim-7-stationary-00000", "stationary_stribeck", 0),
        ("sim-7-duty-00500", "duty_cycles", 500),
        ("sim-7-stationary-00500", "stationary_stribeck", 500),
        ("sim-7-duty-01000", "duty_cycles", 1000),
        ("sim-7-stationary-01000", "stationary_stribeck", 1000),
        ("sim-7-duty-02000", "duty_cycles", 2000),
        ("sim-7-stationary-02000", "stationary_stribeck", 2000),
    ]
    assert [run.duty.cycles for run in runs if run.duty] == [200, 500, 500, 1000]
    assert runs[0].duty.initial_speed == pytest.approx(1200 * RPM)
    assert runs[2].duty.initial_speed == pytest.approx(2000 * RPM)
    assert runs[2].duty.maximum_pressure == 8 * BAR
    # the whole of fig 2 in its order
    runs = list(simulate(7, programme=WHOLE, most_tests=2))
    assert [(run.run_id, run.kind.value, run.cycles) for run in runs] == [
        ("sim-7-run-in-00000", "run_in", 0),
        ("sim-7-stationary-00000", "stationary_stribeck", 0),
        ("sim-7-dynamic-00000", "dynamic_stribeck", 0),
        ("sim-7-duty-00500", "duty_cycles", 500),
        ("sim-7-stationary-00500", "stationary_stribeck", 500),
        ("sim-7-dynamic-00500", "dynamic_stribeck", 500),
    ]
    for run in (runs[0], runs[3]):
        assert run.record.pressure.max() == pytest.approx(8e5, rel=0.01)
        assert run.record.speed[:50].mean() == pytest.approx(run.duty.initial_speed, rel=0.01)


def test_a_campaign_ends_with_the_first_test_below_the_stop():
    for seed in range(5):
        clutch = simulated_clutch(seed)
        tests = [run.cycles for run in simulate(seed) if run.kind is RunKind.STATIONARY_STRIBECK]
        share = clutch.mean_cofs(np.array(tests, dtype=float)) / clutch.mean_cof(0)
        assert (share[:-1] >= 0.45).all()
        assert share[-1] < 0.45 or len(tests) == 40
        assert clutch.end_of_life() < tests[-1]


@pytest.mark.parametrize(
    ("programme", "most_tests"),
    [(RigProgramme(), 6), (replace(WHOLE, raw=RawTest(rate=50.0), ageing=Ageing.ENERGY), 1)],
)
def test_the_same_seed_gives_the_same_bits_and_another_does_not(programme: RigProgramme, most_tests: int) -> None:
    first, again, other = (
        [bits(run) for run in simulate(seed, programme=programme, most_tests=most_tests)] for seed in (7, 7, 8)
    )
    assert first == again
    columns = [[each[4:] for each in runs if each[4:]] for runs in (first, other)]
    assert all(a != b for a, b in zip(*columns, strict=True))
    assert len(set(columns[0])) == len(columns[0])  # no two tests share their noise


def test_a_given_clutch_is_the_one_that_is_measured():
    run = next(run for run in simulate(3, clutch=SimulatedClutch(), sensor=NOISELESS) if run.plateaus is not None)
    assert np.array_equal(run.plateaus.torque, stationary_test(SimulatedClutch(), 0, rng(), NOISELESS).torque)


def rng(seed: int = 2) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_what_is_added_does_not_change_the_stationary_tests() -> None:
    quick, whole = (
        [run for run in simulate(3, programme=programme, most_tests=2) if run.plateaus is not None]
        for programme in (RigProgramme(), WHOLE)
    )
    assert [run.plateaus.torque.tobytes() for run in quick] == [run.plateaus.torque.tobytes() for run in whole]


def test_the_energy_of_a_block_is_that_of_its_engagement() -> None:
    """Witness: the trace's own ∫ M ω dt, which knows nothing of the integrator's sum."""
    runs = [run for run in simulate(7, programme=RigProgramme(engagements=True), most_tests=3) if run.duty]
    for run in runs:
        by_trace = float(np.trapezoid(run.record.torque * run.record.speed, run.record.time))
        assert run.duty.energy_per_cycle == pytest.approx(by_trace, rel=0.02)
    assert len({run.duty.energy_per_cycle for run in runs}) == 3


def test_energy_ages_the_clutch_by_what_blocks_and_tests_dissipate() -> None:
    programme = RigProgramme(engagements=True, ageing=Ageing.ENERGY)
    runs = list(simulate(7, programme=programme, most_tests=3))
    for before, run in itertools.pairwise(runs):
        assert run.wear - before.wear == pytest.approx(run.dissipated() / CYCLE_ENERGY)
    test = stationary_test(simulated_clutch(7), runs[2].wear, rng(), NOISELESS)
    assert runs[3].plateaus.torque.mean() == pytest.approx(test.torque.mean(), rel=0.01)
    fresh = stationary_test(simulated_clutch(7), 500, rng(), NOISELESS)  # were it by cycles
    assert runs[3].plateaus.torque.mean() < 0.97 * fresh.torque.mean()
    assert 2e6 < runs[1].dissipated() < 6e6  # 1,400 s of sliding at about 25 Nm


def test_the_end_of_life_is_where_wear_gets_there() -> None:
    clutch = simulated_clutch(7)
    by_cycles = [(run.wear, run.cycles) for run in simulate(7)]
    assert end_of_life(by_cycles, clutch) == pytest.approx(clutch.end_of_life())
    assert end_of_life([(2 * wear, cycles) for wear, cycles in by_cycles], clutch) == pytest.approx(
        clutch.end_of_life() / 2
    )
    assert end_of_life(by_cycles[:5], clutch) is None


DUTY = DutyBlock(cycles=1, energy_per_cycle=1.0, initial_speed=1.0, maximum_pressure=1.0)


@pytest.mark.parametrize(
    ("made", "rule"),
    [
        (partial(simulate, -1), "seed"),
        (partial(simulate, 1, stop_fraction=1.0), "stop_fraction"),
        (partial(simulate, 1, most_tests=0), "most_tests"),
        (partial(RigProgramme, ageing=Ageing.ENERGY), "needs engagements"),
        (partial(SimulatedRun, run_id="bench-7", kind=RunKind.RUN_IN, cycles=0), "must start with sim-"),
        (partial(SimulatedRun, run_id="sim-7", kind=RunKind.STATIONARY_STRIBECK, cycles=0), "must carry plateaus"),
        (
            partial(SimulatedRun, run_id="sim-1", kind=RunKind.DYNAMIC_STRIBECK, cycles=0, duty=DUTY),
            "must carry a record",
        ),
        (partial(SimulatedRun, run_id="sim-1", kind=RunKind.RUN_IN, cycles=0), "must carry a duty block"),
    ],
)
def test_nonsense_is_refused_before_the_first_run(made: Callable[[], object], rule: str) -> None:
    with pytest.raises(ValueError, match=rule):
        made()
