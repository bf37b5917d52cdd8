"""Causes of many runs at once: each is named with its number and the cycles of every run, and honest runs have none."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from models.plausibility.common_causes import (
    OFFSET,
    RESTART,
    ROLL_OVER,
    STUCK,
    TWO_CLUTCHES,
    UNIT,
    CommonCause,
    common_cause_of,
)
from models.plausibility.slips import Run, RunReading

DAY = 86_400.0
STEP, COUNT = 1_000.0, 12
TRUE = STEP * np.arange(COUNT)


def run(name: str, cycles: float, day: float, cof: float, *, fixed: bool = False) -> Run:
    reading = RunReading(cycles=cycles, log_cof=float(np.log(cof)), spread=0.004)
    moment = day * DAY
    return Run(
        name=name,
        kind="stationary_stribeck",
        cycles=cycles,
        reading=lambda: reading,
        tests=True,
        moment=moment,
        fixed=fixed,
    )


def life(sent: Sequence[float], true: Sequence[float] = TRUE, *, name: str = "t", fixed: bool = False) -> list[Run]:
    """Tests two days apart, COF falling evenly to 0.6 of new over the true cycles."""
    rng = np.random.default_rng(5)
    cofs = 0.1 * (1.0 - 0.4 * np.array(true) / TRUE[-1]) * (1.0 + 0.003 * rng.standard_normal(len(sent)))
    return [
        run(f"{name}{k}", float(cycles), 2.0 * k, cof, fixed=fixed)
        for k, (cycles, cof) in enumerate(zip(sent, cofs.tolist(), strict=True))
    ]


def found(runs: Sequence[Run]) -> tuple[CommonCause, dict[str, float]] | None:
    """The cause, and the cycles of each run of it by name; the history is in the order of the cycles."""
    ordered = sorted(runs, key=lambda each: each.cycles)
    cause = common_cause_of(ordered)
    if cause is None:
        return None
    return cause, {ordered[index].name: cycles for index, cycles in zip(cause.runs, cause.cycles, strict=True)}


@pytest.mark.parametrize(
    ("sent", "first", "name", "number"),
    [
        pytest.param(np.where(TRUE < 5e3, TRUE, TRUE - 5e3), 5, RESTART, 5e3, id="at zero"),
        pytest.param(np.where(TRUE < 5e3, TRUE, TRUE + 5e4), 5, OFFSET, -5e4, id="a used counter"),
        pytest.param(np.where(TRUE < 5e3, TRUE, TRUE / 1e3), 5, UNIT, 1e3, id="in thousands"),
    ],
)
def test_a_counter_that_changes_is_one_cause_of_all_that_follows(
    sent: np.ndarray, first: int, name: str, number: float
) -> None:
    cause, cycles = found(life(sent))
    assert (cause.name, cause.number) == (name, number)
    assert cycles == {f"t{k}": TRUE[k] for k in range(first, COUNT)}
    assert cause.log_odds > 3.0


def test_a_counter_of_16_bits_may_roll_over_twice() -> None:
    true = 60_500.0 + 9_000.0 * np.arange(COUNT)
    worn = TRUE[-1] * (true - true[0]) / (true[-1] - true[0])
    cause, cycles = found(life(true % 65_536.0, worn))
    assert (cause.name, cause.number) == (ROLL_OVER, 65_536.0)
    assert cycles == {f"t{k}": true[k] for k in range(1, COUNT)}


def test_a_counter_that_stands_still_is_dated_by_what_is_around_it() -> None:
    sent = np.where((TRUE > 3e3) & (TRUE < 8e3), 3e3, TRUE)
    cause, cycles = found(life(sent))
    assert cause.name == STUCK
    assert cycles == {f"t{k}": TRUE[k] for k in (4, 5, 6, 7)}
    # repeated tests of a clutch that does not change are no cause
    assert found(life(sent, np.zeros(COUNT))) is None


def test_another_clutchs_runs_come_between() -> None:
    own, other = life(TRUE), life(TRUE[:5], TRUE[:5], name="o")
    between = [each._replace(moment=own[5 + k].moment + 0.5 * DAY) for k, each in enumerate(other)]
    cause, cycles = found([*own, *between])
    assert cause.name == TWO_CLUTCHES
    assert set(cycles) == {"o0", "o1", "o2", "o3", "o4"}


def test_cof_parts_the_runs_of_two_clutches_where_their_cycles_meet() -> None:
    """The other clutch is at 5,700 cycles half a day after this one is at 6,000, and this one was at 5,000 before: by cycles
    and dates the two tests could be of either."""
    own = life(TRUE)
    other = life([0.0, 2_600.0, 5_700.0, 9_800.0, 13_400.0], np.zeros(5), name="o")
    between = [each._replace(moment=own[4 + k].moment + 0.5 * DAY) for k, each in enumerate(other)]
    cause, cycles = found([*own, *between])
    assert cause.name == TWO_CLUTCHES
    assert set(cycles) == {each.name for each in other}


def test_a_counter_that_jumps_while_friction_stays_level_may_have_jumped_by_any_number() -> None:
    """Ragged gaps, and once twenty of them in the time of one: any offset that leaves a gap like the others would do."""
    gaps = 6e3 * np.exp(0.3 * np.random.default_rng(0).standard_normal(COUNT - 1))
    true = np.round(np.append(0.0, np.cumsum(gaps)))
    cause, cycles = found(life(np.where(TRUE < 5e3, true, true + 1.19e5), np.zeros(COUNT)))
    assert cause.name == OFFSET
    assert set(cycles) == {f"t{k}" for k in range(5, COUNT)}


@pytest.mark.parametrize(
    "runs",
    [
        pytest.param(life(TRUE), id="as usual"),
        pytest.param(
            [each._replace(moment=None) for each in life(np.where(TRUE < 5e3, TRUE, TRUE - 5e3))], id="no dates"
        ),
        pytest.param(life(np.where(TRUE < 5e3, TRUE, TRUE - 5e3), fixed=True), id="confirmed"),
        pytest.param(
            [each._replace(moment=each.moment + 700.0 * DAY * (k > 5)) for k, each in enumerate(life(TRUE))],
            id="a pause of two years",
        ),
        pytest.param(life(np.cumsum(STEP * 1.6 ** np.arange(COUNT))), id="ever longer steps"),
        pytest.param(life([*TRUE[:5], 5e4, *TRUE[6:]]), id="one zero too many"),
    ],
)
def test_honest_runs_and_single_slips_have_no_common_cause(runs: list[Run]) -> None:
    found_cause = found(runs)
    assert found_cause is None or (len(found_cause[0].runs) == 1 and found_cause[0].log_odds < 0.0)


def test_a_clutch_that_stays_level_is_judged_by_its_pace_in_time() -> None:
    """Fifty thousand cycles in two days where a thousand are usual: another counter. In a hundred days they are honest."""
    sent = np.where(TRUE < 5e3, TRUE, TRUE + 5e4)
    runs = life(sent, np.zeros(COUNT))
    assert found(runs)[0].name == OFFSET
    late = [each._replace(moment=each.moment + 100.0 * DAY * (k > 4)) for k, each in enumerate(runs)]
    assert found(late) is None


def test_a_run_at_other_cycles_shows_the_same() -> None:
    (first, *_) = life(TRUE)
    assert first.at(700.0).sent == replace(first.sent, cycles=700.0)
    assert first.at(700.0).cycles == 700.0
