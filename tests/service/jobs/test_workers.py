"""Calls in lanes of workers: the same in threads and in processes, turns, bounds, and processes that end."""

import multiprocessing
import multiprocessing.connection
import os
import pickle
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from signal import SIGKILL, SIGSTOP, pause

import pytest

from service.api.clutch import ClutchIn
from service.changes import edit_clutch
from service.errors import BusyError, InvalidError
from service.jobs import workers as module
from service.jobs.workers import Lane, Workers, in_processes, in_threads
from service.logging import request_id
from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.service.jobs import calls
from tests.service.jobs.waiting import until

AT = "2026-11-02T10:00:00+00:00"
IN_TIME = 120.0


@pytest.fixture
def database(in_file: Database) -> Database:
    edit_clutch.register(in_file, ClutchIn(clutch_id="c1"), created_at=AT)
    return in_file


@pytest.fixture(params=["threads", "processes"])
def workers(database: Database, request: pytest.FixtureRequest) -> Iterator[Workers]:
    with closing(in_threads(database) if request.param == "threads" else in_processes(database, 2)) as made:
        yield made


@pytest.fixture
def processes(database: Database) -> Iterator[Workers]:
    with closing(in_processes(database, 1)) as made:
        yield made


def test_a_call_sees_what_was_committed_before_it(database: Database, workers: Workers) -> None:
    assert workers.submit(Lane.RUNS, calls.ids).result(IN_TIME) == ["c1"]
    edit_clutch.register(database, ClutchIn(clutch_id="c2"), created_at=AT)
    assert [workers.submit(lane, calls.ids).result(IN_TIME) for lane in Lane] == [["c1", "c2"]] * len(Lane)


def test_a_call_is_made_for_the_request_that_asked_for_it_and_its_error_comes_back_whole(workers: Workers) -> None:
    for name in ("rig-7", ""):
        before = request_id.set(name)
        asked = [workers.submit(Lane.RUNS, calls.request, turn="c1") for _ in range(3)]
        request_id.reset(before)
        assert [call.result(IN_TIME) for call in asked] == [name] * 3
    with pytest.raises(InvalidError, match="wrong") as caught:
        workers.submit(Lane.RUNS, calls.refused).result(IN_TIME)
    assert (caught.value.total, caught.value.errors[0].row, caught.value.errors[0].value) == (7, 3, "v")


def test_calls_of_one_turn_run_one_after_the_other_and_hold_up_no_other(workers: Workers, tmp_path: Path) -> None:
    log, closed, opened = tmp_path / "log", tmp_path / "closed", tmp_path / "opened"
    opened.touch()
    ours = [
        workers.submit(lane, calls.logged, log, name, closed, turn="c1")
        for lane, name in ((Lane.RUNS, "a"), (Lane.FILES, "b"), (Lane.RUNS, "c"))
    ]
    assert workers.submit(Lane.RUNS, calls.logged, log, "other", opened, turn="c2").result(IN_TIME) == "other"
    assert not any(call.done() for call in ours)
    closed.touch()
    assert [call.result(IN_TIME) for call in ours] == ["a", "b", "c"]
    assert [mark for mark in log.read_text().split() if "other" not in mark] == ["+a", "-a", "+b", "-b", "+c", "-c"]


def test_an_idle_worker_takes_the_next_call_of_the_turn_that_it_had(database: Database, tmp_path: Path) -> None:
    """What it has kept in memory of a clutch is what the clutch's next run needs."""
    with closing(in_processes(database, 2)) as workers:

        def at_rest() -> bool:
            return len(workers._asleep[Lane.RUNS]) == 2

        log, gate = tmp_path / "log", tmp_path / "gate"
        held = [workers.submit(Lane.RUNS, calls.logged, log, turn, gate, turn=turn) for turn in "ab"]
        until(lambda: log.exists() and len(log.read_text().split()) == 2, within=IN_TIME)
        gate.touch()
        assert [call.result(IN_TIME) for call in held] == ["a", "b"]
        pids: dict[str, set[int]] = {"a": set(), "b": set()}
        for turn in "aabab":
            until(at_rest, within=IN_TIME)
            pids[turn].add(workers.submit(Lane.RUNS, calls.pid, turn=turn).result(IN_TIME))
        assert [len(each) for each in (*pids.values(), pids["a"] | pids["b"])] == [1, 1, 2]


