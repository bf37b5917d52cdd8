"""The spans of a request: its route, what a worker does for it, tracking and storing, one below the other."""

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from opentelemetry import propagate, trace
from opentelemetry.trace import NonRecordingSpan, SpanContext, TraceFlags

from service.jobs import worker
from service.tracing import tracer as tracer_of_service
from storage.engine.opening import open_database
from tests.service.clients import client_on
from tests.support import stationary

CALLER = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"
_ids = count(1)


class _Span(NonRecordingSpan):
    """A span that keeps its name, its attributes and what it is below."""

    def __init__(self, name: str, parent: SpanContext) -> None:
        super().__init__(
            SpanContext(parent.trace_id or next(_ids), next(_ids), is_remote=False, trace_flags=TraceFlags(1))
        )
        self.name, self.parent, self.attributes = name, parent, dict[str, Any]()

    def update_name(self, name: str) -> None:
        self.name = name

    def set_attributes(self, attributes: Any) -> None:
        self.attributes |= attributes


class _Tracer(trace.Tracer):
    """Keeps all spans, as an SDK would."""

    def __init__(self) -> None:
        self.spans = list[_Span]()

    def start_span(self, name: str, context: Any = None, *_: Any, **__: Any) -> _Span:
        self.spans.append(_Span(name, trace.get_current_span(context).get_span_context()))
        return self.spans[-1]

    @contextmanager
    def start_as_current_span(self, name: str, context: Any = None, *_: Any, **__: Any) -> Iterator[Any]:
        with trace.use_span(self.start_span(name, context)) as span:
            yield span

    def chain(self, name: str) -> list[str]:
        """The names from the last span of that name up to the caller's."""
        by_id = {span.get_span_context().span_id: span for span in self.spans}
        span = next(span for span in reversed(self.spans) if span.name == name)
        names = [name]
        while (above := by_id.get(span.parent.span_id)) is not None:
            names.append(above.name)
            span = above
        return [*names, f"{span.parent.span_id:x}"]


@pytest.fixture
def tracer(monkeypatch: pytest.MonkeyPatch) -> _Tracer:
    """What the API's tracers lead to in this test, as an SDK sets it."""
    made = _Tracer()
    for proxy in ("service.tracing.tracer", "storage.engine.database.tracer"):
        monkeypatch.setattr(f"{proxy}._real_tracer", made)
    return made


def test_tracking_and_storing_are_below_the_request_and_that_below_its_caller(tmp_path: Path, tracer: _Tracer) -> None:
    with client_on(f"sqlite:///{tmp_path}/a.db") as http:
        http.post("/v1/clutches", json={"clutch_id": "c1"}).raise_for_status()
        http.post("/v1/clutches/c1/runs", json=stationary(0), headers={"traceparent": CALLER}).raise_for_status()
        assert http.get("/v1/nowhere").status_code == 404
    request = "POST /v1/clutches/{clutch_id}/runs"
    above = [request, "b7ad6b7169203331"]
    for name in ("track", "store"):
        assert tracer.chain(name) == [name, "ingest_posted", *above], name
    (posted,) = [span for span in tracer.spans if span.name == request]
    assert posted.attributes == {
        "http.request.method": "POST",
        "http.route": "/v1/clutches/{clutch_id}/runs",
        "http.response.status_code": 201,
    }


def _sent() -> dict[str, str]:
    """What goes along with a call of the present span."""
    carrier: dict[str, str] = {}
    propagate.inject(carrier)
    return carrier


def _named(_: Any) -> str:
    return _sent()["traceparent"]


def test_the_span_of_a_request_goes_along_to_the_worker_s_process(tmp_path: Path, tracer: _Tracer) -> None:
    database = open_database(f"sqlite:///{tmp_path}/a.db")
    with tracer_of_service.start_as_current_span("request", context=propagate.extract({"traceparent": CALLER})):
        message = pickle.dumps(("_named", partial(_named), (), "id", _sent()))
    answer, error = worker._answered(database, message)
    database.close()
    assert error is None
    assert answer.split("-")[1] == CALLER.split("-")[1]
    assert tracer.chain("_named") == ["_named", "request", "b7ad6b7169203331"]


def test_without_an_sdk_nothing_goes_along() -> None:
    with tracer_of_service.start_as_current_span("request"):
        assert _sent() == {}
