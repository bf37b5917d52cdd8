"""Doubts: the slips of the issue are held with a message that helps, and honest runs are not."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from service.clutch.plausibility.doubts import Judged, doubts_together
from service.clutch.timeline import Event, Shown
from tests.lab.plausibility import simulated, slips, trials
from tests.lab.plausibility.bench import REFUSED, Bench, Body, with_gain
from tests.support import stationary

CYCLES = (0, 500, 1000, 2000, 3000, 4000, 5000, 6000)


def bench_after(cycles: Iterable[int] = CYCLES) -> Bench:
    bench = Bench({})
    for count in cycles:
        bench.accept(stationary(count, run_id=f"s{count}"))
    return bench


def next_test(*, torque: float = 1.0, oil: float = 85.0, **changed: Any) -> Body:
    """The test that follows, its torque so many times what it would be."""
    body = with_gain(stationary(7000, run_id="next"), torque)
    body["channels"]["oil_temperature_c"] = [oil] * len(body["channels"]["torque_nm"])
    return body | changed


def scaled(channel: str, factor: float) -> Body:
    """The test that follows, a channel of it in another unit."""
    body = next_test()
    body["channels"][channel] = [factor * value for value in body["channels"][channel]]
    return body


def made(at: float, level: float, *, new_level: bool = False) -> Event:
    """A test of a clutch whose COF hardly changes, at a level of it."""
    cof = level * (1.0 + 0.002 * np.random.default_rng(int(at)).standard_normal())
    measured = {
        "cofs": {5e5: (cof, 1e-4)},
        "shown": Shown(cof=cof, pressure=5e5, speed=50.0),
        "speed_range": (1.0, 50.0),
    }
    return Event(run_id=f"t{at:g}", kind="stationary_stribeck", cycles=at, moment=at, new_level=new_level, **measured)


@pytest.mark.parametrize(
    ("tests", "begins", "incoming"),
    [
        (12, 10, None), (46, 10, None), (50, 10, None), (55, 10, None),  # the first of the forty last at 50
        (70, 10, 10_500.0), (70, 25, 500.0), (70, 60, 500.0),  # at 25 between those that are nearest to either
    ],
)  # fmt: skip
def test_a_level_stays_when_earlier_tests_are_out_of_sight(tests: int, begins: int, incoming: float | None) -> None:
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


OFF_PACE = ("cycles_off_pace",)
BLOCK: Body = {"kind": "duty_cycles", "run_id": "d", "duty": {"cycles": 1000, "initial_speed_rpm": 2000}}


@pytest.mark.parametrize(
    ("before", "run", "codes", "words"),
    [
        pytest.param(CYCLES, next_test(), (), [], id="a test that follows"),
        pytest.param((), next_test(), (), [], id="a first test"),
        pytest.param(
            CYCLES, next_test(cycles=70_000), OFF_PACE,
            ["70000 cycles", "64000 after the previous run", "1000 cycles apart", "Is it 7000?", "Confirm or correct it."],
            id="a zero too many",
        ),
        # 700 cycles would be an honest late run; the COF is that of 7000
        pytest.param(CYCLES, next_test(cycles=700), OFF_PACE, ["is expected at these cycles"], id="swapped digits by COF"),
        pytest.param(CYCLES, stationary(700, run_id="late"), (), [], id="a late run"),
        pytest.param((), next_test(cycles=3e9), OFF_PACE, [], id="cycles beyond any clutch of a first run"),
        # 8.9 times too large by pounds and inches, and still 6.8 times too large then
        pytest.param(
            (0, 1000, 2000), next_test(cycles=3000, torque=60.0), ("cof_beyond_physics",), ["mean COF is 2."],
            id="a unit that does not explain all",
        ),
        pytest.param(
            CYCLES, next_test(oil=358.1, torque=1.1), ("unit",), ["was it sent in K?"],
            id="oil in kelvin whatever COF is",
        ),
        pytest.param(
            CYCLES, scaled("pressure_bar", 14.5038), ("unit",), ["bar and gives a COF of", "was it sent in psi?"],
            id="pressure in psi",
        ),
        pytest.param(
            CYCLES, scaled("speed_rpm", 0.10472), ("unit",),
            ["speed is up to 206.3 rpm, unlike in other tests: was it sent in rad/s?"],
            id="speed in radians a second",
        ),
        pytest.param(
            (), scaled("pressure_bar", 14.5), ("unit",), ["bar and gives a COF of 0.00244: was it sent in psi?"],
            id="pressure in psi of a first test",
        ),
        pytest.param((5500,), BLOCK | {"cycles": 10_000}, (), [], id="any of equal blocks first"),
        pytest.param(CYCLES, BLOCK | {"cycles": 70_000}, OFF_PACE, [], id="a zero too many in a block"),
        pytest.param(
            CYCLES, next_test(channels=stationary(0)["channels"]), ("cof_off_course",), ["another clutch"],
            id="the test of a new clutch",
        ),
    ],
)  # fmt: skip
def test_slips_are_asked_about_and_honest_runs_are_not(
    before: tuple[int, ...], run: Body, codes: tuple[str, ...], words: list[str]
) -> None:
    answer = bench_after(before).answer(run)
    assert answer.codes == codes
    assert [part for part in words if part not in answer.message] == []


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


def test_a_cof_beyond_physics_is_doubted_of_a_first_run() -> None:
    (code,) = Bench({}).answer(next_test(torque=61.0)).codes
    assert code in {"unit", "cof_beyond_physics"}
    assert "sign" in Bench({}).answer(next_test(torque=-1.0)).message


def test_order_in_time_counts_where_runs_are_dated() -> None:
    """Maintenance shows no COF: only its date tells that it was not made at 2600 cycles."""
    bench = Bench({})
    for month, count in enumerate(CYCLES, start=1):
        bench.accept(stationary(count, run_id=f"s{count}") | {"started_at": f"2026-{month:02d}-01T00:00:00+00:00"})
    change: Body = {"kind": "maintenance", "event": "other", "run_id": "m", "cycles": 2600}
    assert bench.answer(change | {"started_at": "2026-12-01T00:00:00+00:00"}).codes == ("cycles_against_time",)
    assert bench.answer(change | {"run_id": "n", "started_at": "2026-04-20T00:00:00+00:00"}).codes == ()


def test_after_a_rebuild_cof_may_jump_back_and_a_second_life_go_as_the_first_did() -> None:
    """Its second test comes late."""
    bench = bench_after()
    new = stationary(6500, run_id="new", wear=0.0)
    assert bench.answer(new).codes != ()
    bench.accept({"kind": "maintenance", "event": "rebuild", "run_id": "r", "cycles": 6500})
    assert bench.answer(new | {"run_id": "r0"}).codes == ()
    assert bench.answer(stationary(6000, run_id="r6000") | {"cycles": 12_500}).codes == ()


@pytest.mark.parametrize("name", [*slips.UNITS, *slips.UNPLUGGED])
def test_wrong_units_and_dead_channels_are_held(name: str) -> None:
    wrong = slips.UNITS.get(name) or slips.UNPLUGGED[name]
    body = wrong(np.random.default_rng(5), next_test())
    answer = bench_after().answer(body)
    assert answer.codes
    if name in slips.UNITS:
        assert answer.codes == ("unit",)
        assert name.split()[-1] in answer.message
    assert answer.codes == (REFUSED,) or answer.message.endswith(("confirm it.", "connected?"))


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
    (sent,) = trials.slipped(7001, rig, number)
    assert sent.held


def test_what_is_held_does_not_depend_on_the_order_of_arrival() -> None:
    """Two zeros too many, a test in °F and one of another clutch: asked about in any order, the same runs are held."""
    runs = [stationary(1000 * k, run_id=f"s{k}") for k in range(11)]
    for k, run in enumerate(runs):
        rows = len(run["channels"]["torque_nm"])
        run["channels"]["oil_temperature_c"] = [140.0 if k == 5 else 60.0] * rows
    runs[3]["cycles"], runs[9]["cycles"] = 30_000, 90_000
    runs[7] = with_gain(runs[7], 1.6)
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
