"""Clutches: each function against a real database."""

from dataclasses import replace
from math import nan

import pytest
from sqlalchemy.exc import IntegrityError

from storage import clutches
from storage.clutches import Choice
from storage.engine.database import Database
from tests.storage.samples import clutch_row

CLUTCH = "bench3-017"


def test_a_clutch_comes_back_as_it_was_stored(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
    with database.reading() as connection:
        assert clutches.get(connection, CLUTCH) == clutch_row()
        assert clutches.get(connection, "unknown") is None


def test_a_clutch_id_is_taken_once_and_summaries_are_json(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
    with pytest.raises(IntegrityError), database.writing() as connection:
        clutches.insert(connection, clutch_row())
    with pytest.raises(ValueError, match="not JSON compliant"), database.writing() as connection:
        clutches.set_summary(connection, CLUTCH, 0.5, {"health": nan}, life="", state="check", if_disputed="check")


def test_lists_are_worst_first_and_pages_join_without_gap_or_repeat(database: Database) -> None:
    ranks = {"a": 0.5, "b": -1.0, "c": 0.5, "d": float("inf"), "e": 0.25}
    with database.writing() as connection:
        for clutch_id, rank in ranks.items():
            clutches.insert(connection, clutch_row(clutch_id, rank=rank))
    with database.reading() as connection:
        seen: list[str] = []
        after = None
        while page := clutches.page(connection, limit=2, after=after):
            seen += [row.clutch_id for row in page]
            after = (page[-1].rank, page[-1].clutch_id)
        assert seen == ["b", "e", "a", "c", "d"]
        assert clutches.all_ids(connection) == ["a", "b", "c", "d", "e"]


def test_archived_clutches_are_listed_apart(database: Database) -> None:
    with database.writing() as connection:
        for clutch_id in ("a", "b"):
            clutches.insert(connection, clutch_row(clutch_id))
        content = {"record": {"fluid": "new"}, "content_sha256": "cd", "registered": {"fluid": "old"}}
        clutches.set_record(connection, "a", **content, archived=True)
        with pytest.raises(LookupError, match="'nobody'"):
            clutches.set_record(connection, "nobody", **content, archived=True)
    with database.reading() as connection:
        assert [row.clutch_id for row in clutches.page(connection, limit=9)] == ["b"]
        (row,) = clutches.page(connection, Choice(archived=True), limit=9)
        assert (row.clutch_id, row.record, row.registered) == ("a", {"fluid": "new"}, {"fluid": "old"})
        assert clutches.page(connection, Choice(archived=True), limit=9, after=(row.rank, "a")) == []


def test_summary_and_revision(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        clutches.insert(connection, clutch_row("other"))
        clutches.set_summary(connection, CLUTCH, 0.2, {"health": 0.2}, life="", state="check", if_disputed="check")
        assert [clutches.bump_revision(connection, CLUTCH) for _ in range(3)] == [1, 2, 3]
    with database.reading() as connection:
        assert clutches.get(connection, CLUTCH) == replace(clutch_row(), rank=0.2, summary={"health": 0.2}, revision=3)
        assert clutches.get(connection, "other") == clutch_row("other")


def test_an_unknown_clutch_is_named(database: Database) -> None:
    with database.writing() as connection:
        with pytest.raises(LookupError, match="'nobody'"):
            clutches.set_summary(connection, "nobody", 0.0, {}, life="", state="check", if_disputed="check")
        with pytest.raises(LookupError, match="'nobody'"):
            clutches.bump_revision(connection, "nobody")
