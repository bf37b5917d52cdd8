"""A sender that is killed before any operation on its files and any statement of its database: nothing is lost, and no
replaced version is revived."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from service.cli.sending import spool
from service.cli.sending.delivery import Sent, deliver
from service.cli.sending.spool import Spool
from service.client.clutchlife.transport import Service
from tests.service.cli.sending.kills import every_kill
from tests.service.cli.sending.stand_in_service import URL, StandInService, body
from tests.service.cli.sending.test_spool import PARAMETERS, contents, set_aside, written


@pytest.fixture(autouse=True)
def quick_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """A kill leaves what was written, on the disk or not; waiting for the disk would be most of these tests."""
    monkeypatch.setattr(os, "fsync", lambda _handle: None)
    monkeypatch.setattr(spool, "_DURABLE", "PRAGMA synchronous = OFF")


class Bench:
    """A sender with its files and its spool, and a service; made again for each kill."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        self.files = folder
        self.spool = Spool.of(folder / "spool", URL, "c1")
        self.service = StandInService()

    def push(self, content: bytes, name: str = "run.json") -> None:
        """Keep one run."""
        self.spool.add([(written(self.files / name, content), None)])

    def send(self) -> None:
        """Send what waits."""
        with self.spool.sending(0.0):
            deliver(Service(http=self.service.client()), self.spool, Sent(), lambda _line: None, lambda: None)


def benches(tmp_path: Path, prepare: Callable[[Bench], None], act: Callable[[Bench], None]) -> list[Bench]:
    """A bench for each operation of `act`, killed before it."""
    made: list[Bench] = []

    def act_on(_operation: int) -> None:
        act(made[-1])

    def folder_of(operation: int) -> Path:
        made.append(Bench(tmp_path / str(operation)))
        prepare(made[-1])
        return made[-1].spool.folder

    kills = list(every_kill(folder_of, act_on))
    return made[: len(kills)]


OLDER, NEWER = body(70000), body(7000)


def waits(bench: Bench) -> None:
    bench.push(OLDER)


def test_a_killed_push_loses_nothing_and_keeps_no_half(tmp_path: Path) -> None:
    """Each kill of the first push: the run waits whole, or not at all; pushed again it waits once."""
    for bench in benches(
        tmp_path, lambda bench: bench.push(body(1), "1.json"), lambda bench: bench.push(body(2), "2.json")
    ):
        bench.spool.begin()
        assert {path.name for path in bench.spool.folder.iterdir()} - {"spool.sqlite"} == {
            entry.body for entry in bench.spool.waiting()
        }
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
    def correct(bench: Bench) -> None:
        bench.push(NEWER)
        bench.send()

    for bench in benches(tmp_path, waits, correct):
        correct(bench)
        assert list(bench.service.stored.values()) == [NEWER]
        assert contents(bench.spool) == []


def test_a_kill_while_sending_loses_and_doubles_nothing(tmp_path: Path) -> None:
    """Of the runs one is stored, one is refused, one is a record file, one has replaced another."""

    def prepare(bench: Bench) -> None:
        bench.spool.add([(written(bench.files / "a.csv", b"csv"), PARAMETERS)])
        bench.push(body(1), "1.json")
        bench.push(body(-1), "2.json")
        bench.push(OLDER)
        bench.push(NEWER)

    for bench in benches(tmp_path, prepare, Bench.send):
        bench.send()
        assert sorted(bench.service.stored.values()) == sorted([b"csv", body(1), NEWER])
        assert contents(bench.spool) == []
        (refused,) = bench.spool.refused()
        assert bench.spool.body(refused).read_bytes() == body(-1)
        assert refused.problem["detail"] == "cycles: must not be negative"
        assert set_aside(bench.spool) == [OLDER]
