"""A replay that is cancelled, or loses its service or its database, leaves whole clutches, and is made again."""

from contextlib import closing

import pytest

from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.service.clients import client_on
from tests.service.work.replaying import (
    CLUTCHES,
    WAIT,
    age,
    aged,
    ended,
    midway,
    stock,
    stored,
    until_none,
)
from tests.storage.engine.postgresql.server import postgresql_server
from tests.support import ONCE, Server, serving


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
