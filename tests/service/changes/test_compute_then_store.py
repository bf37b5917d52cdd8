"""Changes compute outside the write lock, and compute again where the clutch has changed before they store."""

import pickle
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import pytest
from sqlalchemy import text
from typer.testing import CliRunner

from service import repository
from service.answers import degradation
from service.api.clutch import ClutchIn
from service.changes import adopt_model, edit_clutch, ingest_run, learn_fleet
from service.changes.adopt_model import adopt, finish_and_adopt
from service.changes.ingest_run import ingest
from service.changes.run_diagnosis import ask
from service.cli.main import app
from service.clutch import analysis, model_correction, recomputation, tracking
from service.clutch.criteria import MAX_ATTEMPTS
from service.clutch.incoming_run import IncomingRun, name_run
from service.clutch.recomputation import Results
from storage import assumptions, clutches, jobs, results, runs
from storage.engine.database import Database
from storage.engine.sqlite.database import FileDatabase
from tests.service.changes.benches import AT, CLUTCH, EXTENSION, REPORT, Bench, body, overtaken, send_to
from tests.service.jobs.replaying import InThread, replay_clutch
from tests.storage.samples import read_from


def stored(database: Database) -> list[Any]:
    """Receipts and predictions as they are stored."""
    with database.reading() as connection:
        receipts = [row.receipt for row in runs.page(connection, CLUTCH)]
        return [receipts, [results.predictions_of(connection, CLUTCH, name, 0.0) for name in tracking.PREDICTED]]


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
        analysis.analyse, analysis.mean_cofs, analysis.levels_of, analysis.loops_of, tracking.advance,
        tracking.predict, recomputation.track, recomputation.computed_again, model_correction.corrected_cofs,
        learn_fleet.taught, learn_fleet.population,
    )  # fmt: skip
    for function in watched_functions:
        for module in [module for name, module in sys.modules.items() if name.startswith(("service.", "models."))]:
            if getattr(module, function.__name__, None) is function:
                monkeypatch.setattr(module, function.__name__, outside(function))
    return lambda: len(calls)


def test_nothing_is_computed_while_the_write_lock_is_held(bench: Bench, numerics: Callable[[], int]) -> None:
    bench.diagnose("d1", "")
    errands: list[Callable[[], Any]] = [
        *(partial(bench.send_tests, 1000.0 * number) for number in range(6)),
        lambda: bench.send_tests(500),  # late: everything again
        lambda: bench.adopt("d1"),
        lambda: bench.send_tests(6000),
        lambda: bench.adopt(None),
        lambda: replay_clutch(bench.database, CLUTCH),
        lambda: learn_fleet.refresh(bench.database, InThread(), now=AT),
    ]
    for errand in errands:
        before = numerics()
        errand()
        assert numerics() > before


