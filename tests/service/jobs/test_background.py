"""Work in the background yields, and what is loaded and stored for it does not."""

import os
import platform
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NoReturn

import pytest

from service.jobs.executor import InProcess
from storage import clutches
from storage.engine.opening import open_database
from tests.support import one_quick

pytestmark = pytest.mark.skipif(not hasattr(os, "SCHED_IDLE"), reason="this system has no such policy")


def policy() -> int:
    """The scheduling policy of the calling thread."""
    return os.sched_getscheduler(0)


def test_what_is_computed_yields_and_what_is_loaded_and_stored_does_not() -> None:
    usual, loaded = policy(), []
    assert usual != os.SCHED_IDLE

    def items() -> Iterator[int]:
        loaded.append(policy())
        yield 0

    for outcome in InProcess().map(lambda _: policy(), items()):
        assert (outcome.value(), loaded, policy()) == (os.SCHED_IDLE, [usual], usual)
    assert loaded


def test_a_module_is_run_in_the_background_from_its_first_import_on() -> None:
    source = "import os, sys; print(os.sched_getscheduler(0), sys.argv[1:])"
    command = [sys.executable, "-m", "service.jobs.background", "timeit", "-n1", "-r1", source]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.startswith(f"{os.SCHED_IDLE} ['-n1', '-r1', ")


def test_a_system_that_refuses_the_policy_gives_the_lowest_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> NoReturn:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    (outcome,) = InProcess().map(lambda _: os.getpriority(os.PRIO_PROCESS, 0), [0])
    assert outcome.value() == 19
    assert os.getpriority(os.PRIO_PROCESS, 0) < 19


#: Prints how many threads each library of linear algebra has that numpy and scipy bring.
BLAS_THREADS = """
import scipy.linalg
from threadpoolctl import threadpool_info
print([library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"])
"""


def threads_of(*command: str) -> list[int]:
    """What BLAS_THREADS prints in a process that is told to use four."""
    told = os.environ | {"OPENBLAS_NUM_THREADS": "4", "OMP_NUM_THREADS": "4"}
    done = subprocess.run((sys.executable, *command), capture_output=True, text=True, check=True, timeout=60, env=told)
    return [int(number) for number in done.stdout.splitlines()[0].strip("[]").split(",")]


def test_linear_algebra_that_is_loaded_in_the_background_has_one_thread() -> None:
    usual = threads_of("-c", BLAS_THREADS)
    if max(usual) == 1:
        pytest.skip("linear algebra has one thread here anyway")
    assert set(threads_of("-m", "service.jobs.background", "timeit", "-n1", "-r1", BLAS_THREADS)) == {1}
    within = (
        f"from service.jobs.executor import InProcess; list(InProcess().map(lambda _: exec({BLAS_THREADS!r}), [0]))"
    )
    assert set(threads_of("-c", within)) == {1}


#: `clutchlife replay`, whose one clutch is computed until it is interrupted, or stored until it is.
REPLAY = """
import signal, sys, time
import numpy as np
from service.changes import replay
from storage import clutches
from tests.storage.samples import clutch_row

def compute(_):
    print("computes", flush=True)
    while True:
        np.linalg.svd(np.ones((200, 200)))

def store(database, *_):
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        print("stores", flush=True)
        time.sleep(600)

replay.replay = {"computes": lambda _, names, computing: computing.map(compute, names), "stores": store}[sys.argv[1]]
from service.cli.main import app
signal.signal(signal.SIGINT, signal.default_int_handler)  # who tests in the background of a shell has it ignored
app(["replay", "c1", "--database", sys.argv[2]])
"""


@pytest.mark.parametrize("at", one_quick(["stores", "computes"]))
def test_an_interrupt_ends_a_command_in_the_middle_and_leaves_nothing_half_done(tmp_path: Path, at: str) -> None:
    url = f"sqlite:///{tmp_path / 'a.db'}"
    open_database(url).close()
    command = [sys.executable, "-c", REPLAY, at, url]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as replay:
        try:
            assert replay.stdout.readline().strip() == at
            replay.send_signal(signal.SIGINT)
            said = replay.communicate(timeout=60)[1]
        finally:
            replay.kill()
    assert replay.returncode in {1, 130}, said
    assert "Traceback" not in said
    with closing(open_database(url, lock_timeout=0.05)) as database, database.writing() as connection:
        assert clutches.all_ids(connection) == []


_REUSING = """
import resource, sys
import numpy as np
from service.jobs.background import keep_memory
if sys.argv[1] == "kept":
    keep_memory()
def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        several = [np.ones((100, 4000)) for _ in range(3)]
        del several
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
faults()
print(faults())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries keep memory by their own rules")
def test_memory_of_arrays_is_kept_for_the_next_ones() -> None:
    def faults(how: str) -> int:
        command = [sys.executable, "-c", _REUSING, how]
        return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    assert faults("kept") < 100 < 10_000 < faults("given back")
