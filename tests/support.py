"""What several tests need: bodies to post, and a service to post them to."""

import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx2
import numpy as np

PRESSURES_BAR = (4.0, 4.5, 5.0, 5.5, 6.0, 6.5, 7.0)
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


def free_port() -> int:
    """A port that was free a moment ago."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Server:
    """A service in a process of its own, over a real socket."""

    def __init__(self, database: Path, *, port: int | None = None) -> None:
        self.database = database
        self.port = port or free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start and wait until it is ready."""
        command = [
            sys.executable,
            "-m",
            "service.cli.main",
            "serve",
            "--port",
            str(self.port),
            "--log-level",
            "warning",
        ]
        self.process = subprocess.Popen([*command, "--database", f"sqlite:///{self.database}"])
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            try:
                if httpx2.get(f"{self.url}/readyz", timeout=5).status_code == 200:
                    return
            except httpx2.TransportError:
                assert self.process.poll() is None, "the service ended before it was ready"
                time.sleep(0.05)
        raise TimeoutError("the service was not ready within 60 s")

    def kill(self) -> None:
        """As a power cut would."""
        assert self.process is not None
        os.kill(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def stop(self) -> int:
        """As an operator would; returns the exit code."""
        assert self.process is not None
        self.process.terminate()
        return self.process.wait(timeout=30)


@contextmanager
def serving(database: Path) -> Iterator[Server]:
    """A running service on that database, stopped at the end whatever happens."""
    server = Server(database)
    server.start()
    try:
        yield server
    finally:
        assert server.process is not None
        if server.process.poll() is None:
            server.stop()
