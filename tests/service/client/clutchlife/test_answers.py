"""What an answer means for a run: only the service's own word on its content refuses it."""

import email.utils
from datetime import UTC, datetime, timedelta

import httpx2
import pytest

from service.client.clutchlife.answers import RefusedError, content, passing, problem, retry_after
from tests.service.cli.sending.stand_in_service import problem as own

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
