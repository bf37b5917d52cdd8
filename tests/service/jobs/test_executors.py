"""The three executors agree on the same inputs, whatever happens to their processes."""

import io
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.console import Console

from service.jobs import executor as executors
from service.jobs import progress
from service.jobs.executor import Executor, ExecutorUnavailableError, Outcome, Processes, WorkerLostError, executor_of
from tests.service.jobs import calls
from tests.service.jobs.clusters import ROOT, LocalCluster, local_cluster
from tests.service.jobs.waiting import until
from tests.support import free_port, one_quick


@pytest.fixture(scope="module")
def dask_cluster() -> Iterator[LocalCluster]:
    with local_cluster(2) as running:
        yield running


@pytest.fixture(params=["local", "processes:2", "cluster"])
def executor(request: pytest.FixtureRequest) -> Iterator[Executor]:
    address = request.param
    if address == "cluster":
        address = request.getfixturevalue("dask_cluster").address
    with executor_of(address) as made:
        yield made


@pytest.fixture(params=one_quick(["processes:2", "cluster"]))
def killed(request: pytest.FixtureRequest) -> Iterator[Executor]:
    """An executor whose processes the test may kill."""
    if request.param == "cluster":
        allowed = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}  # two processes are killed by one input
        with local_cluster(2, nanny=True, **allowed) as running, executor_of(running.address) as made:
            yield made
    else:
        with executor_of(request.param) as made:
            yield made


def shown(outcome: Outcome[float]) -> tuple[int, float | None, str]:
    return outcome.index, outcome.result, f"{type(outcome.error).__name__}: {outcome.error}"


def test_results_and_errors_are_those_of_the_function(executor: Executor) -> None:
    items = list(range(-2, 30))
    outcomes = list(executor.map(calls.squared, items))
    expected = [
        (index, None, f"ValueError: {item} is negative")
        if item < 0
        else (index, None, f"RuntimeError: OddError: {item} is odd, {item} too")
        if item % 7 == 3
        else (index, item**2 / 3.0, "NoneType: None")
        for index, item in enumerate(items)
    ]
    assert [shown(outcome) for outcome in outcomes] == expected
    with pytest.raises(ValueError, match="-2 is negative"):
        outcomes[0].value()
    assert outcomes[3].value() == 1 / 3.0
    if executor.elsewhere:  # linear algebra has one thread; the tests' own process has what it was started with
        assert [outcome.value() for outcome in executor.map(calls.threads, range(4))] == [{1}] * 4


def test_outcomes_come_in_order_or_as_they_are_ready(executor: Executor) -> None:
    list(executor.map(calls.slow_first, range(1, 9)))  # all processes are up
    as_they_come = [outcome.index for outcome in executor.map(calls.slow_first, range(12), in_order=False)]
    assert sorted(as_they_come) == list(range(12))
    assert (as_they_come[0] == 0) is not executor.elsewhere
    assert [outcome.result for outcome in executor.map(calls.slow_first, range(12))] == list(range(12))


def test_inputs_are_taken_as_they_are_needed_and_their_error_is_raised(executor: Executor) -> None:
    taken = 0

    def items() -> Iterator[int]:
        nonlocal taken
        while True:
            taken += 1
            yield taken

    outcomes = executor.map(calls.slow_first, items())
    for number in range(1, 11):
        assert next(outcomes).result == number
        assert taken <= number + 8  # two for each of at most four threads
    outcomes.close()  # type: ignore[attr-defined]  (a generator)
    assert taken <= 18

    def broken() -> Iterator[int]:
        yield 1
        raise LookupError("there are no more")

    with pytest.raises(LookupError, match="there are no more"):
        list(executor.map(calls.squared, broken()))


def test_what_a_killed_process_did_is_done_again_and_an_input_that_kills_each_is_an_error(
    killed: Executor, tmp_path: Path
) -> None:
    places = [(str(tmp_path), number) for number in range(12)]
    assert [outcome.value() for outcome in killed.map(calls.killed_once, places)] == list(range(12))
    assert (tmp_path / "killed").exists()
    (outcome,) = killed.map(calls.killed_always, [3])
    assert isinstance(outcome.error, WorkerLostError)
    if isinstance(killed, Processes):  # Dask takes inputs that wait beside it for guilty too
        outcomes = list(killed.map(calls.killed_always, range(6)))
        assert [outcome.result for outcome in outcomes] == [0, 1, 2, None, 4, 5]


