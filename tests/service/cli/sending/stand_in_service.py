"""A service in memory, for the sender's side: it stores what it is sent, or answers as a test wants."""

import hashlib
import json
from collections.abc import Callable
from typing import Any

import httpx2

URL = "http://service.test"
Answer = Callable[[httpx2.Request], httpx2.Response | None]


def body(cycles: float, run_id: str | None = None, **more: object) -> bytes:
    """A run that states little."""
    run: dict[str, object] = {"kind": "maintenance", "event": "rest", "cycles": cycles} | more
    return json.dumps(run if run_id is None else run | {"run_id": run_id}).encode()


def problem(status: int, slug: str, detail: str = "because") -> httpx2.Response:
    """A refusal of the service's own."""
    report = {"type": f"urn:clutchlife:problem:{slug}", "title": slug, "status": status, "detail": detail}
    return httpx2.Response(status, json=report, headers={"Content-Type": "application/problem+json"})


class StandInService:
    """Stores runs by name as the service does; `instead` may answer a request in its place."""

    def __init__(self, instead: Answer = lambda _request: None) -> None:
        self.instead = instead
        self.stored: dict[str, bytes] = {}
        #: What receipts say of a stored run beside its name.
        self.states: dict[str, dict[str, Any]] = {}

    def client(self) -> httpx2.Client:
        """A client that reaches it."""
        return httpx2.Client(base_url=URL, transport=httpx2.MockTransport(self.answer))

    def answer(self, request: httpx2.Request) -> httpx2.Response:
        content = request.read()
        other = self.instead(request)
        if other is not None:
            return other
        if request.method == "GET" or not request.url.path.endswith(("/runs", "/file", "/inspections")):
            return httpx2.Response(200, json={"clutch_id": "c1"})
        if request.url.path.endswith("/inspections"):
            return self._inspect(content)
        return self._store(content, request.url.params.get("run_id"))

    def _inspect(self, content: bytes) -> httpx2.Response:
        name = hashlib.sha256(content).hexdigest()[:16]
        known = name in self.stored
        self.stored[name] = content
        receipt = {"inspection_id": name, "duplicate": known} | self.states.get(name, {})
        return httpx2.Response(200 if known else 201, json=receipt)

    def _store(self, content: bytes, name: str | None) -> httpx2.Response:
        digest = hashlib.sha256(content).hexdigest()
        if name is None and content.startswith(b"{"):
            run = json.loads(content)
            if run["cycles"] < 0:
                return problem(422, "invalid-content", "cycles: must not be negative")
            name = run.get("run_id")
        run_id = name or digest[:16]
        known = self.stored.get(run_id)
        if known is not None and known != content:
            return problem(409, "conflict", f"run_id {run_id!r} is already stored with other content")
        self.stored[run_id] = content
        receipt = {"run_id": run_id, "duplicate": known is not None} | self.states.get(run_id, {})
        return httpx2.Response(200 if known else 201, json=receipt)
