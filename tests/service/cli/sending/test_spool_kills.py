"""A sender that is killed before any operation on its files and any statement of its database: nothing is lost, and no
replaced version is revived."""

import os
import sqlite3
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import httpx2
import pytest

from service.cli.sending import spool
from tests.service.cli.sending.stand_in_service import body
from tests.service.cli.sending.test_delivery import Sender
from tests.service.cli.sending.test_spool import PARAMETERS, contents, set_aside, written

_OPERATIONS = ("open", "os.rename", "os.remove", "os.mkdir", "os.truncate", "sqlite3.connect")


class KilledError(BaseException):
    """The process is gone; nothing catches it."""


class _Killer:
    """Counts operations on files below a folder; from the fatal one on, none is carried out."""

    def __init__(self) -> None:
        self.folder: str | None = None
        self.left = 0
        self.installed = False

    def __call__(self, event: str, arguments: tuple[object, ...]) -> None:
        if event in _OPERATIONS and self.folder is not None and str(arguments[0]).startswith(self.folder):
            self.count(event, arguments)

    def count(self, event: str, arguments: tuple[object, ...]) -> None:
        """An operation, which is not carried out where it is the fatal one or comes after it."""
        if self.folder is None:
            return
        if self.left == 0:
            raise KilledError(f"{event} {arguments}")
        self.left -= 1


_killer = _Killer()


class _Connection(sqlite3.Connection):
    """A database whose statements are operations on its file."""

    def execute(self, *arguments: Any) -> sqlite3.Cursor:
        _killer.count("statement", arguments)
        return super().execute(*arguments)

    def executemany(self, *arguments: Any) -> sqlite3.Cursor:
        _killer.count("statement", arguments)
        return super().executemany(*arguments)


_connect = sqlite3.connect


@contextmanager
def killed_before(operation: int, folder: object) -> Iterator[None]:
    """Kill what happens inside before its operation of that number, from 0."""
    if not _killer.installed:
        sys.addaudithook(_killer)
        _killer.installed = True
    _killer.folder, _killer.left = str(folder), operation
    sqlite3.connect = partial(_connect, factory=_Connection)  # type: ignore[assignment]
    try:
        yield
    finally:
        _killer.folder, sqlite3.connect = None, _connect


@pytest.fixture(autouse=True)
def quick_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """A kill leaves what was written, on the disk or not; waiting for the disk would be most of these tests."""
    monkeypatch.setattr(os, "fsync", lambda _handle: None)
    monkeypatch.setattr(spool, "_DURABLE", "PRAGMA synchronous = OFF")


def benches(tmp_path: Path, prepare: Callable[[Sender], None], act: Callable[[Sender], None]) -> list[Sender]:
    """A sender with its files, its spool and a service for each operation of `act`, killed before it."""
    made: list[Sender] = []
    while True:
        folder = tmp_path / str(len(made))
        folder.mkdir()
        bench = Sender(folder)
        prepare(bench)
        try:
            with killed_before(len(made), bench.spool.folder):
                act(bench)
        except KilledError:
            made.append(bench)
        else:
            assert len(made) > 3, "hardly anything was done"
            return made


OLDER, NEWER = body(70000), body(7000)
waits = partial(Sender.push, content=OLDER)


def test_a_killed_push_loses_nothing_and_keeps_no_half(tmp_path: Path) -> None:
    """Each kill of the first push: the run waits whole, or not at all; pushed again it waits once."""
    first, second = (partial(Sender.push, content=body(n), name=f"{n}.json") for n in (1, 2))
    for bench in benches(tmp_path, first, second):
        bench.spool.begin()
        bodies = {entry.body for entry in bench.spool.waiting()}
        assert {path.name for path in bench.spool.folder.iterdir()} == {"spool.sqlite", *bodies}
        assert contents(bench.spool) in ([body(1)], [body(1), body(2)])
        bench.push(body(2), "2.json")
        assert contents(bench.spool) == [body(1), body(2)]
        assert bench.spool.replaced() == []
        assert sorted(path.suffix for path in bench.spool.folder.iterdir()) == [".body", ".body", ".sqlite"]


def test_a_killed_correction_leaves_one_version(tmp_path: Path) -> None:
    outcomes = set()
    for bench in benches(tmp_path, waits, lambda bench: bench.push(NEWER)):
        bench.send()
        (delivered,) = bench.service.stored.values()
        outcomes.add(delivered)
        assert set_aside(bench.spool) == contents(bench.spool) == []
    assert outcomes == {OLDER}  # that it is kept and the older one replaced is its last operation


def test_a_correction_that_is_pushed_again_after_a_kill_is_all_that_is_sent(tmp_path: Path) -> None:
    def correct(bench: Sender) -> None:
        bench.push(NEWER)
        bench.send()

    for bench in benches(tmp_path, waits, correct):
        correct(bench)
        assert list(bench.service.stored.values()) == [NEWER]
        assert contents(bench.spool) == []


def test_a_kill_while_sending_loses_and_doubles_nothing(tmp_path: Path) -> None:
    """Of the runs one is stored, one is refused, one is a record file, one has replaced another."""

    def prepare(bench: Sender) -> None:
        bench.spool.add([(written(bench.folder / "a.csv", b"csv"), PARAMETERS)])
        bench.push(body(1), "1.json")
        bench.push(body(-1), "2.json")
        bench.push(OLDER)
        bench.push(NEWER)

    for bench in benches(tmp_path, prepare, Sender.send):
        bench.send()
        assert sorted(bench.service.stored.values()) == sorted([b"csv", body(1), NEWER])
        assert contents(bench.spool) == []
        (refused,) = bench.spool.refused()
        assert bench.spool.body(refused).read_bytes() == body(-1)
        assert refused.problem["detail"] == "cycles: must not be negative"
        assert set_aside(bench.spool) == [OLDER]


def test_a_kill_while_the_service_answers_leaves_the_run_known_as_sent(tmp_path: Path) -> None:
    bench = Sender(tmp_path)
    bench.push(body(1, "r1"))

    def kill(request: httpx2.Request) -> None:
        if request.method == "POST":
            _killer.left = 0  # nothing is written any more, either
            raise KilledError

    bench.service.instead = kill
    with pytest.raises(KilledError), killed_before(10**6, bench.spool.folder):
        bench.send()
    (entry,) = bench.spool.waiting()
    assert (entry.tries, entry.perhaps_stored) == (1, True)
    bench.service.instead = lambda _request: None
    assert bench.send().stored == 1
    assert contents(bench.spool) == []
