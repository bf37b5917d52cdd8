"""Workflows compute outside the write lock, and compute again where the clutch has changed before they store."""

import pickle
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text
from typer.testing import CliRunner

from service import records, stored_runs
from service.cli.main import app
from service.lives import model_correction, recomputation, run_analysis, tracks
from service.lives.criteria import MAX_ATTEMPTS
from service.lives.incoming_run import IncomingRun, name_run
from service.queries import degradation
from service.queries.cache import to_json
from service.run_files.json_run import read_run
from service.schemas.clutch import ClutchIn
from service.workflows import adopt_model, edit_clutch, ingest_run, learn_fleet
from service.workflows.adopt_model import adopt, finish_and_adopt
from service.workflows.ingest_run import ingest
from service.workflows.replay import replay_clutch
from service.workflows.run_diagnosis import ask
from storage import assumptions, clutches, diagnoses, jobs, results, runs
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from storage.engine.opening import open_database
from storage.engine.sqlite.database import FileDatabase
from tests.service.workflows import stand_in_engine
from tests.service.workflows.benches import EXTENSION, REPORT, overtaken
from tests.support import stationary

AT = "2026-11-02T10:00:00+00:00"


@pytest.fixture
def database(in_file: Database) -> Database:
    """On a file alone: a database whose write lock the tests watch."""
    edit_clutch.register(in_file, ClutchIn(clutch_id="c1"), created_at=AT)
    return in_file


def post(database: Database, cycles: float, run_id: str | None = None) -> dict[str, Any]:
    body = to_json(stationary(cycles, run_id=run_id or f"r{cycles:g}"))
    return ingest(database, "c1", read_run(body), received_at=AT)[0]


def stored(database: Database) -> list[Any]:
    """Receipts and predictions as they are stored."""
    with database.reading() as connection:
        receipts = [row.receipt for row in runs.page(connection, "c1")]
        return [receipts, [results.predictions_of(connection, "c1", name, 0.0) for name in tracks.CARRIED]]


def asked_for(database: Database) -> str:
    """A diagnosis that is to be made; its id."""
    return ask(database, "c1", by="local", adopt=False, request="", most=1, created_at=AT)[0]


def diagnosed(database: Database) -> str:
    """A finished diagnosis with an extension that the stand-in applies; its id."""
    diagnosis_id = asked_for(database)
    with database.writing() as connection:
        diagnoses.finish(connection, diagnosis_id, AT, REPORT, EXTENSION)
    return diagnosis_id


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in_engine.apply(monkeypatch.setattr)


