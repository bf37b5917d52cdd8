"""A fleet's prior: learned from others only, named in every answer, refreshed by a command."""

import math
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from models.degradation.severity import Severity
from service import repository
from service.api.clutch import ClutchIn
from service.api.fleet import Kind
from service.changes import learn_fleet
from service.changes.edit_clutch import register
from service.changes.ingest_run import ingest
from service.cli.main import app
from service.clutch.assumptions import kind_of
from service.clutch.plausibility.doubts import Judged
from service.clutch.recomputation import ClutchHistory, Tracking
from service.jobs.change import ChangeTask
from service.jobs.queue import work_of_change
from service.runs.json_run import read_run
from service.settings import Settings
from storage import jobs
from storage.encoding import to_text
from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.service.clients import client_on, post_run
from tests.service.jobs.replaying import AT, InThread, replay_clutch, stock
from tests.storage.samples import read_from, write_to
from tests.support import stationary

LIFE = "/v1/clutches/{}/remaining-useful-life"
SPEEDS = tuple(range(20, 1971, 150))


def wear(cycles: float, scale: float) -> float:
    return float(0.9 * (1 - (1 + cycles / scale) ** -0.9))


def measured(run_id: str, cycles: float, share: float) -> dict[str, Any]:
    return stationary(cycles, wear=share, speeds=SPEEDS, pressures=(5.0,), run_id=run_id)


def post(client: TestClient, name: str, scale: float, last: int = 9000, **record: str) -> None:
    """A clutch with a test every 1000 cycles."""
    assert client.post("/v1/clutches", json={"clutch_id": name, **record}).status_code == 201
    for cycles in range(0, last + 1, 1000):
        noise = 0.002 * math.sin(37.0 * cycles + scale)
        post_run(client, measured(f"{name}-{cycles}", cycles, wear(cycles, scale) + noise), name)


def post_fleet(client: TestClient, last: int = 6000) -> None:
    for number, scale in enumerate((5000.0, 6000.0, 7000.0)):
        post(client, f"old-{number}", scale, last=last)


def life(client: TestClient, name: str, **query: Any) -> Any:
    return client.get(LIFE.format(name), params=query).json()


@pytest.fixture
def url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path / 'fleet.db'}"


def width(said: dict[str, dict[str, float | None]]) -> float:
    low, high = (said["end_of_life_cycles"][q] for q in ("0.1", "0.9"))
    return math.log((1e6 if high is None else high) / (1e6 if low is None else low))


def refresh(url: str, advance: Callable[[], object] = lambda: None) -> learn_fleet.Refreshed:
    with closing(open_database(url)) as database:
        return learn_fleet.refresh(database, InThread(), now="2026-01-01T00:00:00+00:00", advance=advance)


def test_a_fleet_teaches_the_next_clutch_and_nobody_itself(url: str) -> None:
    with client_on(url) as client:
        post_fleet(client, last=9000)
        post(client, "new", 6000.0, last=2000)
        post(client, "other", 6000.0, last=2000, friction_material="sinter")
        before = {name: life(client, name) for name in ("new", "other", "old-0")}
        assert all(said["prior"] == {"name": "weak", "version": None, "clutches": 0} for said in before.values())
        refresh(url)
        # with three in all, two are left for each of them: no fleet
        assert (life(client, "new")["prior"]["clutches"], life(client, "old-0")["prior"]["name"]) == (3, "weak")
        post(client, "old-3", 6500.0)
        done = refresh(url)
        assert [kind.friction_material for kind in done.kinds] == ["paper"]
        assert set(done.changed) == {"old-0", "old-1", "old-2", "old-3", "new"}
        after = {name: life(client, name) for name in before}
        assert after["new"]["prior"] == {"name": "fleet", "version": 2, "clutches": 4}
        assert after["old-0"]["prior"] == {"name": "fleet", "version": 2, "clutches": 3}
        assert after["other"] == before["other"]
        assert after["new"]["revision"] == before["new"]["revision"] + 2
        assert width(after["new"]) < 0.9 * width(before["new"])
        item = client.get("/v1/fleet/priors").json()["items"][0]
        assert (item["version"], item["clutches"]) == (2, 4)
        assert item["members"] == ["old-0", "old-1", "old-2", "old-3"]
        assert -1.0 < item["population"]["change"]["median"] < -0.5
        assert "scale_cycles_median" in client.get("/v1/fleet/priors.csv").text
        said = client.get(LIFE.format("new"))
        again = refresh(url)  # which learns nothing new, and changes nothing
        assert (again.changed, again.kinds) == ((), ())
        assert client.get(LIFE.format("new"), headers={"If-None-Match": said.headers["etag"]}).status_code == 304


