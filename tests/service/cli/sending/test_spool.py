"""The spool on disk: what waits, what replaces what, and what is damaged; which content is a newer version of which."""

import json
import sqlite3
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from service.cli.sending import spool as entries
from service.cli.sending.delivery import Sent, deliver
from service.cli.sending.spool import HeldError, RunHead, Spool, head_of_body, head_of_file, same_run
from service.client.clutchlife.transport import Service
from tests.service.cli.sending.stand_in_service import URL, StandInService, body


@pytest.fixture
def spool(tmp_path: Path) -> Spool:
    return Spool.of(tmp_path / "spool", URL, "c1")


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def contents(spool: Spool) -> list[bytes]:
    return [spool.body(entry).read_bytes() for entry in spool.waiting()]


def set_aside(spool: Spool) -> list[bytes]:
    return [spool.body(entry).read_bytes() for entry in spool.replaced()]


def test_runs_wait_in_the_order_in_which_they_came(spool: Spool, tmp_path: Path) -> None:
    for cycles in (3, 1, 2):
        spool.add([(written(tmp_path / f"{cycles}.json", body(cycles)), None)])
    assert contents(spool) == [body(3), body(1), body(2)]
    assert [entry.head.cycles for entry in spool.waiting()] == [3, 1, 2]
    assert {(entry.url, entry.clutch_id, entry.tries) for entry in spool.waiting()} == {(URL, "c1", 0)}
    for name in ("3.json", "a.json", "3.json"):  # the same content waits once
        assert spool.add([(written(tmp_path / name, body(3)), None)])[1] == []
    assert [Path(source).name for source in spool.waiting()[0].sources] == ["3.json", "a.json"]
    assert len(contents(spool)) == 3


def test_a_corrected_file_replaces_the_version_that_waits(spool: Spool, tmp_path: Path) -> None:
    run = tmp_path / "run.json"
    spool.add([(written(run, body(70000)), None)])
    _, replaced = spool.add([(written(run, body(7000)), None)])
    assert [entry.head.cycles for entry in replaced] == [70000]
    assert (contents(spool), set_aside(spool)) == ([body(7000)], [body(70000)])
    spool.add([(written(run, body(70000)), None)])  # it was right after all
    assert (contents(spool), set_aside(spool)) == ([body(70000)], [body(70000), body(7000)])


def test_a_run_of_the_same_name_is_replaced_from_any_file(spool: Spool, tmp_path: Path) -> None:
    spool.add([(written(tmp_path / "a.json", body(70000, "r1")), None)])
    spool.add([(written(tmp_path / "b.json", body(7000, "r1")), None)])
    assert contents(spool) == [body(7000, "r1")]
    record = written(tmp_path / "c.csv", b"torque_nm\n1\n")
    spool.add([(record, {"kind": "stationary_stribeck", "cycles": "7000.0", "run_id": "r1"})])
    spool.add([(record, {"kind": "stationary_stribeck", "cycles": "700.0"})])  # the same bytes, corrected cycles
    (entry,) = spool.waiting()
    assert (entry.parameters, contents(spool)) == (
        {"kind": "stationary_stribeck", "cycles": "700.0"},
        [b"torque_nm\n1\n"],
    )
    assert len(set_aside(spool)) == 3


def test_a_file_that_is_used_for_every_run_replaces_none(spool: Spool, tmp_path: Path) -> None:
    run = tmp_path / "latest.json"
    for cycles in (1, 2, 3):
        spool.add([(written(run, body(cycles, f"r{cycles}")), None)])
        dated = body(cycles, started_at=f"2026-01-0{cycles}", note=str(cycles))
        spool.add([(written(tmp_path / "other.json", dated), None)])
    assert len(contents(spool)) == 6
    assert set_aside(spool) == []


def test_files_of_one_call_do_not_replace_each_other(spool: Spool, tmp_path: Path) -> None:
    """Two recordings under one name by mistake: the service refuses the second, and it is seen."""
    files = [(written(tmp_path / f"{cycles}.json", body(cycles, "r1")), None) for cycles in (1, 2)]
    for _ in range(2):
        assert spool.add(files)[1] == []
        assert contents(spool) == [body(1, "r1"), body(2, "r1")]


