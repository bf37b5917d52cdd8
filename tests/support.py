"""What several tests need: bodies to post, and a service to post them to."""

import gc
import math
import multiprocessing
import os
import runpy
import signal
import socket
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cached_property, partial
from importlib import import_module
from multiprocessing import forkserver
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import DupFd
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import IO, Any, Literal

import httpx2
import numpy as np
import pytest

from service.jobs import process
from service.logging import LogLevel
from tests.storage.samples import lay_empty


def one_quick(values: Iterable[Any]) -> list[Any]:
    """Values of a parameter, several as tuples, of which the first is tried in every run, the others by `make slow`."""
    first, *others = values
    each = [value if isinstance(value, tuple) else (value,) for value in others]
    return [first, *(pytest.param(*value, marks=pytest.mark.slow) for value in each)]


PRESSURES_BAR = (4.0, 5.0, 6.0, 7.0)
SPEEDS_RPM = tuple(range(20, 1971, 50))

#: A stationary test that needs no simulator: eq. 3 written out once more, independent of the code under test.


def torque_nm(pressure_bar: float, speed_rpm: float, wear: float) -> float:
    """A made-up clutch's torque; `wear` from 0 (new) lowers it."""
    v = speed_rpm * 2 * math.pi / 60 * 0.058
    m_s, m_c, v_s, c_v = 4.4 * pressure_bar * (1 - wear), 0.6, 3.0, 1.6 + wear
    return m_s * (1 + (m_c - 1) * (math.exp(-v_s / v) if v else 0.0)) + c_v * v**0.3


def stationary(
    cycles: float = 0.0,
    *,
    run_id: str | None = None,
    wear: float | None = None,
    noise: float = 0.01,
    pressures: tuple[float, ...] = PRESSURES_BAR,
    speeds: tuple[float, ...] = SPEEDS_RPM,
) -> dict[str, Any]:
    """A stationary run's body; the wear follows eq. 6 unless given, the noise depends on the cycles alone."""
    rng = np.random.default_rng([17, abs(int(cycles))])
    share = 0.9 * (1 - (1 + abs(cycles) / 6000) ** -0.9) if wear is None else wear
    rows = [(p, n) for p in pressures for n in speeds]
    body: dict[str, Any] = {
        "kind": "stationary_stribeck",
        "cycles": cycles,
        "channels": {
            "pressure_bar": [p for p, _ in rows],
            "speed_rpm": [float(n) for _, n in rows],
            "torque_nm": [torque_nm(p, n, share) * (1 + noise * rng.standard_normal()) for p, n in rows],
        },
    }
    return body if run_id is None else body | {"run_id": run_id}


def post_tests(client: httpx2.Client, *cycles: float, to: str = "c1", **measured: Any) -> None:
    """Post stationary tests `r0`, `r1000`, ... of a clutch."""
    for each in cycles:
        answer = client.post(f"/v1/clutches/{to}/runs", json=stationary(each, run_id=f"r{each:g}", **measured))
        assert answer.status_code == 201, answer.text


#: Asks once what needs no client of its own. It loads the certificates once for all, gives a busy machine time, and keeps no
#: connection, for services come and go.
ONCE = httpx2.Client(timeout=120, limits=httpx2.Limits(max_keepalive_connections=0))


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_until_ready(url: str, ended: Callable[[], bool]) -> None:
    """Wait for a service that has just been started."""
    deadline = time.monotonic() + 300
    with httpx2.Client(base_url=url, timeout=5) as http:  # one for all: each loads the certificates again
        while time.monotonic() < deadline:
            try:
                if http.get("/readyz").status_code == 200:
                    return
            except httpx2.TransportError:
                assert not ended(), "the service ended before it was ready"
            time.sleep(0.05)
    raise TimeoutError("the service was not ready within 300 s")


