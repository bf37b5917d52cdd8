"""The terminal of a working day: register, list, status, watch, alarms; what a mistyped name leaves behind."""

import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest
import typer
from rich.table import Table

from service.cli.clutches import _row
from service.cli.options import fail, out, print_line
from service.client.clutchlife import Client
from tests.support import Server, clutchlife, free_port, serving, stationary


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with serving(tmp_path_factory.mktemp("terminal") / "clutchlife.db", loaded=True) as running:
        with Client(running.url) as client:
            for name in ("worn", "young", "fine"):
                client.register(name)
            for cycles in (0.0, 1000.0, 2000.0, 3000.0):
                client.post_run("fine", stationary(cycles, wear=cycles / 1e6))
                client.post_run("worn", stationary(cycles, wear=cycles / 4000))
        yield running


@pytest.mark.parametrize(
    ("clutch", "code", "words"),
    [("fine", 0, "Normal"), ("young", 1, "Function check"), ("worn", 2, "Failure"), ("nobody", 3, "register nobody")],
)
def test_status_ends_as_monitoring_plugins_do(server: Server, clutch: str, code: int, words: str) -> None:
    printed = clutchlife("status", clutch, "--url", server.url, code=code)
    assert words in printed
    assert "Traceback" not in printed


def test_status_is_unknown_where_nobody_answers_or_it_is_misused() -> None:
    away = f"http://127.0.0.1:{free_port()}"
    assert "unknown" in clutchlife("status", "fine", "--url", away, "--patience", "0", code=3)
    for wrong in (("status",), ("status", "fine", "--bogus"), ("status", "fine", "--url", "nonsense")):
        printed = clutchlife(*wrong, code=3)
        assert len(printed.strip().splitlines()) == 1, printed


def test_clutches_are_registered_and_listed(server: Server, tmp_path: Path) -> None:
    record = tmp_path / "record.json"
    record.write_text(json.dumps({"fluid": "other"}), encoding="utf-8")
    at = ("--url", server.url)
    given = ("--record", record, "--set", "geometry.friction_faces=4")
    assert "is registered" in clutchlife("register", "new", *given, *at)
    with Client(server.url, frames="list") as client:
        made, listed = client.clutch("new"), client.clutches()
    assert (made["fluid"], made["geometry"]["friction_faces"]) == ("other", 4)
    shown = json.loads(clutchlife("list", "--json", *at))
    assert [item["clutch_id"] for item in listed] == [item["clutch_id"] for item in shown]
    assert "failure" in clutchlife("list", *at)
    assert "409" in clutchlife("register", "new", *at, code=65)


def test_watch_prints_a_line_where_it_changes(server: Server) -> None:
    printed = clutchlife("watch", "fine", "--looks", "3", "--every", "0.1", "--url", server.url)
    assert printed.count("fine: Normal") == 1


def test_alarms_are_listed_and_acknowledged(server: Server) -> None:
    at = ("--url", server.url)
    assert "no alarm" in clutchlife("alarms", "--clutch", "worn", *at)
    with Client(server.url) as client:
        client.service.post("/v1/alarms", {"clutch_id": "worn", "quantity": "state"})
    (event,) = json.loads(clutchlife("alarms", "--json", *at))
    assert "worn: failure" in clutchlife("alarms", *at)
    assert "acknowledged" in clutchlife("alarms", "--acknowledge", event["event_id"], "--note", "seen", *at)
    assert "state" in clutchlife("alarms", "--rules", *at)


def test_the_version_is_that_of_the_release() -> None:
    assert clutchlife("--version").strip() == f"clutchlife {version('clutchlife')}"


def test_a_push_to_a_mistyped_clutch_leaves_nothing_in_the_spool(server: Server, tmp_path: Path) -> None:
    run, spool = tmp_path / "run.json", tmp_path / "spool"
    run.write_text(json.dumps(stationary(4000.0)), encoding="utf-8")
    (tmp_path / "clutch.json").write_text(json.dumps({"clutch_id": "fine"}), encoding="utf-8")
    for pushed in (run, tmp_path):
        printed = clutchlife("push", pushed, "--clutch", "fien", "--url", server.url, "--spool", spool, code=65)
        assert "clutchlife register fien" in printed
    assert not list(spool.rglob("*.body"))


def test_a_wrong_call_is_one_plain_line() -> None:
    for wrong in (("life",), ("bogus",), ("key", "create"), ("list", "--bogus")):
        lines = clutchlife(*wrong, code=64).strip().splitlines()
        assert len(lines) == 1, lines
        assert "--help" in lines[0]


def test_a_list_states_cycles_whole_and_no_remaining_life_after_an_end() -> None:
    left = {"at_least": 2.9, "status": "predicted", "ended": None, "remaining_cycles": {"0.5": 4.2}}
    summary = {"as_of_cycles": 1e7} | left
    item = {"clutch_id": "c", "held": 0, "summary": summary, "state": {"name": "normal"}}
    assert _row(item) == ["c", "normal", "10,000,000", "2", "4", ""]
    over = {"at_least": None, "status": "ended", "ended": {"cycles": 1e7}, "remaining_cycles": {"0.5": None}}
    assert _row(item | {"summary": summary | over}) == ["c", "ended, normal", "10,000,000", "-", "-", ""]
    assert _row(item | {"summary": summary | over | {"ended": None}})[1] == "normal"


def test_no_note_or_name_commands_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    """The title of a window, colours, a line written over: by a line, a table, an error."""
    evil = "a\x1b]0;b\x07\x1b[2Jc\x9bd\u202e"
    table = Table("note")
    table.add_row(evil)
    print_line(evil)
    out.print(table)
    with pytest.raises(typer.Exit):
        fail(evil)
    printed = "".join(capsys.readouterr())
    assert printed.count("a\ufffd]0;b") == 3
    assert all(sign.isprintable() or sign == "\n" for sign in printed)
