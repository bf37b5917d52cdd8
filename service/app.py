"""Puts the parts of the application together."""

import math
import shutil
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

from fastapi import FastAPI
from fastapi_offline import FastAPIOffline

from service.alarms.outbox import Outbox
from service.answers.store import AnswerStore
from service.changes import adopt_model, ask_job, raw_records, run_diagnosis
from service.dashboard import assets, site
from service.dashboard import pages as dashboard
from service.jobs.queue import JobKind, JobQueue, diagnosis_work, work_of_change
from service.jobs.workers import CHANGE_SECONDS, Lane, Workers, in_processes, in_threads
from service.settings import CODE_VERSION, MIB, Settings
from service.web import openapi, problems
from service.web.bodies import Bodies
from service.web.context import Context
from service.web.files import Copies, emptied_folder
from service.web.limits import MAX_CACHED_BYTES
from service.web.metrics import Metrics
from service.web.middleware import Answers, Edge, Encodings, Heads, Polls, RootPath, Shares
from service.web.readiness import Readiness
from service.web.responses import now
from service.web.routes import alarms, clutches, diagnoses, exports, health, inspections, jobs, life, rigs, runs
from storage.engine.database import Database
from storage.engine.opening import open_database, service_lock
from storage.jobs import DIAGNOSIS, FLEET_REFRESH, REPLAY, JobRow

_DESCRIPTION = """Condition monitoring and prognostics of wet friction clutches.

Post the Stribeck tests of a rig. The service fits each test, tracks the clutch's degradation, and predicts, with the
uncertainty, how many duty cycles remain until the mean coefficient of friction has halved."""


def _kinds(database: Database, workers: Workers) -> Sequence[Mapping[str, JobKind]]:
    """The kinds of jobs and how they are done, in groups; each group runs one job at a time, so that a diagnosis need
    not wait for a replay of a thousand clutches. The workers adopt models."""

    def adopt(job: JobRow, ended: Mapping[str, Any]) -> bool:
        function = partial(adopt_model.finish_and_adopt, claimer=job.claimed_by or "")
        arguments = (job.clutch_id, job.job_id, dict(ended), now(), job.arguments["adopt_by"])
        adopting = workers.submit(
            Lane.ANSWERS, function, *arguments, turn=job.clutch_id, seconds=CHANGE_SECONDS, patience=math.inf
        )
        return bool(adopting.result())

    def finish_diagnosis(job: JobRow, ended: Mapping[str, Any]) -> None:
        run_diagnosis.finish(database, job, ended, at=now(), adopt=adopt)

    def finish(job: JobRow, ended: Mapping[str, Any]) -> None:
        ask_job.finish(database, job, ended, at=now())

    return (
        {DIAGNOSIS: JobKind(diagnosis_work, finish_diagnosis)},
        {
            REPLAY: JobKind(work_of_change("service.changes.replay:as_job"), finish),
            FLEET_REFRESH: JobKind(work_of_change("service.changes.learn_fleet:as_job"), finish),
        },
    )


def create_app(settings: Settings) -> FastAPI:
    """The application on one database, which is opened (and migrated) when it starts and closed when it stops.

    Starting raises ServiceRuns where another service uses the file; a database on a server is any number's.
    """
    metrics = Metrics(each_clutch=settings.clutch_metrics)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        """Context of the running service: opens the database, starts its threads and processes, and ends them at last."""
        with service_lock(settings.database):
            database = open_database(settings.database, serving=True)
            raw_records.use(database, settings.raw)
            folder = emptied_folder(database.path)
            log, gauges = (settings.log_format, settings.log_level), metrics.calls
            workers = (
                in_processes(database, settings.workers, log, gauges)
                if settings.workers
                else in_threads(database, gauges)
            )
            queue = JobQueue(database, settings, _kinds(database, workers))
            least = {"least_disk": settings.least_free_mb * MIB, "least_memory": settings.least_memory_mb * MIB}
            readiness = Readiness(database, workers, queue, **least)
            outbox = Outbox(database, settings)
            try:
                workers.warm()
                queue.start()
                outbox.start()
                app.state.context = Context(
                    database=database,
                    answers=AnswerStore(MAX_CACHED_BYTES, database),
                    metrics=metrics,
                    jobs=queue,
                    outbox=outbox,
                    settings=settings,
                    workers=workers,
                    readiness=readiness,
                    folder=folder,
                    copies=Copies(folder, 2 * settings.max_file_mb * MIB),
                )
                yield
            finally:
                readiness.close()
                outbox.close()
                queue.close()
                workers.close()
                database.close()
                if database.path is None:
                    shutil.rmtree(folder, ignore_errors=True)

    app = FastAPIOffline(
        title="Clutchlife",
        version=CODE_VERSION,
        description=_DESCRIPTION,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
    )
    problems.install(app)
    routers = [part.router for part in (health, clutches, runs, inspections, life, diagnoses, jobs)]
    routers += [clutches.fleet_router, rigs.router, alarms.router, clutches.totals_router, exports.router]
    routers += [exports.fleet_router, health.description_router, rigs.import_router, alarms.webhook_router]
    routers += [runs.doubt_router]
    routers += [dashboard.router(assets.load()), site.router()]
    for router in routers:
        app.include_router(router)
    openapi.install(app, settings.root_path)
    app.add_middleware(Polls)
    app.add_middleware(
        Bodies, most=settings.max_body_mb * MIB, most_file=settings.max_file_mb * MIB, seconds=settings.body_seconds
    )
    app.add_middleware(Encodings)
    app.add_middleware(Answers)
    app.add_middleware(Heads)
    app.add_middleware(Shares, per_second=settings.requests_per_second, at_once=settings.requests_at_once)
    app.add_middleware(Edge, metrics=metrics)
    app.add_middleware(RootPath, root=settings.root_path)
    return app