#: Forks services off a process that has loaded the library already, which is most of what a start takes.
_LOADED = multiprocessing.get_context("forkserver")
_LOADED.set_forkserver_preload(
    [
        "filterpy.kalman",
        "tests.support",
        "models.diagnosis.diagnose",
        "models.rig.campaign",
        "scipy.signal",
        "service.app",
        "service.cli.demo.demo",
        "service.cli.main",
        "service.cli.serving.services",
        "service.jobs.diagnosis",
        "service.changes.replay",
        "uvicorn.protocols.http.httptools_impl",
    ]
)


def _run(arguments: list[str], environment: dict[str, str], output: Path | None = None) -> None:
    """The command in the forked process; a stand-in engine says there, too, what its extensions do."""
    from service.cli.main import app

    gc.freeze()  # what was loaded before the fork is nothing to look through
    process.subprocess = FORKING
    forkserver._forkserver.ensure_running = lambda: None  # it is there; this process did not begin it
    multiprocessing.current_process()._config["daemon"] = False  # else it may have no processes of its own
    engine = environment.get("CLUTCHLIFE_ENGINE")
    if engine is not None:
        from models.diagnosis.extension import Extension

        for name, method in import_module(engine.partition(":")[0]).METHODS.items():
            setattr(Extension, name, method)
    if output is not None:
        with output.open("wb") as file:
            os.dup2(file.fileno(), sys.stdout.fileno())
            os.dup2(file.fileno(), sys.stderr.fileno())
    os.environ.clear()
    os.environ.update(environment)
    app(arguments)


def clutchlife(*arguments: str | Path, code: int = 0) -> str:
    """Run a command, forked as well, and return what it printed."""
    with TemporaryDirectory() as folder:
        output = Path(folder) / "output"
        child = _LOADED.Process(target=_run, args=([*map(str, arguments)], dict(os.environ), output))
        child.start()
        child.join()
        printed = output.read_text(encoding="utf-8")
    assert child.exitcode == code, printed
    return printed


class _Passed:
    """A file's number that is passed to a process as it is begun."""

    def __init__(self, number: int) -> None:
        self.number = number

    def __reduce__(self) -> Any:
        return _received, (DupFd(self.number),)


def _received(passed: Any) -> int:
    return passed.detach()


class _Forked:
    """In place of the `Popen` of a job's process: the same modules with the same arguments, forked off what is loaded."""

    def __init__(
        self, command: list[str], *, stdin: int, stdout: IO[bytes], stderr: IO[bytes], env: dict[str, str]
    ) -> None:
        assert stdin == subprocess.PIPE
        ends, kept = os.pipe()
        self.stdin = os.fdopen(kept, "wb")
        files = [_Passed(number) for number in (ends, stdout.fileno(), stderr.fileno())]
        arguments = command[command.index("-m") + 1 :]
        self._process = _LOADED.Process(target=_run_module, args=(arguments, env, files))
        self._process.start()
        os.close(ends)

    @property
    def returncode(self) -> int | None:
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> None:
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired("a job", timeout or 0.0)

    def kill(self) -> None:
        self._process.kill()


#: In place of `subprocess` in `service.jobs.process`.
FORKING = SimpleNamespace(Popen=_Forked, PIPE=subprocess.PIPE, TimeoutExpired=subprocess.TimeoutExpired)


def _run_module(arguments: list[str], environment: dict[str, str], files: list[int]) -> None:
    for number, file in enumerate(files):
        os.dup2(file, number)
    os.environ.clear()
    os.environ.update(environment)
    gc.freeze()
    warnings.simplefilter("ignore")
    warnings.simplefilter("default", RuntimeWarning)
    for name in ("service.jobs.background", "service.jobs.diagnosis", "service.jobs.change"):
        sys.modules.pop(name, None)  # it is run as if it had not been loaded
    sys.argv = arguments
    runpy.run_module(arguments[0], run_name="__main__", alter_sys=True)