def test_a_run_that_comes_while_another_is_computed_counts_for_it(
    benches: tuple[Bench, Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process stores a run between computing and storing: the results are those of both, in whatever order."""
    overtaken_by, calm = benches
    calm.send_tests(0, 1000, 2000)
    overtaken_by.send_tests(0)
    run = body("test", "a1000", 1000.0)
    calls = overtaken(monkeypatch, ingest_run, "_computed", overtaken_by.database, lambda other: send_to(other, run))
    overtaken_by.send_tests(2000)
    assert len(calls) == 3  # its own twice, the other's once
    assert stored(overtaken_by.database) == stored(calm.database)
    assert read_from(overtaken_by.database, clutches.revision, CLUTCH) == 3


def test_a_replay_beside_a_rig_that_never_rests_ends_and_says_why(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run comes whenever the clutch is computed again: it is left as it was, the others are replayed all the same."""
    edit_clutch.register(bench.database, ClutchIn(clutch_id="c2"), created_at=AT)
    bench.send_tests(0)
    attempts = []
    recomputed = repository.recomputed

    def recomputed_late(recorded: repository.Recorded) -> Results:
        made = recomputed(recorded)
        if recorded.state.clutch_id == CLUTCH:
            attempts.append(recorded.state.revision)
            bench.send_tests(1000.0 * len(attempts))
            assert len(attempts) < 10
        return made

    with monkeypatch.context() as busy:
        busy.setattr(repository, "recomputed", recomputed_late)
        replayed = CliRunner().invoke(app, ["replay", "--database", bench.database.url])
    assert len(attempts) == MAX_ATTEMPTS
    assert replayed.exit_code == 1
    assert "runs arrived during each of 3 attempts" in replayed.stderr
    assert "c2: 0 runs" in replayed.stdout
    assert replay_clutch(bench.database, CLUTCH) == 1 + MAX_ATTEMPTS


@pytest.mark.parametrize("meanwhile", ["cancelled", "claimed by another"])
def test_a_diagnosis_that_is_no_longer_the_claimer_s_is_not_adopted(bench: Bench, meanwhile: str) -> None:
    """It was cancelled, or a service that was taken for dead comes to its end after all; nothing of it comes into force."""
    database = bench.database
    bench.send_tests(0)
    diagnosis_id, _ = ask(database, CLUTCH, by="local", adopt=False, request="", most=1, created_at=AT)
    before = stored(database)
    with database.writing() as connection:
        assert jobs.claim(connection, "one", [jobs.DIAGNOSIS], at=AT) is not None
        if meanwhile == "cancelled":
            assert jobs.end(connection, diagnosis_id, jobs.CANCELLED, AT)
        else:
            left = jobs.holds(connection, [jobs.DIAGNOSIS])
            assert jobs.claim(connection, "two", [jobs.DIAGNOSIS], at=AT, abandoned=left) is not None
    ended = {"report": REPORT, "extension": EXTENSION}
    assert not finish_and_adopt(database, CLUTCH, diagnosis_id, ended, at=AT, claimer="one")
    with database.reading() as connection:
        assert assumptions.current_adoption(connection, CLUTCH) is None
        assert clutches.revision(connection, CLUTCH) == 1
    assert stored(database) == before


def test_an_adoption_that_is_asked_for_twice_at_once_makes_one_version(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.send_tests(0)
    bench.diagnose("d1", "")

    def adopt_it(opened: Database) -> None:
        adopt(opened, CLUTCH, "d1", adopted_at=AT)

    calls = overtaken(monkeypatch, adopt_model, "_computed", bench.database, adopt_it)
    adopt_it(bench.database)
    assert len(calls) == 3  # its own twice, the other's once
    with bench.database.reading() as connection:
        row = assumptions.current_adoption(connection, CLUTCH)
        assert row.version == 1
        assert clutches.revision(connection, CLUTCH) == 2


def test_a_run_that_would_carry_on_damaged_filters_has_the_life_tracked_again(bench: Bench) -> None:
    bench.send_tests(0, 1000)
    before = stored(bench.database)
    with bench.database.writing() as connection:
        connection.execute(text("UPDATE filter_state SET arrays = x'00'"))
    assert degradation.degradation(bench.database, CLUTCH).items
    assert replay_clutch(bench.database, CLUTCH) == 2
    assert stored(bench.database) == before
    bench.send_tests(2000)
    assert "a2000" in bench.receipts()


# --- The same run comes in more than once at a time: it is stored once, and every other answer is its receipt.


def oil_change() -> IncomingRun:
    details = {"event": "oil_change", "note": ""}
    return name_run(IncomingRun(kind="maintenance", cycles=5.0, run_id="oil", details=details))


def test_the_same_run_of_two_threads_is_stored_once(bench: Bench) -> None:
    with ThreadPoolExecutor(4) as pool:
        sent = pool.map(lambda _: ingest(bench.database, CLUTCH, oil_change(), received_at=AT), range(4))
    assert sorted(new for _, new in sent) == [False, False, False, True]


def test_a_run_that_another_process_stores_after_it_was_not_found_is_a_repeat(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is looked for twice, before and after its curves are fitted; it comes when it has just not been found again."""

    def store(other: Database) -> None:
        assert ingest(other, CLUTCH, oil_change(), received_at=AT)[1], "it is not new to the other"

    calls = overtaken(monkeypatch, runs, "get", bench.database, store, at=2)
    receipt, new = ingest(bench.database, CLUTCH, oil_change(), received_at=AT)
    assert (receipt.duplicate, new, calls[:2]) == (True, False, [None, None])
    assert read_from(bench.database, clutches.revision, CLUTCH) == 1


@pytest.mark.parametrize("whole", [True, False])
def test_a_stored_run_is_read_with_its_channels_and_described_without(bench: Bench, *, whole: bool) -> None:
    """What was loaded whole goes to another process, which has no database."""
    sent = body("test", "r0", 0.0)
    bench.send(sent)
    state = read_from(bench.database, repository.state, CLUTCH)
    recorded = repository.recorded(bench.database, state, whole=whole)
    if whole:
        recorded = pickle.loads(pickle.dumps(recorded))  # noqa: S301 - its own
    read = recorded.reader.read("r0")
    assert {name: column.tolist() for name, column in read.channels.items()} == sent["channels"]
    assert recorded.reader.describe("r0") == replace(read, channels={})
