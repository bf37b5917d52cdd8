"""Which files an errand of the service passes through, by the interpreter's own profile hook.

A service in this process, on a database of its own, runs each errand once to warm up and once more while it is watched;
routes run in a pool of threads, so that every thread is watched. A file is entered where a function of it is called.
"""

import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Set
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings
from tests.architecture.source import ROOT
from tests.support import stationary

#: Files of these folders count; what the service asks of the numerics is another chapter.
COUNTED = ("service", "storage")
PRESSURES = (4.0, 5.0, 6.0)
EARLIER_RUNS = 4
#: Threads that look for jobs and keep hold of them, and the one that looks for what receivers of alarms are to be sent.
JOBS: Set[str] = {"jobs", "lease", "outbox"}


class Watch:
    """Records files in the order in which they are entered, while `on`. Installed before the service's threads start.

    `but`: names of threads that do no part of the errand, such as the one that looks for jobs from time to time.
    """

    def __init__(self, but: Set[str] = frozenset()) -> None:
        self.on = False
        self.but = but
        self.entered: dict[str, None] = {}
        self._folders = tuple(f"{ROOT / folder}/" for folder in COUNTED)

    def __call__(self, frame: FrameType, event: str, _: object) -> None:
        """The hook: Python calls it at every call and return."""
        if not self.on or event != "call" or not frame.f_code.co_filename.startswith(self._folders):
            return
        if threading.current_thread().name not in self.but:
            self.entered[frame.f_code.co_filename] = None

    @contextmanager
    def watching(self) -> Iterator[list[str]]:
        """Inside, files are recorded; the list is filled at the end with their paths from the root."""
        paths: list[str] = []
        self.entered = {}
        self.on = True
        try:
            yield paths
        finally:
            self.on = False
            paths += [Path(name).relative_to(ROOT).as_posix() for name in self.entered]


@contextmanager
def watched_service(but: Set[str] = JOBS) -> Iterator[tuple[TestClient, Watch]]:
    """A service whose threads are watched, with two clutches of some stationary runs each."""
    before, before_threads, watch = sys.getprofile(), threading.getprofile(), Watch(but)
    threading.setprofile(watch)
    sys.setprofile(watch)
    try:
        with tempfile.TemporaryDirectory() as folder:
            app = create_app(Settings(workers=0, database=f"sqlite:///{folder}/rooms.db"))
            with TestClient(app, base_url="http://127.0.0.1", client=("127.0.0.1", 50000)) as http:
                for clutch_id in ("warm-up", "watched"):
                    http.post("/v1/clutches", json={"clutch_id": clutch_id}).raise_for_status()
                    for number in range(EARLIER_RUNS):
                        post_run(http, clutch_id, 1000.0 * number)
                yield http, watch
    finally:
        sys.setprofile(before)
        threading.setprofile(before_threads)


def post_run(http: TestClient, clutch_id: str, cycles: float = 1000.0 * EARLIER_RUNS) -> None:
    body = stationary(cycles, pressures=PRESSURES)
    http.post(f"/v1/clutches/{clutch_id}/runs", json=body).raise_for_status()


def get_life(http: TestClient, clutch_id: str) -> None:
    http.get(f"/v1/clutches/{clutch_id}/remaining-useful-life").raise_for_status()


def entered(errand: Callable[[TestClient, str], None]) -> list[str]:
    """The files that an errand enters: a GET of the remaining life after a run has changed it, a POST of one more run."""
    with watched_service() as (http, watch):
        errand(http, "warm-up")
        with watch.watching() as paths:
            errand(http, "watched")
    return paths


def of_diagnosis() -> list[str]:
    """The files of this process that a POST of a diagnosis enters until its report is there; it is computed in another."""
    with watched_service(but=frozenset()) as (http, watch), watch.watching() as paths:
        asked = {"json": {"adopt": False}, "headers": {"Prefer": "wait=120"}}
        http.post("/v1/clutches/watched/diagnoses", **asked).raise_for_status()
    return paths