class Server:
    """A service in a process of its own, over a real socket; `loaded`: forked, where its start and memory are no matter.

    `database`: the path of a file, or an address.

    `environment`: variables beside those of the tests. `log`: the least level of a line, and where lines go (None: as here)
    unless it is forked.
    """

    def __init__(
        self,
        database: Path | str,
        *,
        loaded: bool = False,
        environment: Mapping[str, str] | None = None,
        log: tuple[LogLevel, int | None] = ("warning", None),
    ) -> None:
        self.database = database
        self.address = database if isinstance(database, str) else f"sqlite:///{database}"
        self.port = free_port()
        self.loaded = loaded
        self.environment = dict(environment or {})
        self.log_level, self.log_to = log
        self.url = f"http://127.0.0.1:{self.port}"
        self.process: subprocess.Popen[bytes] | BaseProcess | None = None

    def start(self) -> None:
        arguments = ["serve", "--port", str(self.port), "--log-level", self.log_level]
        arguments += ["--database", self.address]
        environment = os.environ | self.environment
        if self.loaded:
            # a process that is forked off another's may have none of its own
            environment |= {"CLUTCHLIFE_WORKERS": "0"}
            if isinstance(self.database, Path):
                lay_empty(self.database)
            self.process = _LOADED.Process(target=_run, args=(arguments, environment), daemon=True)
            self.process.start()
        else:
            command = [sys.executable, "-m", "service.cli.main", *arguments]
            self.process = subprocess.Popen(command, env=environment, stderr=self.log_to)
        wait_until_ready(self.url, lambda: self.exit_code() is not None)

    @cached_property
    def http(self) -> httpx2.Client:
        """A client of it, which keeps no connection either."""
        return httpx2.Client(base_url=self.url, timeout=120, limits=httpx2.Limits(max_keepalive_connections=0))

    @property
    def pid(self) -> int:
        return self.process.pid

    def exit_code(self, within: float = 0.0) -> int | None:
        """What the process ended with, below 0 for a signal, or None if it is still there after some seconds."""
        if isinstance(self.process, subprocess.Popen):
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(timeout=within)
            return self.process.returncode
        self.process.join(within)
        return self.process.exitcode

    def kill(self) -> None:
        """As a power cut would."""
        os.kill(self.pid, signal.SIGKILL)
        assert self.exit_code(30) == -signal.SIGKILL

    def stop(self) -> int:
        """As an operator would; returns the exit code."""
        os.kill(self.pid, signal.SIGTERM)
        code = self.exit_code(30)
        assert code is not None, "the service was asked to stop and is there after 30 s"
        return code


@contextmanager
def serving(
    database: Path | str,
    *,
    loaded: bool = False,
    environment: Mapping[str, str] | None = None,
    log: tuple[LogLevel, int | None] = ("warning", None),
) -> Iterator[Server]:
    """A running service on that database, stopped at the end whatever happens."""
    server = Server(database, loaded=loaded, environment=environment, log=log)
    try:
        server.start()
        yield server
    finally:
        if server.process is not None and server.exit_code() is None:
            server.stop()


def filled_service(
    fill: Callable[[Server], object] | None = None, *, scope: Literal["function", "module"] = "module", engine: str = ""
) -> Any:
    """Makes of what fills a service the fixture of one that runs, for all of a module or for a test, with another engine."""
    if fill is None:
        return partial(filled_service, scope=scope, engine=engine)

    @pytest.fixture(scope=scope)
    def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
        path = tmp_path_factory.mktemp("served") / "clutchlife.db"
        with serving(path, loaded=True, environment={"CLUTCHLIFE_ENGINE": engine} if engine else None) as server:
            fill(server)
            yield server

    return running


@contextmanager
def served() -> Iterator[tuple[Server, httpx2.Client]]:
    """A service on a new database of its own, and a client of it."""
    with (
        TemporaryDirectory() as folder,
        serving(Path(folder) / "clutches.db") as server,
        httpx2.Client(base_url=server.url, timeout=120) as http,
    ):
        yield server, http
