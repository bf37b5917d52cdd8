"""`clutchlife serve`: the service."""

import gc
import os
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
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
    insecure_local: Annotated[
        bool, typer.Option("--insecure-local", help="Without keys, answer also what a proxy on this machine passes on")
    ] = False,
    log_level: Annotated[str, typer.Option(help="critical, error, warning, info or debug")] = "info",
) -> None:
    """Run the service."""
    if log_level not in uvicorn.config.LOG_LEVELS:
        fail(f"log-level must be one of {', '.join(uvicorn.config.LOG_LEVELS)}, got {log_level!r}", EX_USAGE)
    from service.readers.confinement import missing  # start-up time
    from service.web.auth import is_loopback  # start-up time
    from storage import keys  # start-up time
    from storage.engine.connect import path_of  # start-up time
    from storage.engine.database import open_database  # start-up time
    from storage.engine.service_lock import service_lock  # start-up time

    with errors_in_a_line():
        settings = Settings.from_environment(database)
        with service_lock(path_of(settings.database)):
            pass  # a second service ends here with a line; the application holds the lock from its start to its end
        with closing(open_database(settings.database)) as opened, opened.reading() as connection:
            has_keys = keys.any_ever(connection)
            opens = keys.any_active(connection, datetime.now(UTC).isoformat(timespec="seconds"))
    make = "make one with: clutchlife key create --scope admin"
    if has_keys and not opens:
        _say(f"all keys are revoked or expired, so every request is refused; {make}")
    elif not has_keys and not is_loopback(host):
        _say(f"no keys are configured, so the service listens at {LOOPBACK} and not at {host}; {make}")
        host = LOOPBACK
    elif not has_keys:
        passed = "also what a proxy passes on" if insecure_local else "and nothing that a proxy passes on"
        _say(f"no keys are configured: everybody on this machine may do everything, {passed}; {make}")
    if open_to_readers := missing():
        _say(f"this system cannot keep a process that reads a file from outside from {' and '.join(open_to_readers)}")
    from service.app import create_app  # start-up time

    # the arrays are small: BLAS threads that wait for each other cost more than they gain
    threadpool_limits(limits=1, user_api="blas")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app = create_app(replace(settings, insecure_local=insecure_local))
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


def _say(message: str) -> None:
    err.print(f"clutchlife: {message}", soft_wrap=True, markup=False)