def test_more_than_may_wait_are_refused(workers: Workers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MAX_WAITING_LONG", 2)
    gate = tmp_path / "gate"
    held = [workers.submit(Lane.FILES, calls.logged, tmp_path / "log", name, gate) for name in "ab"]
    with pytest.raises(BusyError, match="2 requests"):
        workers.submit(Lane.FILES, calls.ids)
    others = [lane for lane in Lane if lane is not Lane.FILES]
    assert [workers.submit(lane, calls.ids).result(IN_TIME) for lane in others] == [["c1"]] * len(others)
    gate.touch()
    assert [call.result(IN_TIME) for call in held] == ["a", "b"]
    assert workers.submit(Lane.FILES, calls.ids).result(IN_TIME) == ["c1"]


def test_a_process_that_ends_is_replaced_and_its_call_made_once_more(processes: Workers, tmp_path: Path) -> None:
    """Of a lane whose processes end at a call again and again it is told until one is up."""
    assert processes.submit(Lane.RUNS, calls.signalled, tmp_path / "once", 1, SIGKILL).result(IN_TIME) == "alive"
    with pytest.raises(BusyError, match="ended unexpectedly"):
        processes.submit(Lane.RUNS, calls.signalled, tmp_path / "twice", 2, SIGKILL).result(IN_TIME)
    assert processes.ended() == [Lane.RUNS]
    until(lambda: not processes.ended(), within=IN_TIME)
    assert processes.submit(Lane.RUNS, calls.ids).result(IN_TIME) == ["c1"]


@pytest.mark.slow
def test_a_process_that_stops_is_replaced_and_its_call_made_once_more(
    processes: Workers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_SILENCE", 3.0)
    stopped = processes.submit(Lane.RUNS, calls.pid).result(IN_TIME)
    os.kill(stopped, SIGSTOP)
    assert processes.submit(Lane.RUNS, calls.pid).result(IN_TIME) != stopped
    assert processes.submit(Lane.RUNS, calls.signalled, tmp_path / "once", 1, SIGSTOP).result(IN_TIME) == "alive"
    with pytest.raises(BusyError, match="ended unexpectedly"):
        processes.submit(Lane.RUNS, calls.signalled, tmp_path / "twice", 2, SIGSTOP).result(IN_TIME)
    assert processes.submit(Lane.RUNS, calls.ids).result(IN_TIME) == ["c1"]


def test_an_idle_process_that_stops_is_told_and_replaced(processes: Workers, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_SILENCE", 3.0)
    stopped = processes.submit(Lane.RUNS, calls.pid).result(IN_TIME)
    os.kill(stopped, SIGSTOP)
    until(lambda: processes.ended() == [Lane.RUNS], within=IN_TIME)
    until(lambda: not processes.ended(), within=IN_TIME)
    assert processes.submit(Lane.RUNS, calls.pid).result(IN_TIME) != stopped


@pytest.mark.slow
def test_what_starts_processes_is_replaced_where_it_stops(processes: Workers, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_SILENCE", 3.0)
    stopped = processes.submit(Lane.RUNS, calls.pid).result(IN_TIME)
    starter = int(Path(f"/proc/{stopped}/stat").read_text().rpartition(")")[2].split()[1])
    for pid in (starter, stopped):
        os.kill(pid, SIGSTOP)
    assert processes.submit(Lane.RUNS, calls.ids, patience=IN_TIME).result(IN_TIME) == ["c1"]
    assert processes.submit(Lane.ANSWERS, calls.ids, patience=IN_TIME).result(IN_TIME) == ["c1"]
    assert _state(starter) == "Z"


def test_a_call_that_takes_too_long_is_ended_with_its_process(processes: Workers, tmp_path: Path) -> None:
    before = processes.submit(Lane.RUNS, calls.pid).result(IN_TIME)
    with pytest.raises(BusyError, match=r"took longer than 0\.5 s"):
        processes.submit(Lane.RUNS, calls.logged, tmp_path / "log", "a", tmp_path / "never", seconds=0.5).result(
            IN_TIME
        )
    assert processes.submit(Lane.RUNS, calls.pid).result(IN_TIME) != before
    assert (tmp_path / "log").read_text() == "+a "


def test_a_call_that_waits_too_long_is_refused_and_never_begun(workers: Workers, tmp_path: Path) -> None:
    gate, log = tmp_path / "gate", tmp_path / "log"
    assert workers.are_idle()
    held = workers.submit(Lane.ANSWERS, calls.logged, log, "a", gate, turn="c1")
    assert not workers.are_idle()
    late = [
        workers.submit(Lane.ANSWERS, calls.logged, log, "b", gate, turn=turn, patience=0.5) for turn in ("c1", "c2")
    ]
    for call in late:
        with pytest.raises(BusyError, match="the request waited"):
            call.result(IN_TIME)
    oldest = workers.oldest()
    assert oldest[0] is Lane.ANSWERS
    assert 0 < oldest[1] < IN_TIME
    gate.touch()
    assert held.result(IN_TIME) == "a"
    assert workers.submit(Lane.ANSWERS, calls.logged, log, "c", gate, turn="c1").result(IN_TIME) == "c"
    assert log.read_text() == "+a -a +c -c "
    assert (workers.are_idle(), workers.oldest()) == (True, None)


def test_what_cannot_be_sent_is_an_error_and_ends_no_process(processes: Workers) -> None:
    before = processes.submit(Lane.RUNS, calls.pid).result(IN_TIME)
    with pytest.raises((AttributeError, TypeError, pickle.PicklingError)):
        processes.submit(Lane.RUNS, lambda _: 1).result(IN_TIME)
    with pytest.raises(RuntimeError, match="cannot be sent"):
        processes.submit(Lane.RUNS, calls.unsendable).result(IN_TIME)
    assert processes.submit(Lane.RUNS, calls.pid).result(IN_TIME) == before


def test_nothing_is_begun_after_the_end(database: Database, tmp_path: Path) -> None:
    made = in_threads(database)
    gate = tmp_path / "gate"
    gate.touch()
    assert made.submit(Lane.RUNS, calls.logged, tmp_path / "log", "a", gate).result(IN_TIME) == "a"
    made.close()
    with pytest.raises(BusyError):
        made.submit(Lane.RUNS, calls.ids)


def _serve(path: str, answer: "multiprocessing.connection.Connection") -> None:
    """A service with workers that waits to be killed."""
    made = in_processes(open_database(f"sqlite:///{path}"), 1)
    answer.send([made.submit(lane, calls.pid).result(IN_TIME) for lane in Lane])
    pause()


@pytest.mark.slow
def test_workers_end_with_a_service_that_is_killed(database: Database) -> None:
    ours, theirs = multiprocessing.Pipe()
    service = multiprocessing.get_context("spawn").Process(target=_serve, args=(str(database.path), theirs))
    service.start()
    assert ours.poll(IN_TIME)
    pids = ours.recv()
    assert len(set(pids)) == len(Lane)
    os.kill(service.pid, SIGKILL)
    service.join(IN_TIME)
    until(lambda: all(_state(pid) == "Z" for pid in pids), within=IN_TIME)


def _state(pid: int) -> str:
    """Its letter; that of a zombie, too, where it has gone."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return "Z"
