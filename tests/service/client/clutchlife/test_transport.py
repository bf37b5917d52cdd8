"""The client: it waits while the service is away, on a clock of the test's."""

import email.utils
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx2
import pytest

from service.client.clutchlife import transport
from service.client.clutchlife.answers import RefusedError, ServiceAwayError, retry_after
from service.client.clutchlife.transport import NoLongerWantedError, Service
from tests.service.cli.sending.stand_in_service import URL

RECEIPT = httpx2.Response(200, json={"run_id": "r1"})


class Clock:
    """Time that passes in `sleep` alone."""

    def __init__(self) -> None:
        self.now = 0.0
        self.waits: list[float] = []

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self.waits.append(seconds)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    fake = Clock()
    monkeypatch.setattr(transport, "time", fake)
    return fake


Served = httpx2.Response | Exception


def service(*answers: Served, patience: float = 60.0) -> Service:
    """A service that gives these answers in turn, the last one for ever."""
    left = list(answers)

    def handle(_request: httpx2.Request) -> httpx2.Response:
        answer = left.pop(0) if len(left) > 1 else left[0]
        if isinstance(answer, Exception):
            raise answer
        return answer

    return Service(http=httpx2.Client(base_url=URL, transport=httpx2.MockTransport(handle)), patience=patience)


def test_it_waits_for_a_service_that_comes_back(clock: Clock) -> None:
    away: list[Served] = [
        httpx2.ConnectError("refused"),
        httpx2.Response(502),
        httpx2.Response(429),
        httpx2.Response(308, headers={"Location": "https://login.test"}),
        httpx2.Response(200, html="<p>log in</p>"),
    ]
    assert service(*away, RECEIPT).get("/x") == {"run_id": "r1"}
    assert clock.waits == [0.25, 0.5, 1.0, 2.0, 4.0]


def test_it_waits_as_long_as_it_is_told(clock: Clock) -> None:
    later = {"Date": "Sun, 01 Mar 2026 12:00:00 GMT", "Retry-After": "Sun, 01 Mar 2026 12:00:20 GMT"}
    assert service(httpx2.Response(503, headers=later), RECEIPT).get("/x")
    assert service(httpx2.Response(429, headers={"Retry-After": "9"}), RECEIPT).get("/x")
    assert clock.waits == [20.0, 9.0]


@pytest.mark.parametrize(
    ("answer", "patience", "words"),
    [
        (httpx2.Response(503, headers={"Retry-After": "86400"}), 60.0, "503"),
        (httpx2.Response(200, html="<html>Please log in</html>"), 0.0, "login page"),
        (httpx2.Response(308, headers={"Location": "https://new.test/"}), 0.0, "https://new.test/"),
    ],
)
def test_a_wait_beyond_its_patience_is_not_begun(
    clock: Clock, answer: httpx2.Response, patience: float, words: str
) -> None:
    with pytest.raises(ServiceAwayError, match=words):
        service(answer, patience=patience).get("/x")
    assert clock.waits == []


@pytest.mark.parametrize(
    ("answer", "perhaps"),
    [
        (httpx2.ConnectError("refused"), False),
        (httpx2.Response(503), False),
        (httpx2.Response(429), False),
        (httpx2.Response(302), False),
        (httpx2.ReadTimeout("slow"), True),
        (httpx2.RemoteProtocolError("cut"), True),
        (httpx2.Response(504), True),
        (httpx2.DecodingError("not gzip"), True),
    ],
    ids=str,
)
@pytest.mark.usefixtures("clock")
def test_it_tells_whether_a_lost_request_may_have_been_carried_out(answer: Served, perhaps: bool) -> None:
    with pytest.raises(ServiceAwayError) as raised:
        service(answer, patience=5).post("/x", {})
    assert raised.value.perhaps_stored is perhaps


def test_what_is_refused_is_not_tried_again(clock: Clock) -> None:
    for status in (400, 401, 404, 409, 413, 422, 500):
        with pytest.raises(RefusedError, match=str(status)):
            service(httpx2.Response(status, text="no")).get("/x")
    with pytest.raises(RefusedError):
        Service(http=httpx2.Client(base_url="nowhere")).get("/x")
    assert clock.waits == []


def test_what_is_wanted_no_more_is_not_tried_again(clock: Clock, tmp_path: Path) -> None:
    (tmp_path / "run").write_bytes(b"{}")
    wanted: Callable[[], bool] = lambda: not clock.waits  # noqa: E731  (until the first wait)
    with pytest.raises(NoLongerWantedError):
        service(httpx2.Response(503)).post_file("/x", tmp_path / "run", None, wanted)
    assert len(clock.waits) == 1


NOW = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)
NEXT_YEAR = NOW + timedelta(days=365)


def http_date(moment: datetime) -> str:
    return email.utils.format_datetime(moment, usegmt=True)


@pytest.mark.parametrize(
    ("headers", "seconds"),
    [
        ({}, 0),
        ({"Retry-After": "7"}, 7),
        ({"Retry-After": http_date(NOW + timedelta(seconds=90))}, 90),
        ({"Retry-After": http_date(NOW - timedelta(days=1))}, 0),
        ({"Retry-After": "Sunday, 01-Mar-26 12:00:30 GMT"}, 30),
        *(({"Retry-After": text}, 0) for text in ("-3", "nan", "inf", "1e9", "soon", "", "Mon, 99 Foo 2026")),
        # this machine's clock is a year behind: the service's own says how long it is
        ({"Date": http_date(NEXT_YEAR), "Retry-After": http_date(NEXT_YEAR + timedelta(seconds=5))}, 5),
    ],
    ids=str,
)
def test_retry_after_is_a_number_or_a_date(headers: dict[str, str], seconds: float) -> None:
    assert retry_after(httpx2.Headers(headers), now=NOW) == seconds
