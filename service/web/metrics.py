"""Metrics for Prometheus: requests by route, and where every clutch stands."""

from collections.abc import Iterator

from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from service.queries import clutch_list
from service.web.limits import METRICS_PAGE
from storage.engine.database import Database

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"


class Metrics:
    """One service's metrics; nothing is shared between services in one process."""

    def __init__(self) -> None:
        self._registry = CollectorRegistry()
        labels = ("method", "route", "status")
        self.requests = Counter("clutchlife_requests", "Requests answered", labels, registry=self._registry)
        self.seconds = Histogram("clutchlife_request_seconds", "Time to answer", labels[:2], registry=self._registry)

    def exposition(self, database: Database) -> bytes:
        """All metrics as text, the clutches as they stand now."""
        clutches = CollectorRegistry()
        clutches.register(Clutches(database))
        return generate_latest(self._registry) + generate_latest(clutches)


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
            items, after = clutch_list.page(self._database, limit=METRICS_PAGE, after=after)
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