@pytest.fixture
def numerics(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """How often something was computed; computing while this process holds the write lock fails the test."""
    lock, calls = threading.local(), []
    writing = FileDatabase.writing

    @contextmanager
    def watched(self: FileDatabase, **of: Any) -> Iterator[Any]:
        with writing(self, **of) as connection:
            lock.held = True
            try:
                yield connection
            finally:
                lock.held = False

    monkeypatch.setattr(FileDatabase, "writing", watched)

    def outside(function: Callable[..., Any]) -> Callable[..., Any]:
        def called(*arguments: Any, **named: Any) -> Any:
            assert not getattr(lock, "held", False), f"{function.__name__} ran while the write lock was held"
            calls.append(function.__name__)
            return function(*arguments, **named)

        return called

    watched_functions = (
        run_analysis.analyse, run_analysis.mean_cofs, run_analysis.levels_of, run_analysis.loops_of, tracks.advance,
        tracks.predict, recomputation.track, recomputation.computed_again, model_correction.corrected_cofs,
        learn_fleet.taught, learn_fleet.population,
    )  # fmt: skip
    for function in watched_functions:
        for module in [module for name, module in sys.modules.items() if name.startswith(("service.", "models."))]:
            if getattr(module, function.__name__, None) is function:
                monkeypatch.setattr(module, function.__name__, outside(function))
    return lambda: len(calls)


@pytest.mark.usefixtures("stand_in")
def test_nothing_is_computed_while_the_write_lock_is_held(database: Database, numerics: Callable[[], int]) -> None:
    diagnosis_id = diagnosed(database)
    errands: list[Callable[[], Any]] = [
        *(partial(post, database, 1000.0 * number) for number in range(6)),
        lambda: post(database, 500.0),  # late: everything again
        lambda: adopt(database, "c1", diagnosis_id, adopted_at=AT),
        lambda: post(database, 6000.0),
        lambda: adopt(database, "c1", None, adopted_at=AT),
        lambda: replay_clutch(database, "c1"),
        lambda: learn_fleet.refresh(database, now=AT),
    ]
    for errand in errands:
        before = numerics()
        errand()
        assert numerics() > before


def test_a_run_that_comes_while_another_is_computed_counts_for_it(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process stores a run between computing and storing: the results are those of both, in whatever order."""
    post(database, 0.0)
    calls = overtaken(monkeypatch, ingest_run, "_computed", database, lambda other: post(other, 1000.0))
    post(database, 2000.0)
    assert len(calls) == 3  # its own twice, the other's once
    with closing(open_database(f"sqlite:///{tmp_path / 'calm.db'}")) as calm:
        edit_clutch.register(calm, ClutchIn(clutch_id="c1"), created_at=AT)
        for cycles in (0.0, 1000.0, 2000.0):
            post(calm, cycles)
        assert stored(database) == stored(calm)
    with database.reading() as connection:
        assert clutches.revision(connection, "c1") == 3


def test_a_replay_beside_a_rig_that_never_rests_ends_and_says_why(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run comes whenever the clutch is computed again: it is left as it was, the others are replayed all the same."""
    edit_clutch.register(database, ClutchIn(clutch_id="c2"), created_at=AT)
    post(database, 0.0)
    attempts = []
    recomputed = stored_runs.recomputed

    def recomputed_late(recorded: stored_runs.Recorded) -> stored_runs.Recomputed:
        made = recomputed(recorded)
        if recorded.state.clutch_id == "c1":
            attempts.append(post(database, 1000.0 * (len(attempts) + 1)))
            assert len(attempts) < 10
        return made

    with monkeypatch.context() as busy:
        busy.setattr(stored_runs, "recomputed", recomputed_late)
        replayed = CliRunner().invoke(app, ["replay", "--database", database.url])
    assert len(attempts) == MAX_ATTEMPTS
    assert replayed.exit_code == 1
    assert "runs arrived during each of 3 attempts" in replayed.stderr
    assert "c2: 0 runs" in replayed.stdout
    assert replay_clutch(database, "c1") == 1 + MAX_ATTEMPTS


@pytest.mark.usefixtures("stand_in")
@pytest.mark.parametrize("meanwhile", ["cancelled", "claimed by another"])
def test_a_diagnosis_that_is_no_longer_the_claimer_s_is_not_adopted(database: Database, meanwhile: str) -> None:
    """It was cancelled, or a service that was taken for dead comes to its end after all; nothing of it comes into force."""
    post(database, 0.0)
    diagnosis_id = asked_for(database)
    before = stored(database)
    with database.writing() as connection:
        assert jobs.claim(connection, "one", [jobs.DIAGNOSIS], lease=-1.0, at=AT) is not None
        if meanwhile == "cancelled":
            assert jobs.end(connection, diagnosis_id, jobs.CANCELLED, AT)
        else:
            assert jobs.claim(connection, "two", [jobs.DIAGNOSIS], lease=60.0, at=AT) is not None
    ended = {"report": REPORT, "extension": EXTENSION}
    assert not finish_and_adopt(database, "c1", diagnosis_id, ended, at=AT, claimer="one")
    with database.reading() as connection:
        assert assumptions.current_adoption(connection, "c1") is None
        assert clutches.revision(connection, "c1") == 1
    assert stored(database) == before


@pytest.mark.usefixtures("stand_in")
def test_an_adoption_that_is_asked_for_twice_at_once_makes_one_version(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    computed = adopt_model._computed

    def computed_late(*arguments: Any) -> Any:
        monkeypatch.setattr(adopt_model, "_computed", computed)
        adopt(database, "c1", diagnosis_id, adopted_at=AT)
        return computed(*arguments)

    post(database, 0.0)
    diagnosis_id = diagnosed(database)
    monkeypatch.setattr(adopt_model, "_computed", computed_late)
    adopt(database, "c1", diagnosis_id, adopted_at=AT)
    with database.reading() as connection:
        row = assumptions.current_adoption(connection, "c1")
        assert row is not None
        assert row.version == 1
        assert clutches.revision(connection, "c1") == 2


def test_only_a_run_that_carries_on_damaged_filters_is_stopped_by_them(database: Database) -> None:
    post(database, 0.0)
    post(database, 1000.0)
    before = stored(database)
    with database.writing() as connection:
        connection.execute(text("UPDATE filter_state SET arrays = x'00'"))
    with pytest.raises(DamagedData):
        post(database, 2000.0)
    assert degradation.degradation(database, "c1")["items"]
    assert replay_clutch(database, "c1") == 2
    assert stored(database) == before
    assert post(database, 2000.0)["run_id"] == "r2000"


# --- The same run comes in more than once at a time: it is stored once, and every other answer is its receipt.


def oil_change() -> IncomingRun:
    details = {"event": "oil_change", "note": ""}
    return name_run(IncomingRun(kind="maintenance", cycles=5.0, run_id="oil", details=details))


def test_the_same_run_of_two_threads_is_stored_once(database: Database) -> None:
    with ThreadPoolExecutor(4) as pool:
        sent = pool.map(lambda _: ingest(database, "c1", oil_change(), received_at=AT), range(4))
    assert sorted(new for _, new in sent) == [False, False, False, True]


def test_a_run_that_another_process_stores_after_it_was_not_found_is_a_repeat(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is looked for twice, before and after its curves are fitted; it comes when it has just not been found again."""

    def store(other: Database) -> None:
        assert ingest(other, "c1", oil_change(), received_at=AT)[1], "it is not new to the other"

    calls = overtaken(monkeypatch, runs, "get", database, store, at=2)
    receipt, new = ingest(database, "c1", oil_change(), received_at=AT)
    assert (receipt["duplicate"], new, calls[:2]) == (True, False, [None, None])
    with database.reading() as connection:
        assert clutches.revision(connection, "c1") == 1


@pytest.mark.parametrize("whole", [True, False])
def test_a_stored_run_is_read_with_its_channels_and_described_without(database: Database, *, whole: bool) -> None:
    """What was loaded whole goes to another process, which has no database."""
    sent = read_run(to_json(stationary(0, run_id="r0")))
    ingest(database, "c1", sent, received_at=AT)
    with database.reading() as connection:
        state = records.state(connection, "c1")
    recorded = stored_runs.recorded(database, state, whole=whole)
    if whole:
        recorded = pickle.loads(pickle.dumps(recorded))  # noqa: S301 - its own
    read = recorded.reader.read("r0")
    assert {name: column.tolist() for name, column in read.channels.items()} == {
        name: column.tolist() for name, column in sent.channels.items()
    }
    assert recorded.reader.describe("r0") == replace(read, channels={})
