"""Which files an errand of the service passes through, by the interpreter's own profile hook.

A service in this process, on a database of its own, runs each errand once to warm up and once more while it is watched;
routes run in a pool of threads, so that every thread is watched. A file is entered where a function of it is called.
"""

import sys
import tempfile
import threading
from collections.abc import Callable, Set
from pathlib import Path
from types import FrameType

from fastapi.testclient import TestClient

from tests.architecture.source import ROOT
from tests.service.clients import client_on
from tests.support import stationary

#: Files of these folders count; what the service asks of the numerics is another chapter.
COUNTED = ("service", "storage")
PRESSURES = (4.0, 5.0, 6.0)
EARLIER_RUNS = 4
#: Threads that look for jobs and keep hold of them, at the workers, and for what receivers of alarms are to be sent.
JOBS: Set[str] = {"jobs", "lease", "outbox", "workers"}


def entered(errand: Callable[[TestClient, str], None], *, warm: bool = True, but: Set[str] = JOBS) -> list[str]:
    """The files of this process that an errand enters, in that order, on one of two clutches of some stationary runs each.

    `warm`: after the same errand on the other clutch. `but`: names of threads that do no part of the errand, such as the one
    that looks for jobs from time to time.
    """
    files, watched, folders = dict[str, None](), False, tuple(f"{ROOT / folder}/" for folder in COUNTED)

    def watch(frame: FrameType, event: str, _: object) -> None:
        """The hook: Python calls it at every call and return."""
        if not watched or event != "call" or not frame.f_code.co_filename.startswith(folders):
            return
        if threading.current_thread().name not in but:
            files[frame.f_code.co_filename] = None

    before, before_threads = sys.getprofile(), threading.getprofile()
    threading.setprofile(watch)  # before the service's threads start
    sys.setprofile(watch)
    try:
        with tempfile.TemporaryDirectory() as folder, client_on(f"sqlite:///{folder}/rooms.db") as http:
            for clutch_id in ("warm-up", "watched"):
                http.post("/v1/clutches", json={"clutch_id": clutch_id}).raise_for_status()
                for number in range(EARLIER_RUNS):
                    post_run(http, clutch_id, 1000.0 * number)
            if warm:
                errand(http, "warm-up")
            watched = True
            errand(http, "watched")
            watched = False
    finally:
        sys.setprofile(before)
        threading.setprofile(before_threads)
    return [Path(name).relative_to(ROOT).as_posix() for name in files]


def post_run(http: TestClient, clutch_id: str, cycles: float = 1000.0 * EARLIER_RUNS) -> None:
    body = stationary(cycles, pressures=PRESSURES)
    http.post(f"/v1/clutches/{clutch_id}/runs", json=body).raise_for_status()


def get_life(http: TestClient, clutch_id: str) -> None:
    """Of a clutch that a run has changed since it was asked for."""
    http.get(f"/v1/clutches/{clutch_id}/remaining-useful-life").raise_for_status()


def diagnose(http: TestClient, clutch_id: str) -> None:
    """Until the report is there, which is computed in another process."""
    asked = {"json": {"adopt": False}, "headers": {"Prefer": "wait=120"}}
    http.post(f"/v1/clutches/{clutch_id}/diagnoses", **asked).raise_for_status()
