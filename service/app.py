"""The application: its parts put together, nothing made at import."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI
from fastapi_offline import FastAPIOffline

from service.dashboard import assets
from service.dashboard import pages as dashboard
from service.jobs.queue import Worker
from service.queries.views import Remembered
from service.settings import CODE_VERSION, Settings
from service.web import problems
from service.web.context import Context
from service.web.headers import BodyLimit, Heads, SafeHeaders
from service.web.metrics import Counting, Metrics
from service.web.routes import clutches, diagnoses, files, fleet, health, life, runs
from storage.engine.database import open_database

_DESCRIPTION = """Condition monitoring and prognostics of wet friction clutches.

Post the Stribeck tests of a rig; each is fitted, the clutch's degradation is tracked, and the duty cycles that remain until
its mean coefficient of friction has halved are foretold with their uncertainty."""


def create_app(settings: Settings) -> FastAPI:
    """The service on one database, which is opened (and migrated) when it starts and closed when it stops."""

    metrics = Metrics()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        database = open_database(settings.database)
        worker = Worker(database, settings)
        try:
            worker.start()
            app.state.context = Context(database=database, remembered=Remembered(), metrics=metrics, worker=worker)
            yield
        finally:
            worker.close()
            database.close()

    app = FastAPIOffline(
        title="Clutchlife",
        version=CODE_VERSION,
        description=_DESCRIPTION,
        lifespan=lifespan,
        redoc_url=None,
    )
    problems.install(app)
    for part in (health, clutches, files, runs, life, diagnoses, fleet):
        app.include_router(part.router)
    for twin in (runs.twins, life.twins, fleet.twins):
        app.include_router(twin)
    app.include_router(dashboard.router(assets.load()))
    app.add_middleware(Heads)
    app.add_middleware(BodyLimit, most=settings.most_body_bytes, most_file=settings.most_file_bytes)
    app.add_middleware(SafeHeaders)
    app.add_middleware(Counting, metrics=metrics)
    return app
