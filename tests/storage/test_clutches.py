"""Clutches: each function against a real database; lists filtered, searched, counted, and walked while ranks change."""

from dataclasses import replace
from math import nan

import pytest
from sqlalchemy import Connection
from sqlalchemy.exc import IntegrityError

from storage import alarms, clutches, runs
from storage.alarms import EventRow
from storage.clutches import ByNeed, ClutchSelection, Counts
from storage.engine.database import Database
from tests.storage.samples import CLUTCH, clutch_row, new_run, read_from, write_to

#: No state comes before another.
BY_RANK = ByNeed(states=[], over=100.0)
NAMED = {"life": "", "state": "normal", "if_disputed": "normal"}


def test_what_needs_somebody_comes_first_and_pages_join_without_gap_or_repeat(database: Database) -> None:
    """By state, then by a raised alarm, an ended life last; among equals by rank, then by name."""
    listed = {
        "a": ("normal", 0.5), "b": ("normal", -1.0), "c": ("normal", 0.5), "d": ("failure", 99.0), "e": ("check", 0.25),
        "f": ("failure", 100.0), "g": ("failure", 3.0), "h": ("normal", 7.0), "i": ("normal", 8.0), "j": ("check", 1.0),
    }  # fmt: skip
    with database.writing() as connection:
        for clutch_id, (state, rank) in listed.items():
            clutches.insert(connection, replace(clutch_row(clutch_id, rank=rank), state=state))
        for clutch_id in ("h", "i", "j", "g"):
            event = EventRow(
                event_id=clutch_id,
                alarm_id="a",
                clutch_id=clutch_id,
                quantity="health",
                mark="",
                content={},
                raised_at="",
            )
            alarms.insert_event(connection, event)
        alarms.acknowledge(connection, "i", at="2026-01-01", by="me", note="")
        order = ByNeed(states=["failure", "check"], over=100.0)
        seen: list[str] = []
        while page := clutches.page(connection, limit=3, left_out=len(seen), by_need=order):
            seen += [row.clutch_id for row in page]
        assert "".join(seen) == "gdejhbacif"
        assert clutches.all_ids(connection) == [*"abcdefghij"]


def test_archived_clutches_are_listed_apart(connection: Connection) -> None:
    content = {"record": {"fluid": "new"}, "content_sha256": "cd", "registered": {"fluid": "old"}}
    clutches.set_record(connection, CLUTCH, **content, archived=True)
    assert [row.clutch_id for row in clutches.page(connection, limit=9)] == ["other"]
    (row,) = clutches.page(connection, ClutchSelection(archived=True), limit=9)
    assert (row.clutch_id, row.record, row.registered) == (CLUTCH, {"fluid": "new"}, {"fluid": "old"})
    assert clutches.page(connection, ClutchSelection(archived=True), limit=9, after=CLUTCH) == []


def test_a_clutch_comes_back_as_it_was_stored_once_and_its_summary_and_revision_change(connection: Connection) -> None:
    assert clutches.get(connection, CLUTCH) == clutch_row()
    assert clutches.get(connection, "unknown") is None
    with pytest.raises(IntegrityError), connection.begin_nested():
        clutches.insert(connection, clutch_row())
    clutches.set_summary(connection, CLUTCH, 0.2, {"health": 0.2}, **NAMED)
    assert [clutches.bump_revision(connection, CLUTCH) for _ in range(3)] == [1, 2, 3]
    assert clutches.get(connection, CLUTCH) == replace(
        clutch_row(), rank=0.2, summary={"health": 0.2}, revision=3, state="normal"
    )
    assert clutches.get(connection, "other") == clutch_row("other")
    with pytest.raises(ValueError, match="not JSON compliant"):
        clutches.set_summary(connection, CLUTCH, 0.5, {"health": nan}, **NAMED)


def test_an_unknown_clutch_is_named(connection: Connection) -> None:
    for change in (
        lambda: clutches.set_summary(connection, "nobody", 0.0, {}, **NAMED),
        lambda: clutches.bump_revision(connection, "nobody"),
        lambda: clutches.set_record(connection, "nobody", record={}, content_sha256="", registered=None, archived=True),
        lambda: clutches.set_disputed(connection, "nobody", None, state="normal"),
    ):
        with pytest.raises(LookupError, match="'nobody'"):
            change()


#: id -> rank, state, material, fluid, archived
FLEET = {
    "A-1": (3.0, "normal", "Papier", "ÖL 100%", False),
    "a-2": (1.0, "failure", "carbon", "ATF_1", False),
    "b-3": (2.0, "normal", "carbon", "ATF/1", False),
    "c-4": (9.0, "check", "paper", "ATF", False),
    "gone": (0.5, "normal", "carbon", "ATF", True),
}

IN_USE = ClutchSelection()


@pytest.fixture
def fleet(database: Database) -> Database:
    with database.writing() as connection:
        for clutch_id, (rank, state, material, fluid, archived) in FLEET.items():
            record = {"clutch_id": clutch_id, "friction_material": material, "fluid": fluid}
            row = replace(clutch_row(clutch_id, rank=rank), record=record, state=state, archived=archived)
            clutches.insert(connection, row)
        for clutch_id, state in (("b-3", "held"), ("gone", "held"), ("a-2", "withdrawn")):
            runs.insert(connection, replace(new_run(1, clutch_id=clutch_id), state=state))
        runs.insert(connection, replace(new_run(2, clutch_id="b-3"), state="held"))
    return database


def ids(database: Database, choice: ClutchSelection = IN_USE, *, by_need: ByNeed | None = BY_RANK) -> list[str]:
    return [row.clutch_id for row in read_from(database, clutches.page, choice, limit=9, by_need=by_need)]