def accelerating(cycles: float, end: float) -> float:
    """The wear of a course that no eq. 6 can take: half is gone at its end."""
    return 0.5 * (cycles / end) ** 3


@pytest.mark.slow
def test_lives_that_ended_calibrate_the_next(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """They accelerate, and forecasts of such lives are late at first: the next is stated to end where the others did."""
    monkeypatch.setattr("service.changes.ingest_run.doubts_together", lambda *_, **__: Judged())
    ends = {"old-0": 8_000.0, "old-1": 8_600.0, "old-2": 9_100.0, "old-3": 9_800.0, "new": 8_900.0}
    with client_on(url) as client:
        for name, end in ends.items():
            assert client.post("/v1/clutches", json={"clutch_id": name}).status_code == 201
            last = 4_500 if name == "new" else 750 * math.ceil(1.15 * end / 750)
            energy = {"cycles": 750, "energy_per_cycle_kj": 20.0 * 9_000.0 / end}
            for cycles in range(0, last + 1, 750):
                share = accelerating(cycles, end) + 0.002 * math.sin(37.0 * cycles + end)
                body = measured(f"{name}-{cycles}", cycles, share)
                duty = {"kind": "duty_cycles", "cycles": cycles, "duty": energy, "run_id": f"{name}-d{cycles}"}
                for run in (body, duty) if cycles else (body,):
                    assert client.post(f"/v1/clutches/{name}/runs", json=run).json()["state"] == "accepted"
        before = life(client, "new")
        refresh(url)
        after = life(client, "new")
        assert (before["ended_lives"], after["ended_lives"]) == (0, 4)
        low, middle, high = (after["end_of_life_cycles"][q] for q in ("0.05", "0.5", "0.95"))
        assert low < ends["new"] < high
        # nearer to the truth than its own tests alone say, and within the spread of the others' ends
        assert abs(middle - ends["new"]) < abs(before["end_of_life_cycles"]["0.5"] - ends["new"])
        assert 8_000.0 < middle < 9_800.0
        assert width(after) < 0.3 * width(before)
        # of the first no life is known to have ended that is as old as it
        assert life(client, "old-0")["ended_lives"] == 0
        assert life(client, "new", at_cycles=2_000)["ended_lives"] == 4
        item = client.get("/v1/fleet/priors").json()["items"][0]
        assert item["ended_lives"] == 4
        assert item["severity_exponent"]["value"] == pytest.approx(1.0, abs=0.15)
        planned = client.post(f"{LIFE.format('new')}/forecast", json={"programme": [{"cycles": 100}]}).json()
        assert planned["ended_lives"] == 4
        assert planned["remaining_cycles"]["0.5"] == pytest.approx(after["remaining_cycles"]["0.5"], rel=1e-3)


@pytest.mark.slow
def test_an_end_has_its_own_kind_learn_and_goes_before_the_rest_of_another(
    in_file: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four clutches of a kind, of which one has ended, and one of another kind, which ends while the four are tracked."""
    stock(in_file, 4, tests=6)
    other = ClutchIn(clutch_id="other", friction_material="sinter")
    register(in_file, other, created_at=AT)
    taught: list[str] = []

    def lessons_of(state: ClutchHistory) -> tuple[Kind, list[learn_fleet.Lesson]]:
        taught.append(state.clutch_id)
        return _lessons_of(state)

    _lessons_of = learn_fleet.lessons_of
    monkeypatch.setattr(learn_fleet, "lessons_of", lessons_of)

    def declare(clutch_id: str) -> None:
        end = {"kind": "maintenance", "event": "end_of_life", "cycles": 6000}
        ingest(in_file, clutch_id, read_run(to_text(end).encode()), received_at=AT)

    def do_next() -> tuple[dict[str, int], dict[str, str]]:
        job = write_to(in_file, jobs.claim, "here", [jobs.FLEET_REFRESH], at=AT)
        task = ChangeTask(**work_of_change("f")(job, Settings()).task)
        done = learn_fleet.as_job(in_file, task, say=lambda _: None, executor=InThread())
        write_to(in_file, jobs.end, job.job_id, jobs.FINISHED, AT)
        return done

    declare("c3")
    with in_file.writing() as connection:
        for _ in range(2):
            repository.ask_fleet_refresh(connection, kind_of(other, Severity()), by="local", at=AT)
        assert len(jobs.open_of(connection, jobs.FLEET_REFRESH)) == 2
    done, left = do_next()
    assert sorted(taught) == ["c0", "c1", "c2", "c3"]
    assert (done, left) == ({"kinds": 1, "changed": 1}, dict.fromkeys(("c1", "c2", "c3"), learn_fleet.GAVE_WAY))
    assert do_next() == ({"kinds": 0, "changed": 0}, {})
    assert taught[4:] == ["other"]
    assert do_next() == ({"kinds": 0, "changed": 3}, {})
    assert len(taught) == 5
    assert read_from(in_file, jobs.open_of, jobs.FLEET_REFRESH) == []


@pytest.mark.slow
def test_a_refresh_that_read_before_another_stored_does_not_undo_it(url: str) -> None:
    with client_on(url) as client:
        post_fleet(client)
        read = []

        def another_is_quicker() -> None:
            read.append(len(read))
            if len(read) == 3:  # all three have taught, nothing is stored
                post(client, "old-3", 8000.0, last=6000)
                assert len(refresh(url).kinds) == 1

        refresh(url, another_is_quicker)
        (prior,) = client.get("/v1/fleet/priors").json()["items"]
        assert (prior["version"], prior["clutches"]) == (1, 4)


@pytest.mark.slow
def test_posting_on_and_tracking_anew_agree_under_a_fleets_prior(tmp_path: Path) -> None:
    """One step on from stored states, and all of it again (a test that comes late), give the same answer."""
    answers = []
    for order in ((0, 1, 2, 3, 4), (0, 4, 2, 1, 3)):
        url = f"sqlite:///{tmp_path / str(order[1])}.db"
        with client_on(url) as client:
            post_fleet(client)
            refresh(url)
            client.post("/v1/clutches", json={"clutch_id": "new"})
            for index in order:
                body = measured(f"t{index}", 1000 * index, wear(1000 * index, 6000.0))
                receipt = client.post("/v1/clutches/new/runs", json=body).json()
                if receipt["state"] == "held":  # a quarter of the COF gone since the only test before
                    assert client.post(f"/v1/clutches/new/runs/t{index}/confirm", json={}).status_code == 200
            answers.append(life(client, "new", method="ukf"))
            del answers[-1]["revision"]  # that of a confirmed run is one more
    assert answers[0]["prior"]["name"] == "fleet"
    assert answers[0] == answers[1]


@pytest.mark.slow
def test_a_run_that_comes_before_its_clutch_is_brought_up_is_tracked_under_the_prior_of_those_before_it(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fleet has learned, and a run is quicker than the refresh: what is stored is what a replay gives."""
    with client_on(url) as client:
        post_fleet(client)
        post(client, "new", 6000.0, last=3000)
        with monkeypatch.context() as slow:
            slow.setattr(repository, "replace_results", lambda *_: False)
            assert "new" in refresh(url).left
        post_run(client, measured("next", 4000, wear(4000, 6000.0)), "new")
        assert life(client, "new")["prior"]["name"] == "weak"
        assert "new" in refresh(url).changed
        assert life(client, "new")["prior"]["name"] == "fleet"
    with closing(open_database(url)) as database:
        before = read_from(database, repository.answers, "new")
        replay_clutch(database, "new")
        assert read_from(database, repository.answers, "new") == before


@pytest.mark.slow
def test_a_clutch_that_gets_a_run_whenever_it_is_tracked_anew_is_left_to_the_next_refresh(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with client_on(url) as client:
        post_fleet(client, last=5000)
        post(client, "live", 6000.0, last=1000)
        attempts = []
        track = learn_fleet.track

        def track_while_a_run_comes(state: ClutchHistory) -> Tracking:
            if state.clutch_id == "live":
                attempts.append(state.revision)
                post_run(
                    client, stationary(1000 + 100 * len(attempts), speeds=SPEEDS, run_id=f"r{len(attempts)}"), "live"
                )
                assert len(attempts) < 10
            return track(state)

        with monkeypatch.context() as busy:
            busy.setattr(learn_fleet, "track", track_while_a_run_comes)
            printed = CliRunner().invoke(app, ["fleet", "refresh", "--database", url]).stdout
        assert len(attempts) == 3
        assert "live: not updated, because runs arrived" in printed
        assert "live: predictions updated" not in printed
        done = refresh(url)
        assert ("live" in done.changed, done.left) == (True, {})
