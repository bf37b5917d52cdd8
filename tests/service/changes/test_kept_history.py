"""A history that is kept in memory is the one that the database gives, whoever changed it."""

from contextlib import closing
from dataclasses import fields

import pytest

from service import kept_history, repository
from service.kept_history import KeptHistory
from storage import clutches, runs
from storage.engine.database import Database, Kept
from storage.engine.opening import open_database
from tests.service.changes.benches import CLUTCH, Bench, body, send_to


def kept(database: Database) -> tuple[KeptHistory, dict[str, object]]:
    """The history and the fits as a reading transaction finds them."""
    with database.reading() as connection:
        row = repository.clutch(connection, CLUTCH)
        return kept_history.history(connection, row), dict(repository.levels(connection, CLUTCH))


def require_kept_as_stored(*databases: Database) -> None:
    """What each has kept is what a transaction reads that knows of nothing kept."""
    with databases[0].writing() as connection:
        stored = kept_history.history(connection, repository.clutch(connection, CLUTCH))
        levels = repository.levels(connection, CLUTCH)
    for database in databases:
        history, own_levels = kept(database)
        for field in fields(KeptHistory):
            assert getattr(history, field.name) == getattr(stored, field.name), field.name
        assert own_levels.keys() == levels.keys()
        assert str(own_levels) == str({name: levels[name] for name in own_levels})


@pytest.mark.slow
def test_runs_and_changes_of_any_kind_are_seen_by_every_process(bench: Bench) -> None:
    """The second database stands for another process: it never stores, and looks after every step or after several."""
    with closing(open_database(bench.database.url)) as other, closing(open_database(bench.database.url)) as late:
        kept(late)
        sent = [
            body("test", "t1", 1_000),
            body("duty", "d1", 2_000),
            body("test", "t2", 3_000),
            body("loop", "l1", 3_000),
            body("test", "t3", 4_000, odd=True),
            body("oil_change", "o1", 4_500),
            body("test", "t4", 5_000),
            body("test", "late", 3_500),
            body("rebuild", "r1", 6_000),
            body("test", "t5", 7_000),
        ]
        for run in sent:
            send_to(bench.database, run)
            require_kept_as_stored(bench.database, other)
        require_kept_as_stored(late)
        bench.confirm("t3")
        require_kept_as_stored(bench.database, other)
        bench.withdraw("t2")
        send_to(bench.database, body("test", "t6", 8_000))
        require_kept_as_stored(bench.database, other, late)
        bench.correct("t6", 8_500.0)
        bench.restore("t2")
        require_kept_as_stored(bench.database, other, late)


def test_a_run_that_was_appended_is_all_that_is_read(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(1, 4):
        send_to(bench.database, body("test", f"t{number}", 1_000 * number))
    before, fits = kept(bench.database)
    send_to(bench.database, body("test", "t4", 4_000))
    monkeypatch.setattr(runs, "in_history", lambda *_: pytest.fail("all runs were read again"))
    after, more_fits = kept(bench.database)
    assert all(one is other for one, other in zip(before.events, after.events, strict=False))
    assert [event.run_id for event in after.events] == ["t1", "t2", "t3", "t4"]
    assert all(more_fits[name] is fits[name] for name in fits)


def test_what_a_transaction_has_changed_and_rolled_back_is_not_kept(bench: Bench) -> None:
    send_to(bench.database, body("test", "t1", 1_000))
    kept(bench.database)

    def changed_in_vain() -> None:
        with bench.database.writing() as connection:
            clutches.bump_revision(connection, CLUTCH)
            repository.events(connection, CLUTCH)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        changed_in_vain()
    send_to(bench.database, body("test", "t2", 2_000))
    require_kept_as_stored(bench.database)


def test_what_is_kept_is_bounded_in_bytes_and_forgets_what_was_used_least() -> None:
    values = Kept(100)
    for name in ("a", "b", "c"):
        values.put(name, name, 40)
        values.get("a")
    assert [values.get(name) for name in ("a", "b", "c")] == ["a", None, "c"]
    values.put("a", "larger", 101)
    assert values.get("a") is None
    assert values.get("c") == "c"
