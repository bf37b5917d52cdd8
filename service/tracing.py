"""OpenTelemetry spans, by its API alone: without an SDK in the environment they are never made.

A request is a span, named after its route, below the caller's where that sends `traceparent`; each call that a worker makes
for it is one below it, in another process too; below that are `track` and the database's `store`.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial

from opentelemetry import propagate, trace
from opentelemetry.trace import Span, SpanKind

tracer = trace.get_tracer("clutchlife")

#: Where a span is, as headers of W3C Trace Context.
Carrier = Mapping[str, str]


def carried() -> Carrier:
    """The present span's context, to be sent with a call; empty without a span."""
    carrier: dict[str, str] = {}
    propagate.inject(carrier)
    return carrier


def name_of(function: Callable[..., object]) -> str:
    """The name of a function; for a partial, of the function within."""
    while isinstance(function, partial):
        function = function.func
    return getattr(function, "__name__", type(function).__name__)


@contextmanager
def span_below(carrier: Carrier, name: str, kind: SpanKind = SpanKind.INTERNAL) -> Iterator[Span]:
    """Context with a span of that name, below the span whose context was sent."""
    with tracer.start_as_current_span(name, context=propagate.extract(carrier), kind=kind) as span:
        yield span