def test_a_clock_set_back_changes_no_order(spool: Spool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = tmp_path / "run.json"
    for cycles, year in ((70000, 2030), (7000, 2026)):
        monkeypatch.setattr(entries, "stamp", lambda year=year: f"{year}-01-01T00:00:00+00:00")
        spool.add([(written(run, body(cycles)), None)])
        spool.add([(written(tmp_path / f"{year}.json", body(year)), None)])
    assert contents(spool) == [body(2030), body(7000), body(2026)]


PARAMETERS = {"kind": "stationary_stribeck", "cycles": "5.0", "filename": "a.csv"}


def test_a_damaged_spool_is_said_so_and_keeps_what_it_has(spool: Spool, tmp_path: Path) -> None:
    spool.add([(written(tmp_path / "1.json", body(1)), None)])
    kept = spool.body(spool.waiting()[0])
    (spool.folder / "spool.sqlite").write_bytes(b"no database, but long enough to be taken for one" * 20)
    for act in (spool.waiting, spool.begin, lambda: Spool.every(spool.folder)):
        with pytest.raises(OSError, match=r"spool\.sqlite cannot be used"):
            act()
    assert kept.read_bytes() == body(1)


def test_fields_of_a_later_release_are_passed_over(spool: Spool, tmp_path: Path) -> None:
    spool.add([(written(tmp_path / "1.json", body(1)), None)])
    with closing(sqlite3.connect(spool.folder / "spool.sqlite", isolation_level=None)) as database:
        database.execute("UPDATE entry SET known = json_set(known, '$.colour', 'red')")
    assert contents(spool) == [body(1)]


def test_a_stored_run_takes_its_refused_and_replaced_copies_along(spool: Spool, tmp_path: Path) -> None:
    run = tmp_path / "run.json"
    spool.add([(written(run, body(1)), None)])
    assert spool.refuse(spool.waiting()[0], {"detail": "no"}) == spool.body(spool.refused()[0])
    assert spool.refused()[0].problem == {"detail": "no"}
    for cycles in (1, 2, 1):
        spool.add([(written(run, body(cycles)), None)])
    assert (len(spool.refused()), len(spool.replaced())) == (1, 2)
    assert spool.done(spool.waiting()[0])
    assert (spool.refused(), set_aside(spool)) == ([], [body(2)])


def test_only_one_process_sends_at_a_time(spool: Spool) -> None:
    with spool.sending(0.0), pytest.raises(HeldError), spool.sending(0.0):
        pass
    with spool.sending(0.0):
        pass


def test_many_push_at_once_and_nothing_is_lost(spool: Spool, tmp_path: Path) -> None:
    service, together = StandInService(), threading.Barrier(4)

    def push(sender: int) -> None:
        own = Spool.of(tmp_path / "spool", URL, "c1")
        together.wait()
        for turn in range(8):
            # a run of this sender's, a run that all have, and a run that all correct
            for name, cycles in ((f"s{sender}-{turn}", 1), (f"all-{turn}", 2)):
                own.add([(written(tmp_path / f"{sender}-{name}.json", body(cycles, name)), None)])
            with own.sending(60.0):
                deliver(Service(http=service.client()), own, Sent(), lambda _line: None, lambda: None)

    with ThreadPoolExecutor(4) as senders:
        list(senders.map(push, range(4)))
    assert spool.waiting() == spool.refused() == spool.replaced() == []
    assert len(service.stored) == 4 * 8 + 8


# --- Which content is a newer version of which.


def head(*, torque: float = 1.0, **fields: object) -> RunHead:
    return head_of_body(json.dumps({"kind": "k", "channels": {"torque_nm": [torque]}} | fields).encode())


MORNING, NOON = "2026-01-01T08:00:00Z", "2026-01-01T12:00:00Z"
IN_GERMANY = head(started_at="2026-01-01T09:00:00+01:00", torque=2, cycles=7000)


@pytest.mark.parametrize(
    ("older", "newer", "same_file", "expected"),
    [
        (head(run_id="a", cycles=70000), head(run_id="a", cycles=7000), False, True),
        (head(run_id="a"), head(run_id="b"), True, False),  # a recorder that writes every run into one file
        (head(cycles=70000), head(cycles=7000, torque=2), True, True),
        (head(cycles=70000), head(cycles=7000), False, False),
        (head(cycles=1), head(cycles=1, run_id="a"), True, True),
        (head(started_at=MORNING), head(started_at=NOON, torque=2), True, False),
        (head(started_at=MORNING), head(started_at=NOON), True, True),  # the start was mistyped
        (head(started_at=MORNING), head(started_at=MORNING, torque=2), True, True),
        (head(started_at=MORNING), head(started_at=NOON), False, False),
        (head(started_at=MORNING, cycles=7000.0), IN_GERMANY, True, True),
        (head(started_at=NOON), IN_GERMANY, True, False),
    ],
)
def test_versions_of_a_run(older: RunHead, newer: RunHead, same_file: bool, expected: bool) -> None:
    assert same_run(older, newer, same_file=same_file) is expected


def test_a_head_states_what_the_run_does() -> None:
    stated = head_of_body(body(7000, "a", started_at=NOON))
    assert (stated.run_id, stated.kind, stated.cycles, stated.started_at) == ("a", "maintenance", 7000.0, NOON)
    assert head_of_file({"kind": "k", "cycles": "7000.0"}, "abc") == RunHead(
        kind="k", cycles=7000.0, measurements="abc"
    )
    texts = [b'{"started_at": "%s", "channels": {"torque_nm": [%s]}}' % (MORNING.encode(), n) for n in (b"1", b"1.0")]
    assert head_of_body(texts[0]).measurements == head_of_body(texts[1]).measurements  # however numbers are written


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"no json",
        b"[1]",
        b"\xff",
        b"[" * 100000,
        b'{"cycles": "many", "run_id": 3}',
        b'{"cycles": NaN}',
        b'{"cycles": 1e999}',
    ],
)
def test_what_is_no_run_has_an_empty_head(text: bytes) -> None:
    assert head_of_body(text) == RunHead()
