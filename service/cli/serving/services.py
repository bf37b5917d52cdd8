"""The application of one service, made ready to answer; and several services at one port, each in a process of its own."""

import gc
import multiprocessing
import os
import signal
import socket
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import uvicorn
from fastapi import FastAPI
from uvicorn.config import STARTUP_FAILURE
from uvicorn.supervisors import Multiprocess

from service.app import create_app
from service.jobs.background import end_with_parent, use_one_blas_thread
from service.logging import configure
from service.settings import Settings
from service.web.connections import allow_many, bounded
from service.web.metrics import FOLDER_VARIABLE

#: [s] After which a process that does not answer its parent is taken for hung, and replaced. Chosen: one that starts loads
#: the libraries first, beside all others on a busy machine.
_HUNG_SECONDS = 60


def prepared(settings: Settings) -> FastAPI:
    """The application; from now on this process only serves it."""
    use_one_blas_thread()  # the arrays are small: threads that wait for each other cost more than they gain
    app = create_app(settings)
    allow_many()
    # loaded modules stay: the collector's walk through all of them would delay an answer by a tenth of a second
    gc.collect()
    gc.freeze()
    return app


class _OneOfSeveral(uvicorn.Config):
    """The configuration in each of several processes, which is asked to prepare the log before anything else."""

    def configure_logging(self) -> None:
        """Log as the settings say, and end by Python's own end, which writes what was logged last."""
        super().configure_logging()
        if multiprocessing.parent_process() is not None:
            settings = Settings.from_environment()
            configure(settings.log_format, settings.log_level)
            signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))


class _Server(uvicorn.Server):
    """A server that calls `announce` once it accepts requests."""

    def __init__(self, config: uvicorn.Config, announce: Callable[[], None]) -> None:
        super().__init__(config)
        self._announce = announce

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._announce()


def serve_one(
    settings: Settings, sockets: list[socket.socket], options: dict[str, Any], announce: Callable[[], None]
) -> bool:
    """Serve in this process; `announce` is called once the service accepts requests. Returns whether it could start."""
    config = uvicorn.Config(prepared(settings), http=bounded(settings.connections_at_once), **options)
    server = _Server(config, announce)
    with suppress(KeyboardInterrupt):  # the server has stopped on it already
        server.run(sockets)
    return server.started


def serve_several(settings: Settings, processes: int, sockets: list[socket.socket], options: dict[str, Any]) -> bool:
    """Serve in this many processes, which share the port; one that ends is replaced. Returns whether all could start."""
    settings.to_environment()
    application = f"{__name__}:{one_of_several.__name__}"
    config = _OneOfSeveral(
        application,
        factory=True,
        http="service.cli.serving.bounded_protocol:PROTOCOL",
        workers=processes,
        timeout_worker_healthcheck=_HUNG_SECONDS,
        **options,
    )
    supervisor = Multiprocess(config, sockets)
    with tempfile.TemporaryDirectory(prefix="clutchlife-metrics-") as folder:
        os.environ[FOLDER_VARIABLE] = folder
        supervisor.run()
    return all(process.exitcode != STARTUP_FAILURE for process in supervisor.processes)


def one_of_several() -> FastAPI:
    """The application in one of several processes, which ends with its parent process for whatever reason."""
    settings = Settings.from_environment()
    end_with_parent(partial(os.kill, os.getpid(), signal.SIGTERM))
    return prepared(settings)
