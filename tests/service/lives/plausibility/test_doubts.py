"""Doubts: the slips of the issue are held with a message that helps, and honest runs are not."""

import copy
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from service.lives.history import Event, Shown
from service.lives.plausibility.doubts import Judged, doubts_together
from tests.plausibility import simulated, slips, trials
from tests.plausibility.bench import REFUSED, Bench
from tests.support import stationary

Body = dict[str, Any]
CYCLES = (0, 500, 1000, 2000, 3000, 4000, 5000, 6000)


def bench_after(cycles: Iterable[int] = CYCLES) -> Bench:
    bench = Bench({})
    for count in cycles:
        bench.accept(stationary(count, run_id=f"s{count}"))
    return bench


def next_test(**changed: Any) -> Body:
    body = stationary(7000, run_id="next")
    body["channels"]["oil_temperature_c"] = [85.0] * len(body["channels"]["torque_nm"])
    return body | changed


def made(at: float, level: float, *, new_level: bool = False) -> Event:
    """A test of a clutch whose COF hardly changes, at a level of it."""
    cof = level * (1.0 + 0.002 * np.random.default_rng(int(at)).standard_normal())
    return Event(
        run_id=f"t{at:g}",
        kind="stationary_stribeck",
        cycles=at,
        moment=at,
        speed_range=(1.0, 50.0),
        cofs={5e5: (cof, 1e-4)},
        shown=Shown(cof=cof, pressure=5e5, speed=50.0),
        new_level=new_level,
    )


@pytest.mark.parametrize(
    ("tests", "begins", "incoming"),
    [
        (12, 10, None), (46, 10, None), (50, 10, None), (55, 10, None),  # the first of the forty last at 50
        (70, 10, 10_500.0), (70, 25, 500.0), (70, 60, 500.0),  # at 25 between those that are nearest to either
    ],
)  # fmt: skip
def test_a_level_stays_where_the_tests_before_it_are_no_longer_looked_at(
    tests: int, begins: int, incoming: float | None
) -> None:
    """And none begins a second time with the first test that is looked at after it."""
    begun = 1000.0 * begins
    known = [made(1000.0 * k, 0.1 if k < begins else 0.08, new_level=k == begins) for k in range(tests)]
    new = None if incoming is None else made(incoming, 0.1 if incoming < begun else 0.08)
    assert doubts_together(known, [], new, Bench({}).geometry, corrected=False) == Judged()


def test_a_level_passes_to_the_next_test_however_long_ago_its_first_was_made() -> None:
    """Where that is withdrawn."""
    first = made(10_000.0, 0.08, new_level=True)
    left = [made(1000.0 * k, 0.1 if k < 10 else 0.08) for k in range(70) if k != 10]
    judged = doubts_together(left, [], None, Bench({}).geometry, corrected=False, changed=[first])
    assert judged == Judged(levels={"t11000": True})


def test_a_test_that_follows_is_not_doubted() -> None:
    assert bench_after().answer(next_test()).codes == ()


def test_a_zero_too_many_is_asked_about() -> None:
    answer = bench_after().answer(next_test(cycles=70_000))
    assert answer.codes == ("cycles_off_pace",)
    for part in (
        "70000 cycles",
        "64000 after the previous run",
        "1000 cycles apart",
        "Is it 7000?",
        "Confirm or correct it.",
    ):
        assert part in answer.message


def test_swapped_digits_among_earlier_runs_are_seen_by_the_cof() -> None:
    """700 cycles would be an honest late run; its COF is that of 7000."""
    bench = bench_after()
    answer = bench.answer(next_test(cycles=700))
    assert answer.codes == ("cycles_off_pace",)
    assert "is expected at these cycles" in answer.message
    assert bench.answer(stationary(700, run_id="late")).codes == ()


@pytest.mark.parametrize("event", ["rebuild", "oil_change"])
@pytest.mark.parametrize("gap", [250, 500, 900])
def test_maintenance_at_a_round_number_is_no_zero_too_many(gap: int, event: str) -> None:
    """A tenth of it is a test's number; the same with a digit more is no round one."""
    bench = bench_after(range(0, 9 * gap, gap))
    maintenance = {"kind": "maintenance", "event": event, "run_id": "m", "cycles": 10 * gap}
    assert bench.answer(maintenance).codes == ()
    assert bench.answer(maintenance | {"cycles": 55 * gap}).codes == ("cycles_off_pace",)


