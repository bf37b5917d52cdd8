"""The client: it waits while the service is away, on a clock of the test's."""

import email.utils
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx2
import pytest

from service.client.clutchlife import transport
from service.client.clutchlife.answers import RefusedError, ServiceAwayError, content, passing, problem, retry_after
from service.client.clutchlife.transport import NoLongerWantedError, Service
from tests.service.cli.sending.stand_in_service import URL
from tests.service.cli.sending.stand_in_service import problem as own

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


def test_a_wait_beyond_its_patience_is_not_begun(clock: Clock) -> None:
    with pytest.raises(ServiceAwayError, match="503"):
        service(httpx2.Response(503, headers={"Retry-After": "86400"})).get("/x")
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


# --- What an answer means for a run: only the service's own word on its content refuses it.

PORTAL = httpx2.Response(200, html="<html>Please log in</html>")
NOW = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)


@pytest.mark.parametrize(
    "response",
    [
        PORTAL,
        httpx2.Response(200, json=["no object"]),
        httpx2.Response(204),
        *(httpx2.Response(status, headers={"Location": "https://elsewhere"}) for status in (301, 302, 303, 307, 308)),
        *(httpx2.Response(status) for status in (408, 425, 429, 502, 503, 504, 511, 520)),
        own(503, "busy"),
    ],
    ids=lambda response: str(response.status_code),
)
def test_what_passes_is_no_refusal(response: httpx2.Response) -> None:
    assert passing(response, content(response))


def test_a_redirect_and_a_login_page_are_named() -> None:
    assert "login page" in str(passing(PORTAL, content(PORTAL)))
    moved = httpx2.Response(308, headers={"Location": "https://new.test/"})
    assert "https://new.test/" in str(passing(moved, content(moved)))


def refusal(response: httpx2.Response) -> RefusedError:
    assert passing(response, content(response)) is None
    return RefusedError(response.status_code, problem(response))


@pytest.mark.parametrize(
    ("status", "slug"), [(422, "invalid-content"), (409, "conflict"), (413, "too-large")], ids=lambda part: str(part)
)
def test_the_service_itself_refuses_a_run(status: int, slug: str) -> None:
    error = refusal(own(status, slug))
    assert error.of_the_run
    assert not error.of_all_runs
    assert error.other_content == (slug == "conflict")


@pytest.mark.parametrize("status", [400, 405, 406, 409, 410, 411, 413, 414, 415, 421, 422, 426, 428, 431, 451, 499])
def test_a_proxy_refuses_no_run(status: int) -> None:
    """An nginx with a bound of its own answers 413 in HTML; the run is not bad, and others may pass."""
    for response in (httpx2.Response(status, html="<h1>no</h1>"), httpx2.Response(status, json={"detail": "no"})):
        error = refusal(response)
        assert not error.of_the_run
        assert not error.of_all_runs


@pytest.mark.parametrize(
    "response",
    [
        own(401, "unauthorized"),
        own(403, "forbidden"),
        own(404, "not-found"),
        own(409, "archived"),
        httpx2.Response(407),
    ],
    ids=lambda response: str(response.status_code),
)
def test_keys_addresses_and_clutches_are_wrong_for_all_runs(response: httpx2.Response) -> None:
    error = refusal(response)
    assert error.of_all_runs
    assert not error.of_the_run


def test_an_error_inside_the_service_refuses_no_run() -> None:
    error = refusal(own(500, "internal-error"))
    assert (error.of_the_run, error.of_all_runs) == (False, False)


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
        (
            {
                "Date": http_date(NOW + timedelta(days=365)),
                "Retry-After": http_date(NOW + timedelta(days=365, seconds=5)),
            },
            5,
        ),
    ],
    ids=str,
)
def test_retry_after_is_a_number_or_a_date(headers: dict[str, str], seconds: float) -> None:
    assert retry_after(httpx2.Headers(headers), now=NOW) == seconds
