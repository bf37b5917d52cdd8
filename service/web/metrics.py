"""Metrics for Prometheus: requests by route, waiting work, and clutches by remaining life.

They cost the same however many clutches are stored; series of every clutch are there only where they are asked for.
"""

import os
from collections.abc import Callable, Iterator
from functools import partial
from operator import add
from pathlib import Path

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.multiprocess import MultiProcessCollector, mark_process_dead
from prometheus_client.registry import Collector

from service.answers import clutch_list
from service.jobs.workers import Lane
from service.web.limits import METRICS_PAGE
from storage import assumptions, clutches, jobs, runs
from storage.engine.database import Database

#: Where several processes keep their numbers, for prometheus_client, which reads it when it is imported.
FOLDER_VARIABLE = "PROMETHEUS_MULTIPROC_DIR"
MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"
#: Remaining cycles up to which clutches are counted, ascending; 0: at the end of life. Chosen: days and weeks of a rig.
WITHIN = (0.0, 1e3, 1e4)


class Metrics:
    """The metrics of one service; services in one process share none.

    `each_clutch`: with series of every clutch. If several processes serve one port, each keeps its numbers in files of
    one folder, and the process that gets the request adds up all of them.
    """

    def __init__(self, *, each_clutch: bool = False) -> None:
        self._each_clutch = each_clutch
        self._registry = CollectorRegistry()
        labels = ("method", "route", "status")
        self.requests = Counter("clutchlife_requests", "Requests answered", labels, registry=self._registry)
        self.seconds = Histogram("clutchlife_request_seconds", "Time to answer", labels[:2], registry=self._registry)
        text = "Calls that wait or run"
        calls = Gauge("clutchlife_worker_calls", text, ["lane"], registry=self._registry, multiprocess_mode="livesum")
        #: The gauges of waiting and running calls in this process, by lane.
        self.calls = {lane: calls.labels(lane.name.lower()) for lane in Lane}

    def exposition(self, database: Database) -> bytes:
        """All metrics as text, the clutches as they stand now."""
        present = CollectorRegistry()
        present.register(_Made(partial(_totals, database)))
        if self._each_clutch:
            present.register(_Made(partial(_each_clutch, database)))
        folder = os.environ.get(FOLDER_VARIABLE)
        if folder is None:
            ProcessCollector(registry=present)
            return generate_latest(self._registry) + generate_latest(present)
        present.register(_Made(partial(_processes, Path(folder))))
        MultiProcessCollector(present, folder)  # type: ignore[no-untyped-call]
        return generate_latest(present)


class _Made(Collector):
    """A collector that calls `make` at each scrape."""

    def __init__(self, make: Callable[[], Iterator[Metric]]) -> None:
        self._make = make

    def collect(self) -> Iterator[Metric]:
        return self._make()


def _processes(folder: Path) -> Iterator[Metric]:
    """Sums CPU, memory and files over the live processes that write into a folder; counters of ended processes remain."""
    metrics: dict[str, Metric] = {}
    for number in {path.stem.rpartition("_")[2] for path in folder.glob("*.db")}:
        if not Path("/proc", number).exists():
            mark_process_dead(int(number), str(folder))  # type: ignore[no-untyped-call]
            continue
        registry = CollectorRegistry()
        ProcessCollector(registry=registry, pid=partial(int, number))
        for metric in registry.collect():
            sum_up = min if metric.name == "process_start_time_seconds" else add
            merged = metrics.setdefault(metric.name, metric)
            if merged is not metric:
                pairs = zip(merged.samples, metric.samples, strict=True)
                merged.samples = [sample._replace(value=sum_up(sample.value, other.value)) for sample, other in pairs]
    yield from metrics.values()


def _totals(database: Database) -> Iterator[Metric]:
    """Numbers over all clutches: clutches, runs, held runs, ended lives, and diagnoses that wait or run."""
    text = "Clutches in use that are safe for at most this number of cycles (95 %); 0: they may be at their end of life"
    within = GaugeMetricFamily("clutchlife_clutches_within", text, labels=["cycles"])
    with database.reading() as connection:
        for cycles, count in clutches.count_within(connection, WITHIN).items():
            within.add_metric([f"{cycles:g}"], count)
        counts = (
            ("clutchlife_clutches", "Clutches, archived ones too", clutches.count(connection)),
            ("clutchlife_runs", "Runs stored", runs.count(connection)),
            ("clutchlife_runs_held", "Runs that wait to be confirmed", runs.count_held(connection)),
            (
                "clutchlife_ended_lives",
                "Ended lives that the priors of fleets know of",
                assumptions.count_ended_lives(connection),
            ),
            ("clutchlife_diagnoses_waiting", "Diagnoses that wait or run", jobs.count_open(connection, jobs.DIAGNOSIS)),
        )
    first, *others = (GaugeMetricFamily(name, says, value=count) for name, says, count in counts)
    yield from (first, within, *others)


def _each_clutch(database: Database) -> Iterator[Metric]:
    """Stored runs, health and remaining cycles of every clutch; unknown values are left out."""
    counts = GaugeMetricFamily("clutchlife_clutch_runs", "Runs stored", labels=["clutch"])
    health = GaugeMetricFamily("clutchlife_clutch_health", "1 when new, 0 at end of life", labels=["clutch"])
    text = "Duty cycles until end of life"
    remaining = GaugeMetricFamily("clutchlife_clutch_remaining_cycles", text, labels=["clutch", "quantile"])
    for item in clutch_list.every(database, at_once=METRICS_PAGE):
        name, summary = item.clutch_id, item.summary
        counts.add_metric([name], item.runs)
        if summary is None:
            continue
        if summary.current.health is not None:
            health.add_metric([name], summary.current.health)
        for quantile, cycles in summary.remaining_cycles.items():
            if cycles is not None:
                remaining.add_metric([name, quantile], cycles)
    yield from (counts, health, remaining)
