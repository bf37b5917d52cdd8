"""Replays and fleet refreshes as jobs: asked for, done in a process of their own, cancelled, killed and made again."""

from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text

from service.api.clutch import ClutchIn
from service.api.diagnosis import JobOut, JobPage
from service.changes import ask_job, learn_fleet
from service.changes.edit_clutch import register
from service.errors import BusyError
from service.jobs.change import MAX_REASONS, ChangeTask, done
from service.jobs.executor import Executor
from storage import jobs
from storage.encoding import Json
from storage.engine.database import Database
from storage.engine.opening import open_database
from storage.engine.sqlite.database import back_up
from storage.tables import fleet_prior
from tests.service.clients import client_on
from tests.service.jobs.replaying import (
    AT,
    CLUTCHES,
    WAIT,
    InThread,
    age,
    aged,
    ended,
    midway,
    stock,
    stored,
    until_none,
)
from tests.service.web.routes.granting import granted
from tests.storage.engine.postgresql.server import postgresql_server
from tests.support import ONCE, Server, serving

# --- Replays and fleet refreshes as jobs: asked for, done in a process of their own, and seen.

LIFE = "/v1/clutches/{}/remaining-useful-life"


def test_a_replay_stores_what_one_in_process_does(database: Database) -> None:
    expected = stock(database, 3)
    with client_on(database.url, job_lease_seconds=3600) as client:  # else it would be looked for every 3 s anyway
        before = client.get(LIFE.format("c0")).json()
        age(database)
        asked = client.post("/v1/jobs", json={"kind": "replay", "clutch_id": "c1"}, headers=WAIT)
        job = asked.json()
        JobOut.model_validate(job)
        assert (asked.status_code, asked.headers["Location"]) == (200, f"/v1/jobs/{job['job_id']}")
        assert asked.headers["Preference-Applied"] == "wait=120"
        assert (job["state"], job["clutch_id"], job["attempts"]) == ("finished", "c1", 1)
        assert job["progress"] == {"step": "replays the clutches", "done": 1, "of": 1}
        assert job["result"] == {"replayed": 1, "left": 0, "reasons": []}
        assert aged(database) == {"c0", "c2"}
        whole = client.post("/v1/jobs", json={"kind": "replay"}, headers=WAIT).json()
        assert (whole["state"], whole["result"]["replayed"]) == ("finished", 3)
        assert stored(database) == expected
        again = client.get(LIFE.format("c0")).json()
        assert again == before | {"revision": again["revision"]}
        assert again["revision"] == before["revision"] + 1, "others' numbers were shown meanwhile"
        listed = client.get("/v1/jobs").json()
        JobPage.model_validate(listed)
        assert listed["items"] == [whole, job]
        assert client.get(asked.headers["Location"]).json() == job


@pytest.mark.slow
def test_a_clutch_that_is_left_is_named_with_the_reason(in_file: Database, caplog: pytest.LogCaptureFixture) -> None:
    stock(in_file, 2)
    with in_file.writing() as connection:
        connection.execute(
            text(
                "UPDATE channel SET data = x'00' WHERE run_key = (SELECT min(run_key) FROM run WHERE clutch_id = 'c0')"
            )
        )
    age(in_file)
    with client_on(in_file.url) as client:
        job = client.post("/v1/jobs", json={"kind": "replay"}, headers=WAIT).json()
    result = job["result"]
    assert (job["state"], result["replayed"], result["left"]) == ("finished", 1, 1)
    assert [each["clutch_id"] for each in result["reasons"]] == ["c0"]
    assert result["reasons"][0]["reason"]
    assert aged(in_file) == {"c0"}
    said = [record.getMessage() for record in caplog.records if record.getMessage().startswith("replay ")]
    assert ["c0: left as it was" in line for line in said] == [True]


TASK = ChangeTask(function=f"{__name__}:leaving", of=None, at=AT, by="local", arguments={})


def leaving(
    database: Database, task: ChangeTask, *, say: Callable[[Json], None], executor: Executor
) -> tuple[dict[str, int], dict[str, str]]:
    """A change that leaves many clutches."""
    assert (database, task, type(executor)) == (None, TASK, InThread)
    say({"step": "leaves", "done": 1, "of": 2})
    say({"step": "leaves", "done": 2, "of": 2})
    return {"replayed": 3}, {f"c{number}": "why" for number in range(MAX_REASONS + 5)}