def test_closing_ends_what_runs_at_once() -> None:
    pool = executor_of("processes:2")
    outcomes = pool.map(calls.forever, range(8))
    threading.Timer(2.0, pool.close).start()
    with pytest.raises(RuntimeError, match="the executor is closed"):
        list(outcomes)
    until(lambda: not any(child.is_alive() for child in multiprocessing.active_children()), within=120.0)


def test_processes_end_with_the_one_that_started_them() -> None:
    source = (
        "from service.jobs.executor import executor_of\n"
        "from tests.service.jobs.calls import pid\n"
        "import os, signal\n"
        "pool = executor_of('processes:2')\n"
        "print({outcome.result for outcome in pool.map(pid, range(8))}, flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, timeout=600, cwd=ROOT)
    assert done.returncode == -signal.SIGKILL, done.stderr
    pids = [int(text) for text in done.stdout.strip().strip("{}").split(",")]
    assert pids
    until(lambda: not any(Path(f"/proc/{each}").exists() for each in pids), within=120.0)


def test_a_cluster_of_another_release_is_refused(dask_cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch) -> None:
    own = executors.release()
    monkeypatch.setattr(executors, "release", lambda: own | {"clutchlife": "0.0.1"})
    with pytest.raises(ExecutorUnavailableError, match=rf"clutchlife {own['clutchlife']} instead of 0\.0\.1"):
        executor_of(dask_cluster.address)


@pytest.mark.slow
def test_a_worker_of_another_release_that_joins_later_is_refused(
    dask_cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    with executor_of(dask_cluster.address) as made:
        own = executors.release()
        monkeypatch.setattr(executors, "release", lambda: own | {"numpy": "1.0"})
        with pytest.raises(ExecutorUnavailableError, match=r"instead of 1\.0: results could differ"):
            list(made.map(calls.squared, range(4)))


def test_what_is_no_cluster_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors, "CONNECT_SECONDS", 0.5)
    with pytest.raises(ExecutorUnavailableError, match="no Dask scheduler answers there"):
        executor_of(f"tcp://127.0.0.1:{free_port()}")
    monkeypatch.setattr(executors, "CONNECT_SECONDS", 30.0)
    monkeypatch.setattr(executors, "WORKER_SECONDS", 0.5)
    no_worker = pytest.raises(ExecutorUnavailableError, match="has no worker: dask worker tcp://")
    with local_cluster(0) as running, no_worker:
        executor_of(running.address)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ExecutorUnavailableError, match=r"pip install -e '\.\[cluster\]'"):
        executor_of("tcp://127.0.0.1:1")


@pytest.mark.slow
def test_a_scheduler_that_ends_is_named() -> None:
    with local_cluster(1) as running, executor_of(running.address) as made:
        outcomes = made.map(calls.pid, range(10_000))
        assert next(outcomes).error is None
        os.kill(running.scheduler.pid, signal.SIGKILL)
        with pytest.raises(ExecutorUnavailableError, match="the Dask scheduler has ended"):
            list(outcomes)


@pytest.mark.slow
def test_a_cluster_whose_last_worker_ends_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with local_cluster(1) as running, executor_of(running.address) as made:
        monkeypatch.setattr(executors, "WORKER_SECONDS", 1.0)
        with pytest.raises(ExecutorUnavailableError, match="has no worker any more"):
            list(made.map(calls.killed_always, range(6)))


@pytest.mark.parametrize(
    "scheduler", ["", "process", "processes:", "processes:0", "processes:x", "http://a:1", "Local"]
)
def test_what_is_no_scheduler_is_named(scheduler: str) -> None:
    with pytest.raises(ValueError, match=r"the scheduler must be local, processes\[:N\]"):
        executor_of(scheduler)


def test_progress_is_a_line_now_and_then_where_there_is_no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "LINE_SECONDS", 0.0)
    plain, terminal = io.StringIO(), io.StringIO()
    for console in (Console(file=plain), Console(file=terminal, force_terminal=True, width=80)):
        with progress.progress(console, "replaying") as advance:
            advance(0, total=2)
            advance()
            advance()
    assert plain.getvalue().splitlines() == ["replaying: 0 of 2", "replaying: 1 of 2", "replaying: 2 of 2"]
    assert "2/2" in terminal.getvalue()


def test_a_computation_that_ends_its_thread_keeps_nobody_waiting() -> None:
    with pytest.raises(SystemExit):
        [each.value() for each in executor_of("local").map(sys.exit, [3])]
