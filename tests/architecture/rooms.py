"""Which files an errand of the service passes through, by the interpreter's own profile hook.

A service in this process, on a database of its own, runs each errand once to warm up and once more while it is watched;
routes run in a pool of threads, so that every thread is watched. A file is entered where a function of it is called.

Threads that are there before the errand run beside the request, on a busy machine in another order than on an idle one. So
the files that the request's own threads enter come first, then those of what computes for it.
"""

import sys
import tempfile
import threading
from collections import defaultdict
from collections.abc import Callable, Set
from pathlib import Path
from types import FrameType

from fastapi.testclient import TestClient

from service.web.limits import LONGEST_WAIT_SECONDS
from tests.architecture.source import ROOT
from tests.service.clients import client_on
from tests.support import stationary

#: Files of these folders count; what the service asks of the numerics is another chapter.
COUNTED = ("service", "storage")
PRESSURES = (4.0, 5.0, 6.0)
EARLIER_RUNS = 4
#: Threads that look from time to time, at the workers, for what receivers of alarms are to be sent, and at a job's lease:
#: what they enter depends on how long an errand takes.
BESIDE: Set[str] = {"lease", "outbox", "workers"}
#: The thread that does jobs.
JOBS = "jobs"


def _part_of(thread: str) -> int:
    """Where in the list the files stand that a thread of that name enters: those of the request's own threads, of what
    computes for it, of jobs."""
    return 2 if thread == JOBS else int(thread.endswith(" calls"))


def entered(errand: Callable[[TestClient, str], None], *, warm: bool = True, jobs: bool = False) -> list[str]:
    """The files of this process that an errand enters, by kinds of threads (`_part_of`) and the order in which each enters
    them, on one of two clutches of some stationary runs each.

    `warm`: after the same errand on the other clutch. `jobs`: a job is a part of the errand.
    """
    by_part: dict[int, dict[str, None]] = defaultdict(dict)
    but = BESIDE if jobs else BESIDE | {JOBS}
    watched, folders = False, tuple(f"{ROOT / folder}/" for folder in COUNTED)

    def watch(frame: FrameType, event: str, _: object) -> None:
        """The hook: Python calls it at every call and return."""
        if not watched or event != "call" or not frame.f_code.co_filename.startswith(folders):
            return
        if (thread := threading.current_thread().name) not in but:
            by_part[_part_of(thread)][frame.f_code.co_filename] = None

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
    files = dict.fromkeys(name for part in sorted(by_part) for name in by_part[part])
    return [Path(name).relative_to(ROOT).as_posix() for name in files]


def post_run(http: TestClient, clutch_id: str, cycles: float = 1000.0 * EARLIER_RUNS) -> None:
    body = stationary(cycles, pressures=PRESSURES)
    http.post(f"/v1/clutches/{clutch_id}/runs", json=body).raise_for_status()


def get_life(http: TestClient, clutch_id: str) -> None:
    """Of a clutch that a run has changed since it was asked for."""
    http.get(f"/v1/clutches/{clutch_id}/remaining-useful-life").raise_for_status()


def diagnose(http: TestClient, clutch_id: str) -> None:
    """Until the report is there, which is computed in another process."""
    asked = {"json": {"adopt": False}, "headers": {"Prefer": f"wait={LONGEST_WAIT_SECONDS}"}}
    answer = http.post(f"/v1/clutches/{clutch_id}/diagnoses", **asked).raise_for_status()
    assert answer.json()["status"] == "finished", answer.text
