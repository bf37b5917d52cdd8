"""A date that cannot be, or does not fit the others in the order of cycles, takes no part in the pace, with a warning."""

from datetime import datetime

import pytest

from models.degradation.severity import Block
from service.clutch.items import date_notice
from service.clutch.notices import history_warnings
from service.clutch.timeline import Event, Life, moment_at, moment_of, pace_of
from tests.lab.plausibility.bench import Bench
from tests.support import stationary

RECEIVED = "2026-11-29T12:00:00+00:00"


@pytest.mark.parametrize(
    ("started_at", "word"),
    [
        pytest.param("1970-01-01T00:00:10+00:00", "too early", id="a clock that begins at zero"),
        pytest.param("2000-01-01T03:00:00+00:00", "too early", id="a recorder that lost the time"),
        pytest.param("2062-11-10T08:00:00+00:00", "in the future", id="a clock in the future"),
        pytest.param("2026-12-01T12:00:01+00:00", "in the future", id="two days ahead"),
    ],
)
def test_an_impossible_date_is_none_and_is_said(started_at: str, word: str) -> None:
    moment, dated = moment_of(started_at, RECEIVED)
    assert (moment, dated) == moment_of(None, RECEIVED)
    assert not dated
    (notice,) = date_notice(started_at, RECEIVED)
    assert notice.code == "date_not_possible"
    assert word in notice.message


@pytest.mark.parametrize(
    "started_at", ["2026-11-29T11:00:00+00:00", "2026-11-30T02:00:00+14:00", "2001-06-01T00:00:00+00:00"]
)
def test_a_possible_date_is_the_runs(started_at: str) -> None:
    moment, dated = moment_of(started_at, RECEIVED)
    assert dated
    assert moment <= moment_of(None, RECEIVED)[0] + 86_400.0
    assert date_notice(started_at, RECEIVED) == []
    assert date_notice(None, RECEIVED) == []


DAY = 86_400.0


def dated(dates: dict[int, str]) -> Life:
    """Ten tests a thousand cycles and two days apart, each sent when it was made; these say another date."""
    bench = Bench({})
    for k in range(10):
        date = dates.get(k, f"2026-05-{4 + 2 * k:02}T08:00:00+00:00")
        bench.accept(stationary(1_000 * k, run_id=f"t{k}") | {"started_at": date})
    return Life(origin=0.0, events=bench.events)


@pytest.mark.parametrize(
    ("run", "date"),
    [
        pytest.param(0, "2016-05-04T08:00:00+00:00", id="a first test ten years before"),
        pytest.param(0, "1970-01-01T00:00:10+00:00", id="a first test of 1970"),
        pytest.param(9, "2062-05-22T08:00:00+00:00", id="a last test of 2062"),
        pytest.param(9, "2026-02-05T08:00:00+00:00", id="a last test whose day and month were swapped"),
        pytest.param(9, "2026-05-20T08:10:00+00:00", id="a thousand cycles in ten minutes"),
        pytest.param(5, "2025-05-14T08:00:00+00:00", id="one in the middle, of the year before"),
    ],
)
def test_the_pace_and_the_date_of_the_end_are_those_of_the_dates_that_fit(run: int, date: str) -> None:
    events = dated({run: date}).events
    assert pace_of(events) == pytest.approx(500.0 / DAY)
    end = datetime.fromisoformat("2026-05-24T08:00:00+00:00").timestamp()
    assert moment_at(events, 500.0 / DAY, 10_000.0) == pytest.approx(end)


def test_a_date_that_does_not_fit_is_said_of_its_run_alone() -> None:
    life = dated({9: "2026-02-05T08:00:00+00:00"})
    said = {name: [w.code for w in warnings] for name, warnings in history_warnings([life], {}).items()}
    assert {name for name, codes in said.items() if "date_out_of_order" in codes} == {"t9"}
    assert "2026-02-05" in history_warnings([life], {})["t9"][-1].message
    assert not any("date_out_of_order" in codes for codes in history_warnings([dated({})], {}).values())


def test_a_block_of_cycles_is_dated_by_its_start() -> None:
    """It begins right after the test before it: no thousand cycles in a minute."""
    events = [
        Event(run_id=f"{kind}{k}", kind=kind, cycles=1_000.0 * k, moment=DAY * at, dated=True, duty=duty)
        for k in range(5)
        for kind, at, duty in (
            ("duty_cycles", k - 1 + 2e-3, Block(end=1_000.0 * k, cycles=1_000.0)),
            ("stationary_stribeck", float(k), None),
        )
        if at >= 0.0
    ]
    assert pace_of(events) == pytest.approx(1_000.0 / DAY)
    assert not any(warnings for warnings in history_warnings([Life(origin=0.0, events=tuple(events))], {}).values())