def test_a_far_jump_that_a_duty_block_declares_is_honest() -> None:
    bench = bench_after()
    block = {"kind": "duty_cycles", "run_id": "d", "cycles": 70_000, "duty": {"cycles": 64_000}}
    assert bench.answer(block).codes == ()
    assert bench.answer(stationary(70_000, run_id="far")).codes == ()
    shorter = block | {"duty": {"cycles": 1000}}
    assert bench_after().answer(shorter).codes == ("cycles_off_pace",)


def test_cycles_beyond_any_clutch_are_doubted_of_a_first_run() -> None:
    assert Bench({}).answer(next_test(cycles=3e9)).codes == ("cycles_off_pace",)
    assert Bench({}).answer(next_test()).codes == ()


def test_a_cof_beyond_physics_is_doubted_of_a_first_run() -> None:
    body = next_test()
    body["channels"]["torque_nm"] = [61.0 * torque for torque in body["channels"]["torque_nm"]]
    answer = Bench({}).answer(body)
    assert len(answer.codes) == 1
    assert answer.codes[0] in {"unit", "cof_beyond_physics"}
    body["channels"]["torque_nm"] = [-torque / 61.0 for torque in body["channels"]["torque_nm"]]
    assert "sign" in Bench({}).answer(body).message


def test_a_unit_is_asked_about_only_where_it_explains_all() -> None:
    """Sixty times the torque is 8.9 times too large by pounds and inches, and still 6.8 times too large then."""
    body = next_test()
    body["channels"]["torque_nm"] = [60.0 * torque for torque in body["channels"]["torque_nm"]]
    answer = bench_after((0, 1000, 2000)).answer(body | {"cycles": 3000})
    assert answer.codes == ("cof_beyond_physics",)
    assert "mean COF is 2." in answer.message


def test_a_unit_that_does_not_touch_cof_is_asked_about_whatever_cof_is() -> None:
    """Oil in kelvin, and a COF that is a tenth off besides."""
    body = next_test()
    body["channels"]["oil_temperature_c"] = [358.1] * len(body["channels"]["torque_nm"])
    body["channels"]["torque_nm"] = [1.1 * torque for torque in body["channels"]["torque_nm"]]
    answer = bench_after().answer(body)
    assert answer.codes == ("unit",)
    assert "was it sent in K?" in answer.message


def test_order_in_time_counts_where_runs_are_dated() -> None:
    """Maintenance shows no COF: only its date tells that it was not made at 2600 cycles."""
    bench = Bench({})
    for month, count in enumerate(CYCLES, start=1):
        bench.accept(stationary(count, run_id=f"s{count}") | {"started_at": f"2026-{month:02d}-01T00:00:00+00:00"})
    change: Body = {"kind": "maintenance", "event": "other", "run_id": "m", "cycles": 2600}
    assert bench.answer(change | {"started_at": "2026-12-01T00:00:00+00:00"}).codes == ("cycles_against_time",)
    assert bench.answer(change | {"run_id": "n", "started_at": "2026-04-20T00:00:00+00:00"}).codes == ()


def test_arrival_is_no_evidence_of_order() -> None:
    """Without started_at runs come in any order, as a spool delivers them."""
    bench = Bench({})
    for count in np.random.default_rng(3).permutation(CYCLES).tolist():
        assert bench.answer(stationary(count, run_id=f"s{count}")).codes == ()


def test_after_a_rebuild_cof_may_jump_back() -> None:
    bench = bench_after()
    new = stationary(7000, run_id="new", wear=0.0)
    assert bench.answer(copy.deepcopy(new)).codes != ()
    bench.accept({"kind": "maintenance", "event": "rebuild", "run_id": "r", "cycles": 6500})
    assert bench.answer(new).codes == ()


def test_a_second_life_may_go_as_the_first_did() -> None:
    """The second test after a rebuild comes late."""
    bench = bench_after()
    bench.accept({"kind": "maintenance", "event": "rebuild", "run_id": "r", "cycles": 6500})
    bench.accept(stationary(6500, run_id="r0", wear=0.0))
    late = stationary(6000, run_id="r6000") | {"cycles": 12_500}
    assert bench.answer(late).codes == ()


def test_any_of_equal_blocks_may_come_first() -> None:
    """Of blocks of 1000 cycles each, sent in any order; a zero too many in a block is seen all the same."""
    block: Body = {"kind": "duty_cycles", "run_id": "d", "duty": {"cycles": 1000, "initial_speed_rpm": 2000}}
    assert bench_after((5500,)).answer(block | {"cycles": 10_000}).codes == ()
    assert bench_after().answer(block | {"cycles": 70_000}).codes == ("cycles_off_pace",)