def test_the_result_has_few_reasons_and_the_log_all(capsys: pytest.CaptureFixture[str]) -> None:
    said: list[Json] = []
    ended = done(None, TASK, said.append, InThread())  # type: ignore[arg-type]  # the change reads nothing
    assert ended["progress"] == said[-1] == {"step": "leaves", "done": 2, "of": 2}
    assert (ended["result"]["replayed"], ended["result"]["left"]) == (3, MAX_REASONS + 5)
    assert ended["result"]["reasons"] == [{"clutch_id": f"c{n}", "reason": "why"} for n in range(MAX_REASONS)]
    assert len(capsys.readouterr().err.splitlines()) == MAX_REASONS + 5


@pytest.mark.slow
def test_a_fleet_refresh_stores_what_one_in_process_does(in_file: Database, tmp_path: Path) -> None:
    before = stock(in_file, 4, tests=6)
    back_up(in_file.url, tmp_path / "copy.db")
    with client_on(in_file.url) as client:
        job = client.post("/v1/jobs", json={"kind": "fleet_refresh"}, headers=WAIT).json()
        JobOut.model_validate(job)
        assert (job["state"], job["clutch_id"]) == ("finished", None)
        assert job["result"] == {"kinds": 1, "changed": 4, "left": 0, "reasons": []}
        assert job["progress"] == {"step": "updates their predictions", "done": 4, "of": 4}
        assert client.get("/v1/fleet/priors").json()["items"][0]["version"] == 1
        assert client.get(LIFE.format("c0")).json()["prior"]["name"] == "fleet"
        again = client.post("/v1/jobs", json={"kind": "fleet_refresh"}, headers=WAIT).json()
        assert again["result"] == {"kinds": 0, "changed": 0, "left": 0, "reasons": []}
    with closing(open_database(f"sqlite:///{tmp_path / 'copy.db'}")) as copy:
        assert stored(copy) == before != stored(in_file)
        learn_fleet.refresh(copy, InThread(), now=AT)
        assert (stored(copy), priors(copy)) == (stored(in_file), priors(in_file))


def priors(database: Database) -> list[Any]:
    with database.reading() as connection:
        rows = connection.execute(fleet_prior.select()).mappings()
        return sorted(repr({name: value for name, value in row.items() if name != "created_at"}) for row in rows)


def test_who_asks_twice_joins_and_too_many_are_sent_away(database: Database) -> None:
    for number in range(3):
        register(database, ClutchIn(clutch_id=f"c{number}"), created_at=AT)

    def ask(kind: str, clutch_id: str | None) -> str:
        return ask_job.ask(database, kind, clutch_id, by="local", request="", most=3, asked_at=AT).job_id

    first, other, whole = (ask(jobs.REPLAY, clutch_id) for clutch_id in ("c0", "c1", None))
    assert len({first, other, whole}) == 3
    assert [ask(jobs.REPLAY, clutch_id) for clutch_id in ("c0", "c1", None)] == [first, other, whole]
    with pytest.raises(BusyError, match="3 jobs of the kind replay already wait"):
        ask(jobs.REPLAY, "c2")
    assert ask(jobs.FLEET_REFRESH, None) not in {first, other, whole}
    with database.writing() as connection:
        jobs.end(connection, first, jobs.CANCELLED, AT)
    assert ask(jobs.REPLAY, "c2") not in {first, other, whole}


def test_what_is_asked_for_is_checked(in_file: Database) -> None:
    stock(in_file, 1, tests=1)
    with client_on(in_file.url, most_replays=1, job_lease_seconds=1) as client:
        for body, status in (
            ({"kind": "replay", "clutch_id": "unknown"}, 404),
            ({"kind": "fleet_refresh", "clutch_id": "c0"}, 422),
            ({"kind": "diagnosis", "clutch_id": "c0"}, 422),
            ({}, 422),
        ):
            assert client.post("/v1/jobs", json=body).status_code == status, body
        assert client.get("/v1/jobs").json()["items"] == []
        asked = client.post("/v1/jobs", json={"kind": "replay"})
        assert (asked.status_code, asked.json()["state"] in jobs.OPEN) == (202, True)
        assert asked.headers["Location"] == f"/v1/jobs/{asked.json()['job_id']}"
        away = client.post("/v1/jobs", json={"kind": "replay", "clutch_id": "c0"})
        assert (away.status_code, away.headers["Retry-After"]) == (503, "1")


