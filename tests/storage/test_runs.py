"""Runs, in order and by state, in either kind of database."""

from dataclasses import asdict, replace

import pytest
from sqlalchemy import Connection, text
from sqlalchemy.exc import IntegrityError

from storage import runs
from storage.engine.database import Database
from storage.tables import run
from tests.storage.samples import CLUTCH, new_run


def test_a_run_comes_back_as_it_was_stored_belongs_to_a_clutch_and_has_an_id_of_its_own(connection: Connection) -> None:
    keys = [runs.insert(connection, new_run(number)) for number in range(2)]
    for number, key in enumerate(keys):
        stored = runs.get(connection, CLUTCH, f"run-{number:04d}")
        assert asdict(stored) == {**asdict(new_run(number)), "run_key": key}
    assert runs.get(connection, CLUTCH, "unknown") is None
    assert runs.get(connection, "unknown", "run-0000") is None
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), connection.begin_nested():
        runs.insert(connection, new_run(clutch_id="nobody"))
    with pytest.raises(IntegrityError, match=r"(?i)unique"), connection.begin_nested():
        runs.insert(connection, new_run())


def test_runs_are_in_order_of_cycles_then_id_whatever_order_they_came_in(connection: Connection) -> None:
    arrived = [(3, 500.0), (1, 500.0), (2, 0.0), (0, 7000.5), (4, 500.0)]
    for number, cycles in arrived:
        runs.insert(connection, new_run(number, cycles=cycles))
        runs.insert(connection, new_run(number, cycles=cycles, clutch_id="other"))
    expected = [f"run-{number:04d}" for number in (2, 1, 3, 4, 0)]
    light = runs.in_order(connection, CLUTCH)
    assert [row.run_id for row in light] == expected
    assert (light[0].lowest_speed, light[0].highest_speed, light[0].event) == (None, None, None)
    assert light[-1].cycles == 7000.5
    seen: list[str] = []
    after = None
    while page := runs.page(connection, CLUTCH, limit=2, after=after):
        seen += [row.run_id for row in page]
        after = (page[-1].cycles, page[-1].run_id)
    assert seen == expected
    assert runs.in_order(connection, "unknown") == []


def test_runs_of_one_kind_and_without_a_limit(connection: Connection) -> None:
    for number in range(6):
        kind = "duty_cycles" if number % 2 else "stationary_stribeck"
        runs.insert(connection, replace(new_run(number), kind=kind))
    assert len(runs.page(connection, CLUTCH)) == 6
    first, second = runs.page(connection, CLUTCH, kind="duty_cycles", limit=2)
    assert (first.run_id, second.run_id) == ("run-0001", "run-0003")
    (last,) = runs.page(connection, CLUTCH, kind="duty_cycles", after=(second.cycles, second.run_id))
    assert last.run_id == "run-0005"
    assert runs.page(connection, CLUTCH, kind="maintenance") == []


def test_only_accepted_runs_are_part_of_the_history_and_a_rebuild_that_is_held_is_none(connection: Connection) -> None:
    held = replace(new_run(1), state=runs.HELD, doubts=[{"code": "odd"}])
    keys = [runs.insert(connection, row) for row in (new_run(0), held, new_run(2))]
    runs.set_state(connection, keys[2], state=runs.WITHDRAWN, cycles=7.0, sent_cycles=2000.0, doubts=())
    assert [row.run_id for row in runs.in_order(connection, CLUTCH)] == ["run-0000"]
    assert [row.run_id for row in runs.set_aside(connection, CLUTCH)] == ["run-0002", "run-0001"]
    assert runs.keys(connection, CLUTCH) == {f"run-000{number}": key for number, key in enumerate(keys)}
    (found,) = runs.page(connection, CLUTCH, state=runs.HELD)
    assert (found.state, found.doubts, found.sent_cycles) == ("held", ({"code": "odd"},), None)
    withdrawn = runs.get(connection, CLUTCH, "run-0002")
    assert (withdrawn.state, withdrawn.cycles, withdrawn.sent_cycles) == ("withdrawn", 7.0, 2000.0)
    assert len(runs.page(connection, CLUTCH)) == 3
    rebuild = replace(new_run(3), kind="maintenance", details={"event": "rebuild"})
    runs.insert(connection, rebuild)
    runs.insert(connection, replace(rebuild, run_id="held", state=runs.HELD))
    assert [row.run_id for row in runs.rebuilds(connection, CLUTCH)] == ["run-0003"]


def test_a_receipt_is_replaced_and_an_unknown_run_is_named(connection: Connection) -> None:
    key = runs.insert(connection, new_run())
    runs.insert(connection, new_run(1))
    runs.set_results(connection, key, {"origin": "measured"}, {"mean_cof": 0.134}, "0.2.0")
    changed, other = runs.page(connection, CLUTCH, limit=9)
    assert changed.details == {"origin": "measured"}
    assert (changed.receipt, changed.code_version) == ({"mean_cof": 0.134}, "0.2.0")
    assert (other.receipt, other.code_version) == (new_run(1).receipt, "0.1.0")
    with pytest.raises(LookupError, match="run 99"):
        runs.set_results(connection, 99, {}, {}, "0.1.0")
    with pytest.raises(LookupError, match="run 99"):
        runs.set_state(connection, 99, state=runs.HELD, cycles=0.0, sent_cycles=None, doubts=())


def test_held_runs_are_counted_by_clutch_and_in_all(connection: Connection) -> None:
    assert runs.held(connection, [CLUTCH, "other"]) == {}
    for number, state in enumerate(["accepted", "held", "withdrawn", "held"]):
        runs.insert(connection, replace(new_run(number), state=state))
    runs.insert(connection, replace(new_run(9), clutch_id="other", state="withdrawn"))
    assert runs.held(connection, [CLUTCH, "other"]) == {CLUTCH: 2}
    assert (runs.count_held(connection), runs.count(connection)) == (2, 5)


def test_held_runs_are_counted_from_an_index_of_their_own(in_file: Database) -> None:
    held = runs._held.where(run.c.clutch_id.in_([CLUTCH])).compile(compile_kwargs={"literal_binds": True})
    with in_file.reading() as connection:
        (step,) = [row.detail for row in connection.execute(text(f"EXPLAIN QUERY PLAN {held}"))]
    assert "INDEX run_held" in step
