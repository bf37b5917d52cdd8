"""`clutchlife spool` and what `push` says of the spool, as an engineer types them."""

import json
from pathlib import Path
from typing import Any

import httpx2
import pytest

from service.cli.sending import delivery
from service.cli.sending.spool import Spool
from tests.service.cli.sending.stand_in_service import URL, StandInService, body, problem
from tests.service.cli.sending.test_delivery import of_run
from tests.service.cli.sending.test_spool import written
from tests.service.clients import clutchlife


class Terminal:
    """A terminal at a rig, whose service is in memory."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.service = StandInService()
        self.asked: list[str] = []

    def connect(self, url: str, *, key: str | None = None) -> httpx2.Client:
        """The client that a command gets."""
        assert key is None
        self.asked.append(url)
        client = self.service.client()
        client.base_url = httpx2.URL(url)
        return client

    def __call__(self, *arguments: str | Path, code: int = 0, answers: str = "") -> str:
        return clutchlife(*arguments, "--spool", self.folder / "spool", code=code, answers=answers)

    def push(self, content: bytes, name: str = "run.json", *, code: int = 0, clutch: str = "c1", url: str = URL) -> str:
        """Push one run without waiting."""
        return self.push_files(written(self.folder / name, content), code=code, clutch=clutch, url=url)

    def push_files(self, path: Path, *more: str, code: int = 0, clutch: str = "c1", url: str = URL) -> str:
        return self("push", path, "--clutch", clutch, "--url", url, "--patience", "0", *more, code=code)

    def listed(self) -> list[dict[str, Any]]:
        """What `spool list --json` prints."""
        return json.loads(self("spool", "list", "--json"))["items"]


@pytest.fixture
def terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Terminal:
    terminal = Terminal(tmp_path)
    monkeypatch.setattr(delivery, "connect", terminal.connect)
    return terminal


def away(_request: httpx2.Request) -> httpx2.Response:
    return httpx2.Response(503)


def present(_request: httpx2.Request) -> None:
    return None


def test_what_waits_is_listed_with_its_tries_and_the_last_answer(terminal: Terminal) -> None:
    assert "nothing is in the spool" in terminal("spool", "list")
    terminal.push(body(-1, "bad"), "bad.json", code=65)
    terminal.service.instead = of_run(b"", lambda: httpx2.Response(503))
    terminal.push(body(70000), code=75)
    terminal.push(body(7000), code=75)
    terminal.push(body(8000, "r2"), "other.json", code=75, clutch="c2")
    lines = terminal("spool", "list").splitlines()
    assert [line.split()[0] for line in lines if line.startswith("  ")] in (
        ["waiting", "refused", "replaced", "waiting"],
        ["waiting", "waiting", "refused", "replaced"],
    )
    text = "\n".join(lines)
    assert f"c1 at {URL}, in " in text
    assert "cycles: must not be negative" in text
    waiting, refused, replaced = (item for item in terminal.listed() if item["clutch_id"] == "c1")
    assert (waiting["run_id"], waiting["cycles"], waiting["tries"]) == (None, 7000, 1)
    assert waiting["files"] == [str(terminal.folder / "run.json")]
    assert "status 503" in waiting["last_answer"]
    assert (refused["run_id"], refused["problem"]["status"]) == ("bad", 422)
    assert (replaced["state"], replaced["cycles"]) == ("replaced", 70000)
    for item in (waiting, refused, replaced):
        assert Path(item["path"]).read_bytes().startswith(b"{")
    assert "c2" not in terminal("spool", "list", "--clutch", "c1")


def test_a_run_that_was_corrected_while_the_service_was_away_is_delivered_corrected(terminal: Terminal) -> None:
    """A version that may be stored is named: one try got no answer, whatever later ones did."""
    terminal.service.instead = away
    assert "1 run waits" in terminal.push(body(70000), code=75)
    output = terminal.push(body(7000), code=75)
    assert "; the old version is kept in " in output
    assert "may be stored" not in output
    for status in (504, 503):
        terminal.service.instead = of_run(b"", lambda status=status: httpx2.Response(status))
        terminal("spool", "send", "--url", URL, "--patience", "0", code=75)
    assert "the old version may be stored: if so, withdraw it" in terminal.push(body(700), code=75)
    terminal.service.instead = present
    assert "1 stored now, 0 stored before, 0 refused" in terminal("spool", "send", "--url", URL)
    assert list(terminal.service.stored.values()) == [body(700)]


def test_push_names_other_runs_that_wait_in_one_line(terminal: Terminal) -> None:
    terminal.push(body(-1), "bad.json", code=65)
    terminal.service.instead = away
    assert "refused" not in terminal.push(body(1), "1.json", code=75)  # it was said when it was refused
    terminal.push(body(2), "2.json", code=75)
    terminal.service.instead = present
    (line,) = (line for line in terminal.push(body(3), "3.json").splitlines() if "other runs" in line)
    assert line.startswith("2 other runs wait for c1 since ")
    assert line.endswith("and will be sent too: see clutchlife spool list")
    assert len(terminal.service.stored) == 3


def test_the_spool_is_emptied_after_a_question(terminal: Terminal) -> None:
    assert "nothing to delete" in terminal("spool", "empty")
    terminal.push(body(-1), "bad.json", code=65)
    terminal.service.instead = away
    terminal.push(body(1), "1.json", code=75)
    terminal.push(body(2), "2.json", code=75, clutch="c2")
    for answers in ("n\n", ""):
        output = terminal("spool", "empty", answers=answers, code=1)
        assert "Delete these 3 for good? 2 of them were never stored by the service." in output
        assert len(terminal.listed()) == 3
    assert "1 deleted; the service never stored 0 of them" in terminal("spool", "empty", "--refused", answers="y\n")
    assert [item["state"] for item in terminal.listed()] == ["waiting", "waiting"]
    output = terminal("spool", "empty", "--clutch", "c2", "--yes")
    assert "2.json" in output
    assert [item["clutch_id"] for item in terminal.listed()] == ["c1"]
    terminal("spool", "empty", "--yes")
    assert terminal.listed() == []
    assert list((terminal.folder / "spool").rglob("*.body")) == []


def test_the_spool_is_not_emptied_under_a_sender(terminal: Terminal) -> None:
    terminal.service.instead = away
    terminal.push(body(1), code=75)
    with Spool.of(terminal.folder / "spool", URL, "c1").sending(0.0):
        assert "another process is sending" in terminal("spool", "empty", "--yes", code=75)
        assert "another process is sending from the spool; 2 runs wait" in terminal.push(body(2), "2.json", code=75)
    assert len(terminal.listed()) == 2


def test_only_runs_for_the_address_are_sent_there(terminal: Terminal) -> None:
    terminal.service.instead = away
    terminal.push(body(1), "1.json", code=75)
    terminal.push(body(2), "2.json", code=75, clutch="c2")
    terminal.push(body(3), "3.json", code=75, url="http://other.test")
    terminal.service.instead, terminal.asked = present, []
    output = terminal("spool", "send", "--url", URL + "/", "--clutch", "c2")
    assert (list(terminal.service.stored.values()), "1 stored" in output) == ([body(2)], True)
    output = terminal("spool", "send", "--url", URL)
    assert "are not sent: they belong to c1 at http://other.test" in output
    assert sorted(terminal.service.stored.values()) == [body(1), body(2)]
    assert "http://other.test" not in terminal.asked
    assert "nothing waits for" in terminal("spool", "send", "--url", URL)


def test_refusals_end_the_command_as_data_errors_and_absence_as_a_failure_for_now(terminal: Terminal) -> None:
    terminal.service.instead = lambda _request: problem(401, "unauthorized", "a key [is] needed")
    assert "a key [is] needed; 1 run waits in" in terminal.push(body(1), code=65)
    terminal.service.instead = of_run(b"", lambda: httpx2.Response(500))
    assert "the service did not accept 1 run;" in terminal.push(body(1), code=75)
    terminal.service.instead = lambda _request: httpx2.Response(200, html="<p>log in</p>")
    assert "a login page or a proxy?" in terminal.push(body(1), code=75)
    assert len(terminal.listed()) == 1


def test_a_record_is_sent_with_the_name_of_its_rig_or_its_kind_and_cycles(terminal: Terminal) -> None:
    asked: list[httpx2.Request] = []
    terminal.service.instead = lambda request: asked.append(request)
    folder = terminal.folder / "records"
    folder.mkdir()
    for name in ("b_2000.csv", "a_1000.xlsx", "notes.pdf"):
        (folder / name).write_bytes(name.encode())
    terminal.push_files(folder, "--rig", "bench-3")
    sent = [request for request in asked if request.url.path.endswith("/runs/file")]
    named = sorted((request.url.params["filename"], request.url.params["rig"]) for request in sent)
    assert named == [("a_1000.xlsx", "bench-3"), ("b_2000.csv", "bench-3")]
    assert all("kind" not in request.url.params and "cycles" not in request.url.params for request in sent)
    asked.clear()
    terminal.push_files(folder / "b_2000.csv", "--rig", "bench-3", "--cycles", "7")
    sent = [request for request in asked if request.url.path.endswith("/runs/file")]
    assert [(request.url.params["rig"], request.url.params["cycles"]) for request in sent] == [("bench-3", "7.0")]
    assert "Give --kind and --cycles" in terminal.push(b"1,2", "a.csv", code=64)
