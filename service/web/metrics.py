"""Metrics for Prometheus: requests by route, and where every clutch stands."""

import time
from collections.abc import Iterator

from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.workflows import register_clutch as clutches
from storage.engine.database import Database

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"
_PAGE = 1000


class Metrics:
    """One service's metrics; nothing is shared between services in one process."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        labels = ("method", "route", "status")
        self.requests = Counter("clutchlife_requests", "Requests answered", labels, registry=self._registry)
        self.seconds = Histogram("clutchlife_request_seconds", "Time to answer", labels[:2], registry=self._registry)

    def exposition(self, database: Database) -> bytes:
        """All metrics as text, the clutches as they stand now."""
        standing = CollectorRegistry()
        standing.register(Clutches(database))
        return generate_latest(self._registry) + generate_latest(standing)


class Clutches(Collector):
    """Runs, health and remaining cycles of every clutch; what is not known is left out."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def collect(self) -> Iterator[Metric]:
        """The gauges, read from the stored summaries."""
        runs = GaugeMetricFamily("clutchlife_clutch_runs", "Runs stored", labels=["clutch"])
        health = GaugeMetricFamily("clutchlife_clutch_health", "1 when new, 0 at end of life", labels=["clutch"])
        text = "Duty cycles until end of life"
        remaining = GaugeMetricFamily("clutchlife_clutch_remaining_cycles", text, labels=["clutch", "quantile"])
        after = None
        while True:
            items, after = clutches.page(self._database, limit=_PAGE, after=after)
            for item in items:
                name, summary = item["clutch_id"], item["summary"]
                runs.add_metric([name], item["runs"])
                if summary is None:
                    continue
                if summary["current"]["health"] is not None:
                    health.add_metric([name], summary["current"]["health"])
                for quantile, cycles in summary["remaining_cycles"].items():
                    if cycles is not None:
                        remaining.add_metric([name, quantile], cycles)
            if after is None:
                break
        yield from (runs, health, remaining)


class Counting:
    """Counts and times every request by its route's template, so that names of clutches do not become labels."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        status, started = 500, time.perf_counter()

        async def noting(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self.app(scope, receive, noting)
        finally:
            route = getattr(scope.get("route"), "path", "unmatched")
            method = scope["method"] if route != "unmatched" else "any"
            self.metrics.requests.labels(method, route, str(status)).inc()
            self.metrics.seconds.labels(method, route).observe(time.perf_counter() - started)
