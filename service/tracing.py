"""OpenTelemetry spans, by its API alone: without an SDK in the environment they are never made.

A request is a span, named after its route, below the caller's where that sends `traceparent`; each call that a worker makes
for it is one below it, in another process too; below that are `track` and the database's `store`.
"""

from collections.abc import Mapping

from opentelemetry import trace

tracer = trace.get_tracer("clutchlife")

#: Where a span is, as headers of W3C Trace Context.
Carrier = Mapping[str, str]
