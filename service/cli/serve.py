"""`clutchlife serve`: the service."""

import gc
import os
from contextlib import closing
from typing import Annotated

import typer
import uvicorn
from threadpoolctl import threadpool_limits

from service.cli.options import DATABASE, EX_USAGE, Database, err, errors_in_a_line, fail
from service.settings import Settings

LOOPBACK = "127.0.0.1"


def serve(
    host: Annotated[str, typer.Option(help="The address to listen at; without keys, this machine only")] = LOOPBACK,
    port: Annotated[int, typer.Option(min=0, max=65535)] = 8000,
    database: Database = DATABASE,
    log_level: Annotated[str, typer.Option(help="critical, error, warning, info or debug")] = "info",
) -> None:
    """Run the service."""
    if log_level not in uvicorn.config.LOG_LEVELS:
        fail(f"log-level must be one of {', '.join(uvicorn.config.LOG_LEVELS)}, got {log_level!r}", EX_USAGE)
    from service.web.auth import is_loopback  # start-up time
    from storage import keys  # start-up time
    from storage.engine.database import open_database  # start-up time

    with errors_in_a_line():
        settings = Settings.from_environment(database)
        with closing(open_database(settings.database)) as opened, opened.reading() as connection:
            has_keys = keys.any_active(connection)
    if not has_keys and not is_loopback(host):
        err.print(
            f"clutchlife: no keys are configured, so the service listens at {LOOPBACK} and not at {host}. "
            "Make one with: clutchlife key create --scope admin",
            soft_wrap=True,
        )
        host = LOOPBACK
    from service.app import create_app  # start-up time

    # the arrays are small: BLAS threads that wait for each other cost more than they gain
    threadpool_limits(limits=1, user_api="blas")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app = create_app(settings)
    # loaded modules stay: the collector's walk through all of them would delay an answer by a tenth of a second
    gc.collect()
    gc.freeze()
    uvicorn.run(
        app,
        host=host,
        port=port,
        log_level=log_level,
        access_log=log_level == "debug",
        server_header=False,
        timeout_graceful_shutdown=10,
    )
