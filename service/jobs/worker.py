"""A worker process: it opens the database once and calls what it is sent, one call after the other."""

import gc
import importlib
import os
import pickle
import signal
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from logging import shutdown
from multiprocessing.connection import Connection
from typing import Any

from opentelemetry import propagate

from service import logging
from service.jobs.background import end_with_parent, keep_memory, use_one_blas_thread, yield_to_others
from service.tracing import tracer
from storage.engine.database import Database
from storage.engine.opening import open_database

#: What nearly every call needs, loaded before the first comes.
LOADED_EARLY = (
    "filterpy.kalman",
    "scipy.ndimage",
    "service.changes.ingest_run",
    "service.answers.store",
    "service.runs.json_run",
    "service.runs.upload",
)

#: Seconds after a SIGTERM until which a worker works on. Chosen: longer than the service waits for requests when it stops.
_LAST_SECONDS = 15.0

#: [s] Between two signs of life. Chosen: a tenth of the silence after which a process is ended.
_BEAT = 1.0


def begin(database_url: str, nice: int | None, log: tuple[logging.LogFormat, logging.LogLevel]) -> Database:
    """Prepare this worker process and open its database. It logs like the service, yields to other processes by `nice`
    (None: entirely) and ends with the service. It ignores SIGINT and ends only a while after SIGTERM: a signal to all
    processes at once must not interrupt the storing of a run."""
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
    keep_memory()
    for name in LOADED_EARLY:
        importlib.import_module(name)
    gc.freeze()  # what is loaded stays: the collector need not walk through it
    return open_database(database_url)


def main(
    line: Connection, database_url: str, nice: int | None, log: tuple[logging.LogFormat, logging.LogLevel]
) -> None:
    """A worker process: makes the calls received over the connection and sends back their results or errors, until the
    other end is closed.

    Once ready, and each second, it sends a sign of life, also during a call.
    """
    sending = threading.Lock()

    def send(message: Any) -> None:
        with sending:
            line.send(message)

    threading.Thread(target=_beat, args=(send,), daemon=True).start()
    database = begin(database_url, nice, log)
    with suppress(EOFError, OSError):  # the service has closed the line, or has ended
        send(())
        while True:
            answer = _answered(database, line.recv_bytes())
            try:
                send(answer)
            except (TypeError, AttributeError, ValueError, pickle.PicklingError) as error:
                send((None, RuntimeError(f"the result cannot be sent: {error}")))
    shutdown()  # what was logged is written: a forked process ends without Python's own end


def _answered(database: Database, message: bytes) -> tuple[Any, BaseException | None]:
    """A call's result, or its error with the traceback as a note."""
    try:
        name, function, arguments, request, trace = pickle.loads(message)  # noqa: S301  (of our own service)
        logging.request_id.set(request)
        with tracer.start_as_current_span(name, context=propagate.extract(trace)):
            return function(database, *arguments), None
    except BaseException as error:  # noqa: BLE001  (raised again for who asked)
        error.add_note("".join(traceback.format_exception(error)))
        return None, error


def _beat(send: Callable[[None], None]) -> None:
    with suppress(OSError):
        while True:
            time.sleep(_BEAT)
            send(None)


def load(_: Database) -> None:
    """Does nothing; calling it makes a new process load the libraries that nearly every call needs."""


def _end_later(*_: object) -> None:
    last = threading.Timer(_LAST_SECONDS, os._exit, (3,))
    last.daemon = True
    last.start()
