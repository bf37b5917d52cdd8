"""A date that cannot be is ignored, with a warning."""

import pytest

from service.clutch.items import date_notice
from service.clutch.timeline import moment_of

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
