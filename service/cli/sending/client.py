"""A client of the service: it waits while the service is away or busy, and raises what the service refuses."""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx2

JSON = {"Content-Type": "application/json"}
#: Statuses that pass by themselves: a gateway without its service, a busy service, a slow one.
_TRANSIENT = (502, 503, 504)
#: Characters of an answer that is no problem report, quoted as its detail.
_MOST_QUOTED = 500
#: Seconds between tries: doubled from the first to the last.
FIRST_WAIT, LAST_WAIT = 0.25, 15.0


class ServiceAwayError(Exception):
    """The service did not answer, or was busy, for longer than the patience."""


class RefusedError(Exception):
    """The service refused the request; repeating it would be refused again."""

    def __init__(self, status: int, problem: dict[str, Any]) -> None:
        super().__init__(f"{status}: {problem.get('detail') or problem.get('title') or 'refused'}")
        self.status = status
        self.problem = problem


@dataclass(frozen=True, slots=True, kw_only=True)
class Service:
    """A running service. `patience` [s] is how long one request is tried again while the service is away or busy."""

    http: httpx2.Client
    patience: float = 60.0
    on_wait: Callable[[str, float], None] = lambda _reason, _seconds: None

    def post(self, path: str, body: bytes, *, prefer: str | None = None) -> dict[str, Any]:
        """The answer to a JSON body; raises ServiceAwayError or RefusedError."""
        headers = JSON if prefer is None else JSON | {"Prefer": prefer}
        return self._answer("POST", path, content=body, headers=headers)

    def put(self, path: str, body: bytes) -> dict[str, Any]:
        """The answer to a JSON body that replaces what is at `path`; raises as `post` does."""
        return self._answer("PUT", path, content=body, headers=JSON)

    def patch(self, path: str, body: bytes) -> dict[str, Any]:
        """The answer to a JSON body that changes what is at `path`; raises as `post` does."""
        return self._answer("PATCH", path, content=body, headers=JSON)

    def pages(self, path: str, **params: Any) -> Iterator[dict[str, Any]]:
        """The items of a list, page by page; raises as `post` does."""
        cursor: dict[str, str] = {}
        while True:
            page = self.get(path, **params, **cursor)
            yield from page["items"]
            if page["next"] is None:
                return
            cursor = {"cursor": page["next"]}

    def post_file(self, path: str, file: Path, parameters: Mapping[str, str]) -> dict[str, Any]:
        """The answer to a run's file; raises as `post` does."""
        return self._answer("POST", path, params=dict(parameters), file=file)

    def get(self, path: str, **params: Any) -> dict[str, Any]:
        """The answer to a GET; raises as `post` does."""
        return self._answer("GET", path, params=params)

    def _answer(self, method: str, path: str, *, file: Path | None = None, **request: Any) -> dict[str, Any]:
        deadline, wait = time.monotonic() + self.patience, FIRST_WAIT
        while True:
            try:
                if file is None:
                    response = self.http.request(method, path, **request)
                else:
                    with file.open("rb") as content:
                        response = self.http.request(method, path, content=content, **request)
            except httpx2.UnsupportedProtocol as error:
                raise RefusedError(0, {"detail": f"{self.http.base_url}: {error}"}) from error
            except httpx2.TransportError as error:
                reason = f"no answer ({type(error).__name__})"
            else:
                if response.status_code < 400:
                    answer: dict[str, Any] = response.json()
                    return answer
                if response.status_code not in _TRANSIENT:
                    raise RefusedError(response.status_code, _problem(response))
                reason = f"status {response.status_code}"
                wait = max(wait, float(response.headers.get("Retry-After", 0)))
            if time.monotonic() + wait > deadline:
                raise ServiceAwayError(f"{self.http.base_url}: {reason}")
            self.on_wait(reason, wait)
            time.sleep(wait)
            wait = min(2 * wait, LAST_WAIT)


def _problem(response: httpx2.Response) -> dict[str, Any]:
    try:
        problem = response.json()
    except ValueError:
        return {"detail": response.text[:_MOST_QUOTED]}
    return problem if isinstance(problem, dict) else {"detail": str(problem)[:_MOST_QUOTED]}


def connect(url: str, *, key: str | None = None, timeout: float = 60.0) -> httpx2.Client:
    """A client for the service at `url`, with a key where one is needed."""
    headers = {} if key is None else {"Authorization": f"Bearer {key}"}
    return httpx2.Client(base_url=url, headers=headers, timeout=timeout)
