"""What an answer means to a sender: the service's, not now, or never.

| answer | meaning | what becomes of a run |
|---|---|---|
| 2xx with a JSON object | the service's answer | stored |
| 2xx with anything else, 3xx, 511 | a login page, a proxy, a wrong address | waits; tried again while patience lasts |
| 408, 425, 429, 502, 503, 504, other 5xx | not now | waits; tried again while patience lasts |
| 500 | the service failed on this request | waits; the next run is sent |
| 401, 403, 404, 407, and the service's `archived` | the key, the address or the clutch is wrong | all wait; sending ends |
| the service's `invalid-content` (422), `conflict` (409), `too-large` (413) | the run is bad | refused |
| any other 4xx, or one without the service's problem type | not the service, or not the run | waits; the next run is sent |
"""

from collections.abc import Mapping
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import TYPE_CHECKING, Any, TypeAlias

from .notebook import as_html

if TYPE_CHECKING:
    import httpx2

#: A JSON object, as the service answers it or is sent it.
JsonObject: TypeAlias = dict[str, Any]
#: Statuses below 500 that pass by themselves: a slow request, one that came too early, too many of them.
_TRANSIENT = (408, 425, 429)
#: Statuses that hold for every run of a clutch: no key, no permission, no such clutch or address, a proxy's key; 0 is an
#: address that cannot be asked.
_ALL_RUNS = (0, 401, 403, 404, 407)
#: Answers to a request that has stored nothing: not taken yet (425, 429, 503), or taken by somebody else (redirected).
_STORED_NOTHING = (301, 302, 303, 307, 308, 425, 429, 503, 511)
#: The service's own types of problem that are about the content of one run, and that are about the clutch.
_TYPE = "urn:clutchlife:problem:"
_OF_THE_RUN = tuple(_TYPE + slug for slug in ("invalid-content", "conflict", "too-large"))
_CONFLICT, _ARCHIVED, _UNKNOWN = _TYPE + "conflict", _TYPE + "archived", _TYPE + "not-found"
#: Characters of an answer that is no problem report, quoted as its detail.
_MAX_QUOTED = 500


class ClutchlifeError(Exception):
    """Base class of the client's errors. `problem` is the service's report (RFC 9457), empty where there is none."""

    problem: JsonObject

    def __init__(self, message: str, problem: JsonObject | None = None) -> None:
        super().__init__(message)
        self.problem = {} if problem is None else problem


class ServiceAwayError(ClutchlifeError):
    """The service did not answer, or was busy, for longer than the patience.

    `perhaps_stored`: a try reached a server without an answer, so it may have been carried out.
    """

    def __init__(self, message: str, *, perhaps_stored: bool = True, problem: JsonObject | None = None) -> None:
        super().__init__(message, problem)
        self.perhaps_stored = perhaps_stored


class DiagnosisFailedError(ClutchlifeError):
    """A diagnosis ended without a report; `problem` holds why as `detail`."""


#: What a suggestion says beside its columns.
_SUGGESTED = ("table", "time", "decimal", "missing", "good", "kind", "cycles", "clutch_id")


class RefusedError(ClutchlifeError):
    """The service refused the request; repeating it would not help. `problem["errors"]` lists the wrong places."""

    def __init__(self, status: int, problem: JsonObject) -> None:
        reason = str(problem.get("detail") or problem.get("title") or "refused")
        super().__init__(f"{status}: {reason}" if status else reason, problem)
        self.status = status

    @property
    def of_the_run(self) -> bool:
        """Whether the service itself refuses this run's content, in contrast to a proxy's 4xx."""
        return 400 <= self.status < 500 and self.problem.get("type") in _OF_THE_RUN

    @property
    def of_all_runs(self) -> bool:
        """Whether every other run of the clutch would get this answer too."""
        return self.status in _ALL_RUNS or self.problem.get("type") == _ARCHIVED

    @property
    def suggestion(self) -> JsonObject | None:
        """A suggested way to read a refused file, for you to confirm (`Client.confirm_suggestion`); None: nothing is
        suggested."""
        held = self.problem.get("suggestion")
        return held if isinstance(held, dict) else None

    @property
    def unknown(self) -> bool:
        """Whether the service itself reports that nothing has that name."""
        return self.problem.get("type") == _UNKNOWN

    @property
    def other_content(self) -> bool:
        """Whether the service has other content stored under the run's name."""
        return self.problem.get("type") == _CONFLICT