@pytest.mark.parametrize("name", [*slips.UNITS, *slips.UNPLUGGED])
def test_wrong_units_and_dead_channels_are_held(name: str) -> None:
    wrong = slips.UNITS.get(name) or slips.UNPLUGGED[name]
    body = wrong(np.random.default_rng(5), next_test())
    assert body is not None
    answer = bench_after().answer(body)
    assert answer.codes
    if name in slips.UNITS:
        assert answer.codes == ("unit",)
        assert name.split()[-1] in answer.message
    assert answer.codes == (REFUSED,) or answer.message.endswith(("confirm it.", "connected?"))


def test_another_clutch_is_held_once_there_is_a_course() -> None:
    """The test of a clutch at 0 cycles, sent as that of one at 7000."""
    other = next_test(channels=stationary(0)["channels"])
    answer = bench_after().answer(other)
    assert answer.codes == ("cof_off_course",)
    assert "another clutch" in answer.message


@pytest.mark.parametrize(
    ("rig", "number"),
    [
        pytest.param("simulated rig", 18, id="the latest test, as if COF had a new level"),
        pytest.param("simulated rig", 55, id="a block that would join others by its length alone"),
        pytest.param("blind rig", 2, id="a dynamic test in kNm"),
        pytest.param("blind rig", 28, id="a dynamic test of another clutch"),
    ],
)
def test_a_slip_is_seen_in_a_run_that_has_no_place_in_the_course(rig: str, number: int) -> None:
    assert trials.slipped(7001, rig, number).held


def test_what_is_held_does_not_depend_on_the_order_of_arrival() -> None:
    """Two zeros too many, a test in °F and one of another clutch: asked about in any order, the same runs are held."""
    runs = [stationary(1000 * k, run_id=f"s{k}") for k in range(11)]
    for k, run in enumerate(runs):
        rows = len(run["channels"]["torque_nm"])
        run["channels"]["oil_temperature_c"] = [140.0 if k == 5 else 60.0] * rows
    runs[3]["cycles"], runs[9]["cycles"] = 30_000, 90_000
    runs[7]["channels"]["torque_nm"] = [1.6 * torque for torque in runs[7]["channels"]["torque_nm"]]
    slipped = {"s3", "s5", "s7", "s9"}
    rng = np.random.default_rng(4)
    for order in (range(11), range(10, -1, -1), *(rng.permutation(11).tolist() for _ in range(2))):
        bench = Bench({})
        for k in order:
            bench.answer(runs[k])
        assert {event.run_id for event in bench.held} == slipped


@pytest.mark.slow
def test_honest_campaigns_are_not_held() -> None:
    """Some 300 runs in every way of running a campaign, in order and shuffled: at most three held.

    At the demanded 0.5 % more than three come once in 15 such tests, at 3 % three or fewer once in 50.
    """
    runs = held = 0
    for number, style in enumerate(simulated.SCHEDULES * 2):
        rng = np.random.default_rng([31, number])
        made = simulated.campaign(rng, style=style, dynamic=False)
        bench = Bench(made.record)
        for run in (simulated.shuffled(rng, made) if number % 2 else made).runs:
            answer = bench.answer(run)
            runs += 1
            if answer.codes:
                held += 1
                bench.accept(run)
    assert runs > 200
    assert held <= 3


@pytest.mark.slow
def test_slips_of_whole_campaigns_are_held() -> None:
    """One slip of cycles in each of 40 campaigns: at 95 % held, fewer than 34 are held once in 200 such tests."""
    held = 0
    for number in range(40):
        rng = np.random.default_rng([32, number])
        made = simulated.campaign(rng, style=("even", "uneven", "bursts")[number % 3], dynamic=False)
        name = ("cycles x 10", "swapped digits")[number % 2]
        index = int(rng.integers(len(made.runs) // 2, len(made.runs)))
        while (wrong := slips.CYCLES[name](rng, made.runs[index])) is None or wrong == made.runs[index]:
            index = int(rng.integers(len(made.runs) // 2, len(made.runs)))
        bench = Bench(made.record)
        for run in made.runs[:index]:
            bench.accept(run)
        held += bool(bench.answer(wrong).codes)
    assert held >= 34