def test_a_bound_key_has_its_own_clutches_replayed_and_no_others(in_file: Database) -> None:
    stock(in_file, 2, tests=1)
    with client_on(in_file.url) as client:
        bound = granted(client, "admin", clutches=["c1"])
        for body in ({"kind": "replay"}, {"kind": "fleet_refresh"}, {"kind": "replay", "clutch_id": "c0"}):
            assert client.post("/v1/jobs", json=body, headers=bound).status_code == 403, body
        narrow = granted(client, "ingest")
        assert client.post("/v1/jobs", json={"kind": "replay"}, headers=narrow).status_code == 403
        own = client.post("/v1/jobs", json={"kind": "replay", "clutch_id": "c1"}, headers={**bound, **WAIT}).json()
        assert (own["state"], own["result"]["replayed"]) == ("finished", 1)
        assert client.get("/v1/jobs", headers=bound).json()["items"] == [own]


# --- A replay that is cancelled, or loses its service or its database, leaves whole clutches, and is made again.


@pytest.mark.usefixtures("own_processes")
def test_a_cancelled_replay_leaves_whole_clutches(in_file: Database) -> None:
    expected = stock(in_file)
    age(in_file)
    with client_on(in_file.url, job_lease_seconds=1) as client:
        asked = client.post("/v1/jobs", json={"kind": "replay"}).json()["job_id"]
        midway(client.get, asked, in_file.url)
        cancelled = client.delete(f"/v1/jobs/{asked}").json()
        assert (cancelled["state"], cancelled["problem"]) == ("cancelled", "cancelled by local")
        assert cancelled["result"] is None
        until_none(in_file.url)
        assert 0 < len(aged(in_file)) < CLUTCHES
        again = client.post("/v1/jobs", json={"kind": "replay"}, headers=WAIT).json()
        assert (again["state"], again["job_id"] == asked) == ("finished", False)
    assert aged(in_file) == set()
    assert stored(in_file) == expected


@pytest.mark.slow
def test_the_replay_of_a_killed_service_is_made_again(database: Database) -> None:
    expected = stock(database)
    age(database)
    environment = {"CLUTCHLIFE_JOB_LEASE_SECONDS": "2"}
    address = database.url if database.path is None else database.path
    killed = Server(address, environment=environment)
    killed.start()
    asked = ONCE.post(f"{killed.url}/v1/jobs", json={"kind": "replay"}).json()["job_id"]
    midway(lambda path: ONCE.get(f"{killed.url}{path}"), asked, database.url)
    killed.kill()
    until_none(database.url)
    assert 0 < len(aged(database)) < CLUTCHES
    with serving(address, environment=environment) as server:
        job = ended(server, asked)
    assert (job["state"], job["attempts"], job["result"]["replayed"]) == ("finished", 2, CLUTCHES)
    assert aged(database) == set()
    assert stored(database) == expected


@pytest.mark.slow
def test_a_replay_is_made_again_where_postgresql_is_killed() -> None:
    with postgresql_server() as postgres:
        url = postgres.fresh()
        with closing(open_database(url)) as database:
            expected = stock(database)
            age(database)
        with serving(url, environment={"CLUTCHLIFE_JOB_LEASE_SECONDS": "2"}) as server:
            asked = ONCE.post(f"{server.url}/v1/jobs", json={"kind": "replay"}).json()["job_id"]
            midway(lambda path: ONCE.get(f"{server.url}{path}"), asked, database.url)
            postgres.kill()
            until_none(database.url)
            postgres.start()
            job = ended(server, asked)
        with closing(open_database(url)) as database:
            assert (job["state"], job["attempts"], job["result"]["replayed"]) == ("finished", 2, CLUTCHES), job
            assert aged(database) == set()
            assert stored(database) == expected
