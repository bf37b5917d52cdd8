"""A worker process: it opens the database once and calls what it is sent, one call after the other."""

import gc
import importlib
import os
import signal
import threading
from collections.abc import Callable, Sequence
from typing import Any

from service import logging
from service.background import end_with_parent, use_one_blas_thread, yield_to_others
from storage.engine.database import Database
from storage.engine.opening import open_database

#: What nearly every call needs, loaded before the first comes.
LOADED_EARLY = (
    "filterpy.kalman",
    "service.workflows.ingest_run",
    "service.queries.cache",
    "service.run_files.json_run",
    "service.run_files.upload",
)

#: Seconds after a SIGTERM until which a worker works on. Chosen: longer than the service waits for requests when it stops.
_LAST_SECONDS = 15.0

_opened: list[Database] = []


def begin(database_url: str, nice: int | None, log: tuple[logging.LogFormat, logging.LogLevel]) -> None:
    """Prepare this process: it logs so; it yields by `nice` or, where that is None, to all others; it ends with the service,
    and leaves it to the service to stop: what stops all processes at once must not take a run from it that is being stored.
    """
    logging.configure(*log)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end_later)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    end_with_parent()
    if nice is None:
        yield_to_others()
    else:
        os.nice(nice)
    use_one_blas_thread()
    for name in LOADED_EARLY:
        importlib.import_module(name)
    gc.freeze()  # what is loaded stays: the collector need not walk through it
    _opened.append(open_database(database_url))


def call(function: Callable[..., Any], arguments: Sequence[Any], request: str) -> Any:
    """What `function(database, *arguments)` returns or raises; what it logs is of the `request` with that id."""
    logging.request_id.set(request)
    return function(_opened[0], *arguments)


def load(_: Database) -> None:
    """Nothing: what nearly every call needs is loaded when a process begins."""


def _end_later(*_: object) -> None:
    last = threading.Timer(_LAST_SECONDS, os._exit, (3,))
    last.daemon = True
    last.start()
