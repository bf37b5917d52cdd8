"""Requests to a service: repeated while it is away or busy; what it refuses is raised."""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from .answers import (
    JsonObject,
    RefusedError,
    ServiceAwayError,
    content,
    csv,
    image,
    passing,
    perhaps_stored,
    problem,
    retry_after,
)

if TYPE_CHECKING:
    import httpx2

#: What is read of a response.
Answer = TypeVar("Answer")

JSON = {"Content-Type": "application/json"}
#: Seconds between tries: doubled from the first to the last.
FIRST_WAIT, LAST_WAIT = 0.25, 15.0


def _failure(error: "httpx2.RequestError") -> tuple[str, bool]:
    """A failed request in words, without the library's names, and whether any byte of it may have been sent."""
    import httpx2  # start-up time

    if isinstance(error, httpx2.ConnectError | httpx2.ConnectTimeout | httpx2.PoolTimeout):
        return "no connection", False
    return "no answer in time" if isinstance(error, httpx2.TimeoutException) else "the connection broke off", True


class NoLongerWantedError(Exception):
    """The content no longer has to be sent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Service:
    """The HTTP interface of a running service. `patience` [s]: for how long a request is retried while the service is
    away or busy."""

    http: "httpx2.Client"
    patience: float = 60.0
    on_wait: Callable[[str, float], None] = lambda _reason, _seconds: None

    def post(self, path: str, content: Mapping[str, Any], *, prefer: str | None = None) -> JsonObject:
        """The answer to a POST of JSON; raises ServiceAwayError or RefusedError."""
        headers = JSON if prefer is None else JSON | {"Prefer": prefer}
        return self._answer("POST", path, content=_body(content), headers=headers)

    def put(self, path: str, content: Mapping[str, Any]) -> JsonObject:
        """The answer to a PUT of JSON, which replaces the resource at `path`; raises as `post` does."""
        return self._answer("PUT", path, content=_body(content), headers=JSON)

    def patch(self, path: str, content: Mapping[str, Any]) -> JsonObject:
        """The answer to a PATCH of JSON, which changes the resource at `path`; raises as `post` does."""
        return self._answer("PATCH", path, content=_body(content), headers=JSON)

    def pages(self, path: str, **params: Any) -> Iterator[JsonObject]:
        """The items of a list, page by page; raises as `post` does."""
        cursor: dict[str, str] = {}
        while True:
            page = self.get(path, **params, **cursor)
            yield from page["items"]
            if page["next"] is None:
                return
            cursor = {"cursor": page["next"]}

    def post_file(
        self, path: str, file: Path, parameters: Mapping[str, str] | None, wanted: Callable[[], bool] = lambda: True
    ) -> JsonObject:
        """The answer to a POST of a run's file, or of a JSON body if there are no parameters; raises as `post` does.

        `wanted` is called before every try; NoLongerWantedError if it returns false.
        """
        if parameters is None:
            return self._answer("POST", path, file=file, wanted=wanted, headers=JSON)
        return self._answer("POST", path, file=file, wanted=wanted, params=dict(parameters))

    def post_form(self, path: str, file: Path, profile: Mapping[str, Any], parameters: Mapping[str, str]) -> JsonObject:
        """The answer to a POST of a file and the profile to read it by; raises as `post` does."""
        form = {"profile": json.dumps(profile)}
        return self._answer("POST", path, file=file, params=dict(parameters), data=form)

    def post_photograph(self, path: str, file: Path, media_type: str) -> JsonObject:
        """The answer to a POST of a photograph; raises as `post` does."""
        return self._answer("POST", path, file=file, headers={"Content-Type": media_type})

    def file(self, path: str) -> bytes:
        """The file returned by a GET; raises as `post` does."""
        return self._repeated("GET", path, image)

    def delete(self, path: str) -> JsonObject:
        """The answer to a DELETE, empty if it has no body; raises as `post` does."""
        return self._repeated("DELETE", path, lambda response: {} if response.status_code == 204 else content(response))

    def get(self, path: str, **params: Any) -> JsonObject:
        """The answer to a GET; raises as `post` does."""
        return self._answer("GET", path, params=params)

    def table(self, path: str, **params: Any) -> str:
        """The CSV returned by a GET; raises as `post` does."""
        return self._repeated("GET", path, csv, params=params)

    def _answer(self, method: str, path: str, **request: Any) -> JsonObject:
        return self._repeated(method, path, content, **request)

    def _repeated(
        self,
        method: str,
        path: str,
        read: Callable[["httpx2.Response"], Answer | None],
        *,
        file: Path | None = None,
        wanted: Callable[[], bool] = lambda: True,
        **request: Any,
    ) -> Answer:
        """The answer to a request, which is repeated while the service is away or busy, as long as patience lasts.
        Raises RefusedError, ServiceAwayError, and NoLongerWantedError once `wanted` is false."""
        import httpx2  # start-up time

        deadline, wait, unsure = time.monotonic() + self.patience, FIRST_WAIT, False
        report: JsonObject | None = None
        while True:
            if not wanted():
                raise NoLongerWantedError
            try:
                response = self._try(method, path, file, request)
            except httpx2.UnsupportedProtocol as error:
                detail = f"the address {str(self.http.base_url).rstrip('/')} is not valid: {error}"
                raise RefusedError(0, {"detail": detail}) from error
            except httpx2.RequestError as error:
                failure, sent = _failure(error)
                reason = f"{failure}; is the service running at this address?"
                unsure = unsure or sent
            else:
                answer = read(response)
                reason = passing(response, answer) or ""
                if not reason and response.status_code >= 400:
                    raise RefusedError(response.status_code, problem(response))
                if not reason and answer is not None:
                    return answer
                unsure, report = unsure or perhaps_stored(response), content(response)
                wait = max(wait, retry_after(response.headers))
            if time.monotonic() + wait > deadline:
                raise ServiceAwayError(f"{self.http.base_url}: {reason}", perhaps_stored=unsure, problem=report)
            self.on_wait(reason, wait)
            time.sleep(wait)
            wait = min(2 * wait, LAST_WAIT)

    def _try(self, method: str, path: str, file: Path | None, request: JsonObject) -> "httpx2.Response":
        if file is None:
            return self.http.request(method, path, **request)
        with file.open("rb") as opened:
            if "data" in request:
                return self.http.request(method, path, files={"file": (file.name, opened)}, **request)
            return self.http.request(method, path, content=opened, **request)


def _body(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, default=_plain).encode()


def _plain(value: Any) -> Any:
    """A number or time of numpy, pandas or the standard library, converted for JSON."""
    for convert in ("tolist", "isoformat"):
        if hasattr(value, convert):
            return getattr(value, convert)()
    raise TypeError(f"{type(value).__name__} cannot be sent as JSON")


def connect(url: str, *, key: str | None = None, timeout: float = 60.0) -> "httpx2.Client":
    """An HTTP client for the service at `url`, with a key if one is needed. Raises ValueError on an address that is
    none."""
    import httpx2  # start-up time: a tenth of a second, which no command needs that asks no service

    headers = {} if key is None else {"Authorization": f"Bearer {key}"}
    try:
        return httpx2.Client(base_url=url, headers=headers, timeout=timeout)
    except httpx2.InvalidURL as error:
        raise ValueError(f"the address is not valid: {error}") from error
