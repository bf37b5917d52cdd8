"""The clock is set back while the service runs; the client is killed while the service comes and goes: nothing is lost."""

import json
import random
import subprocess
import sys
import time
from datetime import datetime, timedelta, tzinfo
from pathlib import Path
from typing import Any

import pytest

from service.clutch.plausibility.doubts import Judged
from tests.journeys.faults.test_kills import bits, findings, kills, numbered, stored
from tests.service.changes.benches import CLUTCH, body
from tests.service.clients import client_on
from tests.service.jobs.waiting import until
from tests.service.web.routes.granting import granted, revoke_all
from tests.support import serving

HOUR, DAY = timedelta(hours=1), timedelta(days=1)
BASE = f"/v1/clutches/{CLUTCH}"
#: Runs, and how far the clock is off when each comes in: it goes on, is set back by a year and by another, and then past
#: where it was. The rig does not say when the last four were made: at equal cycles the order of arrival holds, a rebuild
#: ends the life of the test that was sent before it and begins that of the test after it, whatever they are called.
SENT: tuple[tuple[timedelta, dict[str, Any]], ...] = (
    (timedelta(), body("test", "a", 0.0)),
    (30 * DAY, body("test", "b", 1000.0)),
    (30 * DAY + HOUR, body("test", "z", 2000.0) | {"started_at": None}),
    (-365 * DAY, body("rebuild", "y", 2000.0) | {"started_at": None}),
    (-730 * DAY, body("test", "x", 2000.0, wear=0.0) | {"started_at": None}),
    (60 * DAY, body("test", "w", 3000.0, wear=0.1) | {"started_at": None}),
)
#: Of an answer, what says when something happened.
TIMES = ("received_at", "created_at", "at", "time")


class Clock(datetime):
    """A clock that is off."""

    off = timedelta()

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> datetime:  # type: ignore[override]
        """The time by this clock."""
        return datetime.now(tz) + cls.off


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> type[Clock]:
    """What every module of the service in this process reads; and no run is doubted."""
    readers = [
        module
        for name, module in sys.modules.items()
        if name.partition(".")[0] in ("service", "storage") and getattr(module, "datetime", None) is datetime
    ]
    assert {"service.web.responses", "service.web.auth"} <= {module.__name__ for module in readers}
    for module in readers:
        monkeypatch.setattr(module, "datetime", Clock)
    for change in ("ingest_run", "change_run"):
        monkeypatch.setattr(f"service.changes.{change}.doubts_together", lambda *_, **__: Judged())
    monkeypatch.setattr(Clock, "off", timedelta())
    return Clock


def served(path: Path, clock: type[Clock], *, jumps: bool) -> dict[str, Any]:
    """Everything that a service answers of what was sent and changed while its clock jumped, or did not."""
    revisions, moments = [], []
    with client_on(f"sqlite:///{path}") as client:
        client.post("/v1/clutches", json={"clutch_id": CLUTCH})
        for off, run in SENT:
            clock.off = off if jumps else timedelta()
            answer = client.post(f"{BASE}/runs", json=run)
            assert (answer.status_code, answer.json()["state"]) == (201, "accepted")
            moments.append(answer.json()["received_at"])
            revisions.append(client.get(f"{BASE}/remaining-useful-life").json()["revision"])
        for number, change in enumerate(("withdraw", "restore")):
            clock.off = -number * DAY if jumps else timedelta()
            assert client.post(f"{BASE}/runs/b/{change}", json={"reason": "x"}).status_code == 200
        again = client.post(f"{BASE}/runs", json=SENT[0][1])
        assert (again.status_code, again.json()["received_at"]) == (200, moments[0])
        names = ("", "/runs", "/changes", "/remaining-useful-life", "/degradation", "/stribeck", "/series", "/scores")
        answers = {name: client.get(f"{BASE}{name}").json(object_hook=timeless) for name in names}
    assert (moments == sorted(moments)) is not jumps, "the clock did not do what was asked of it"
    return answers | {"revisions": revisions}