@pytest.mark.parametrize(
    ("choice", "worst_first"),
    [
        (ClutchSelection(), ["a-2", "b-3", "A-1", "c-4"]),
        (ClutchSelection(archived=True), ["gone"]),
        (ClutchSelection(state="normal"), ["b-3", "A-1"]),
        (ClutchSelection(state="maintenance"), []),
        (ClutchSelection(held=True), ["b-3"]),
        (ClutchSelection(held=True, archived=True), ["gone"]),
        (ClutchSelection(held=True, state="failure"), []),
        (ClutchSelection(only={"A-1", "c-4", "gone"}), ["A-1", "c-4"]),
        (ClutchSelection(find="a-"), ["a-2", "A-1"]),
        (ClutchSelection(find="CARBON"), ["a-2", "b-3"]),
        (ClutchSelection(find="öl 100%"), ["A-1"]),
        (ClutchSelection(find="%"), ["A-1"]),
        (ClutchSelection(find="f_1"), ["a-2"]),
        (ClutchSelection(find="F/1"), ["b-3"]),
        (ClutchSelection(find="\\"), []),
        (ClutchSelection(find="carbon", state="normal", only={"b-3", "c-4"}), ["b-3"]),
    ],
)
def test_a_choice_is_listed_and_counted(fleet: Database, choice: ClutchSelection, worst_first: list[str]) -> None:
    assert ids(fleet, choice) == worst_first
    assert ids(fleet, choice, by_need=None) == sorted(worst_first)
    counts = read_from(fleet, clutches.counts, choice)
    states = [FLEET[clutch_id][1] for clutch_id in worst_first]
    held = [clutch_id for clutch_id in worst_first if clutch_id in ("b-3", "gone")]
    assert counts == Counts(states={state: states.count(state) for state in set(states)}, held=len(held))


def test_a_walk_by_name_meets_each_clutch_once_while_ranks_change_and_one_by_need_does_not(fleet: Database) -> None:
    def walked(by_name: bool) -> list[str]:
        seen: list[str] = []
        for _ in range(6):
            with fleet.writing() as connection:
                place = {"after": seen[-1] if seen else ""} if by_name else {"left_out": len(seen), "by_need": BY_RANK}
                page = clutches.page(connection, limit=1, **place)
                if not page:
                    break
                seen.append(page[0].clutch_id)
                # the clutch that was seen falls behind all others, and the last of the list comes to its front
                clutches.set_summary(connection, page[0].clutch_id, 20.0 + len(seen), {}, **NAMED)
                clutches.set_summary(connection, "c-4", -float(len(seen)), {}, **NAMED)
        return seen

    shown = walked(by_name=False)
    assert len(shown) > len(set(shown))
    assert "c-4" not in shown
    assert walked(by_name=True) == ["A-1", "a-2", "b-3", "c-4"]


def test_a_part_of_a_list_the_clutch_at_a_share_of_the_ranks_and_what_an_edit_changes(fleet: Database) -> None:
    whole = ids(fleet)
    with fleet.reading() as connection:
        for left_out in range(5):
            part = clutches.page(connection, limit=2, left_out=left_out, by_need=BY_RANK)
            assert [row.clutch_id for row in part] == whole[left_out : left_out + 2]

        def at(share: float, choice: ClutchSelection = IN_USE, below: float = 9.0) -> str | None:
            row = clutches.at_rank(connection, choice, share, below=below)
            return None if row is None else row.clutch_id

        assert [at(0.0), at(0.5), at(0.9), at(1.0)] == ["a-2", "b-3", "b-3", "A-1"]
        assert at(1.0, below=100.0) == "c-4"
        assert at(0.9, ClutchSelection(only=())) is None
    content = {"record": {"friction_material": "sintered"}, "content_sha256": "cd", "registered": None}
    write_to(fleet, clutches.set_record, "c-4", **content, archived=False)
    assert (ids(fleet, ClutchSelection(find="SINTER")), ids(fleet, ClutchSelection(find="paper"))) == (["c-4"], [])


def test_a_dispute_counts_in_its_life(connection: Connection) -> None:
    def summarised(life: str) -> str:
        disputed = "out_of_specification"
        clutches.set_summary(connection, CLUTCH, 1.0, {}, life=life, state="normal", if_disputed=disputed)
        row = clutches.get(connection, CLUTCH)
        return row.state

    assert summarised("") == "normal"
    clutches.set_disputed(connection, CLUTCH, "rebuilt", state="normal")
    states = [summarised(life) for life in ("", "rebuilt", "rebuilt-again")]
    assert states == ["normal", "out_of_specification", "normal"]


_NAMES = "SELECT clutch_id FROM clutch WHERE archived = 0"


@pytest.mark.parametrize(
    ("question", "index"),
    [
        (f"{_NAMES} ORDER BY rank, clutch_id", "clutch_worst_first (archived=?)"),
        (
            f"{_NAMES} AND (rank, clutch_id) > (1.0, 'a') ORDER BY rank, clutch_id",
            "clutch_worst_first (archived=? AND (rank,clutch_id)>(?,?))",
        ),
        (f"{_NAMES} AND state = 'check' ORDER BY rank, clutch_id", "clutch_by_state (archived=? AND state=?)"),
        ("SELECT state, count(*) FROM clutch WHERE archived = 0 GROUP BY state", "clutch_by_state (archived=?)"),
    ],
)
def test_an_index_alone_answers(in_file: Database, question: str, index: str) -> None:
    """What is asked of 10,000 clutches reads none of their records, and sorts nothing."""
    with in_file.reading() as connection:
        plan = [row.detail for row in connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {question}")]
    assert plan == [f"SEARCH clutch USING COVERING INDEX {index}"]
