"""Metrics for Prometheus: requests by route, what waits, and how many clutches stand where.

They cost the same however many clutches are stored; series of every clutch are there only where they are asked for.
"""

from collections.abc import Iterator

from prometheus_client import CollectorRegistry, Counter, Histogram, ProcessCollector, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from service.jobs.workers import Workers
from service.queries import clutch_list
from service.queries.totals import totals
from service.web.limits import METRICS_PAGE
from storage.engine.database import Database

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"


class Metrics:
    """One service's metrics; nothing is shared between services in one process.

    `each_clutch`: with series of every clutch.
    """

    def __init__(self, *, each_clutch: bool = False) -> None:
        self._each_clutch = each_clutch
        self._registry = CollectorRegistry()
        ProcessCollector(registry=self._registry)
        labels = ("method", "route", "status")
        self.requests = Counter("clutchlife_requests", "Requests answered", labels, registry=self._registry)
        self.seconds = Histogram("clutchlife_request_seconds", "Time to answer", labels[:2], registry=self._registry)

    def exposition(self, database: Database, workers: Workers) -> bytes:
        """All metrics as text, the clutches as they stand now."""
        present = CollectorRegistry()
        present.register(Present(database, workers))
        if self._each_clutch:
            present.register(Clutches(database))
        return generate_latest(self._registry) + generate_latest(present)


class Present(Collector):
    """What is there now and what waits, in numbers of all clutches together."""

    def __init__(self, database: Database, workers: Workers) -> None:
        self._database = database
        self._workers = workers

    def collect(self) -> Iterator[Metric]:
        """The gauges, from a few statements that give a row each, and from the queues."""
        numbers = totals(self._database)
        yield GaugeMetricFamily("clutchlife_clutches", "Clutches, archived ones too", value=numbers.clutches)
        text = "Clutches in use that have at most so many cycles left (the median); 0: at their end of life"
        within = GaugeMetricFamily("clutchlife_clutches_within", text, labels=["cycles"])
        for cycles, count in numbers.within.items():
            within.add_metric([f"{cycles:g}"], count)
        yield within
        yield GaugeMetricFamily("clutchlife_runs", "Runs stored", value=numbers.runs)
        yield GaugeMetricFamily("clutchlife_runs_held", "Runs that wait to be confirmed", value=numbers.held)
        text = "Ended lives that the priors of fleets know of"
        yield GaugeMetricFamily("clutchlife_ended_lives", text, value=numbers.ended_lives)
        calls = GaugeMetricFamily("clutchlife_worker_calls", "Calls that wait or run", labels=["lane"])
        for lane, count in self._workers.calls().items():
            calls.add_metric([lane.name.lower()], count)
        yield calls
        text = "Diagnoses that wait or run"
        yield GaugeMetricFamily("clutchlife_diagnoses_waiting", text, value=numbers.diagnoses)


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
            items, after = clutch_list.page_by_name(self._database, limit=METRICS_PAGE, after=after)
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