def timeless(answer: dict[str, Any]) -> dict[str, Any]:
    """An object of an answer without what says when something happened."""
    return {name: value for name, value in answer.items() if name not in TIMES}


def test_a_clock_that_is_set_back_changes_no_answer_and_loses_no_run(tmp_path: Path, clock: type[Clock]) -> None:
    ours = served(tmp_path / "set-back.db", clock, jumps=True)
    theirs = served(tmp_path / "right.db", clock, jumps=False)
    assert [name for name in theirs if ours[name] != theirs[name]] == []
    assert ours["revisions"] == sorted(set(ours["revisions"]))
    assert [change["action"] for change in ours["/changes"]["items"]] == ["restore", "withdraw"]
    assert ours["/remaining-useful-life"]["runs_used"] == 2  # of the life since the rebuild
    content = stored(tmp_path / "set-back.db")
    assert len(content) == len(SENT)
    assert content == stored(tmp_path / "right.db")
    assert findings(tmp_path / "set-back.db") == []


def test_a_key_expires_by_the_clock_and_one_that_is_revoked_stays_so(tmp_path: Path, clock: type[Clock]) -> None:
    """Set back past its end, the clock lets an expired key in again; nothing does that for a revoked one."""
    with client_on(f"sqlite:///{tmp_path / 'a.db'}") as client:
        lasting, short = granted(client), granted(client, days=1)

        def statuses(off: timedelta) -> list[int]:
            clock.off = off
            return [client.get("/v1/clutches", headers=headers).status_code for headers in (lasting, short, {})]

        assert statuses(timedelta()) == [200, 200, 401]
        assert statuses(2 * DAY) == [200, 401, 401]
        assert statuses(-365 * DAY) == [200, 200, 401]
        revoke_all(client)
        for off in (timedelta(), 2 * DAY, -3650 * DAY):
            assert statuses(off) == [401, 401, 401]


#: For each kill so many runs, that they last: until a kill is made, the service takes in some of them.
RUNS_PER_KILL = 6


@pytest.mark.slow
@kills(4, 50)
def test_what_a_client_that_is_killed_sends_to_a_service_that_comes_and_goes_arrives(
    tmp_path: Path, number: int
) -> None:
    """`push` of a folder is started again after each kill, as a rig's shift would: every run is there once, bit for bit."""
    rng = random.Random(number)  # noqa: S311 - moments, not secrets
    folder, path = tmp_path / "runs", tmp_path / "clutchlife.db"
    folder.mkdir()
    sent = {}
    for index in range(RUNS_PER_KILL * number):
        (folder / f"{index:03}.json").write_text(json.dumps(numbered(index)))
        sent[CLUTCH, f"r{index}"] = bits(numbered(index))
    amid = 0
    with serving(path, loaded=True) as server:
        push = [sys.executable, "-m", "service.cli.main", "push", str(folder), "--clutch", CLUTCH, "--url", server.url]
        push += ["--spool", str(tmp_path / "spool"), "--patience", "60"]
        server.http.post("/v1/clutches", json={"clutch_id": CLUTCH})

        def there() -> int:
            return int(server.http.get(f"{BASE}").json()["runs"])

        for kill in range(number):
            before = there()
            client = subprocess.Popen(push, stdout=subprocess.DEVNULL)
            try:
                until(lambda: there() != before or client.poll() is not None)  # noqa: B023  (called at once)
                time.sleep(rng.uniform(0.0, 0.05))
                if kill % 2:
                    server.kill()
                    time.sleep(rng.uniform(0.0, 0.5))
            finally:
                client.kill()
                client.wait()
            if kill % 2:
                server.start()
            amid += before < there() < len(sent)
        assert amid >= number / 2, f"{amid} of {number} kills came while runs were sent"
        done = subprocess.run(push, capture_output=True, text=True, check=False)
        assert (done.returncode, "0 refused" in done.stdout) == (0, True), done.stdout + done.stderr
        page = server.http.get(f"{BASE}/runs", params={"limit": 1000}).json()
        assert [item["run_id"] for item in page["items"]] == [f"r{index}" for index in range(len(sent))]
    assert stored(path) == sent
    assert findings(path) == []