def suggested(suggestion: JsonObject) -> str:
    """A suggestion as one line: its columns, clock, run and first row."""
    parts = [f"{channel} from {title}" for channel, title in suggestion["map"].items()]
    stated = {name: suggestion[name] for name in _SUGGESTED if suggestion.get(name) not in (None, "")}
    parts += [f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}" for name, value in stated.items()]
    first = ", ".join(f"{name} {value:.6g}" for name, value in (suggestion["rows"] or [{}])[0].items())
    return f"suggested ({suggestion['confidence']:.0%}): {', '.join(parts)}; first row: {first}"


def passing(response: "httpx2.Response", answer: object | None) -> str | None:
    """Why a response is temporary or not from the service, so that the request is retried; None if the response is
    final."""
    status = response.status_code
    if status < 300:
        if answer is not None:
            return None
        media = response.headers.get("Content-Type", "nothing")[:_MAX_QUOTED]
        return f"status {status} with {media}, which is not from the service: is it a login page or a proxy?"
    if status < 400:
        target = response.headers.get("Location", "nowhere")[:_MAX_QUOTED]
        return f"status {status}, a redirect to {target}: is the address right?"
    if status in _TRANSIENT or status > 500:
        return f"busy or not ready, status {status}"
    return None


def perhaps_stored(response: "httpx2.Response") -> bool:
    """Whether the service may have carried out a request although it got this temporary response."""
    return response.status_code not in _STORED_NOTHING


class ServiceAnswer(JsonObject):
    """A JSON object as the service sent it; a notebook shows it as a table."""

    def _repr_html_(self) -> str:
        return as_html(self)


def content(response: "httpx2.Response") -> ServiceAnswer | None:
    """The JSON object of a response; None if it holds none."""
    try:
        answer = response.json()
    except (ValueError, RecursionError):
        return None
    return ServiceAnswer(answer) if isinstance(answer, dict) else None


def csv(response: "httpx2.Response") -> str | None:
    """The rows of a CSV response; None for any other."""
    return response.text if response.headers.get("Content-Type", "").startswith("text/csv") else None


def image(response: "httpx2.Response") -> bytes | None:
    """The file of a response that is a photograph or a run's file; None for any other."""
    media = response.headers.get("Content-Type", "")
    return response.content if media.startswith(("image/", "application/octet-stream")) else None


def problem(response: "httpx2.Response") -> JsonObject:
    """A refusal's problem report, made from its text if it has none."""
    report = content(response)
    return {"detail": response.text[:_MAX_QUOTED]} if report is None else report


def retry_after(headers: Mapping[str, str], *, now: datetime | None = None) -> float:
    """Seconds to wait by `Retry-After`, a number or a date (RFC 9110, section 10.2.3); 0 if it is neither.

    A date counts from the response's own `Date`, so that a wrong clock on this side does not matter.
    """
    text = headers.get("Retry-After", "").strip()
    if text.isascii() and text.isdigit():
        return float(text)
    date = _moment(text)
    if date is None:
        return 0.0
    start = _moment(headers.get("Date", "")) or now or datetime.now(UTC)
    return max(0.0, (date - start).total_seconds())


def _moment(text: str) -> datetime | None:
    try:
        date = parsedate_to_datetime(text)
    except (ValueError, TypeError, IndexError, OverflowError):
        return None
    return date if date.tzinfo is not None else date.replace(tzinfo=UTC)
