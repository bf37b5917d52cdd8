"""A row that was changed otherwise than by the program fails its checksum, whatever column it was."""

from dataclasses import replace

import pytest
import sqlalchemy as sa
from sqlalchemy import Connection

from storage import alarms, clutches, results
from storage.alarms import AlarmRow
from storage.engine.errors import DamagedData
from storage.results import FilterStateRow, PredictionRow
from storage.rows import allow_damage, amend, covered, findings, refuse_damaged, sealed
from storage.tables import CHECKSUM, alarm, clutch, metadata, prediction
from tests.storage.samples import CLUTCH, clutch_row, fit_row, store_run

SEALED = [table for table in metadata.sorted_tables if CHECKSUM in table.c]
ROW = PredictionRow(cycles=1.0, method="particle", pressure=0.0, payload={"a": 1}, code_version="1")


def test_what_is_stored_of_clutches_has_checksums_or_checks_of_its_own() -> None:
    own = {"channel", "photograph"}  # in their bytes, and by their names
    passing = {"job", "delivery", "access_key", "raw_store", "raw_removal", "inspection_photograph"}
    assert {table.name for table in metadata.sorted_tables} - own - passing == {table.name for table in SEALED}


@pytest.mark.parametrize("table", SEALED, ids=lambda table: table.name)
def test_any_column_that_changes_is_found(table: sa.Table) -> None:
    def value(kind: object) -> object:
        return b"a" if isinstance(kind, sa.LargeBinary) else "a" if isinstance(kind, sa.Text) else 1

    row = {column.name: value(column.type) for column in table.columns if column.name != CHECKSUM}
    refuse_damaged(table, sealed(table, row))
    for name, _ in covered(table):
        for other in (None, b"b" if row[name] == b"a" else "b" if row[name] == "a" else 2):
            with pytest.raises(DamagedData, match=f"{table.name} .* is not what was stored"):
                refuse_damaged(table, sealed(table, row) | {name: other})
    (key, *others) = table.primary_key
    given = not others and isinstance(key.type, sa.Integer)
    assert {name for name, _ in covered(table)} == row.keys() - ({key.name} if given else set())


def test_a_damaged_rule_or_receiver_keeps_no_run_out(connection: Connection) -> None:
    """They are read in the transaction that stores a run: verify alone names them."""
    rule = AlarmRow(alarm_id="a", clutch_id=None, enabled=True, content={"a": 1}, saved_at="", saved_by="")
    alarms.put(connection, rule)
    connection.execute(sa.update(alarm).values(content='{"a":2}'))
    assert alarms.enabled(connection) == [replace(rule, content={"a": 2})]
    assert len(findings(connection, alarm, sa.true())) == 1


def test_rows_written_and_changed_by_the_program_pass(connection: Connection) -> None:
    clutches.set_summary(connection, CLUTCH, 3.5, {"a": 1}, life="", state="check", if_disputed="other")
    clutches.bump_revision(connection, CLUTCH)
    run_key = store_run(connection, 0)
    results.write_fits(connection, run_key, [replace(fit_row(5e5), mse_percent=float("nan"))])
    results.put_predictions(connection, CLUTCH, [ROW, replace(ROW, cycles=2.0)])
    state = FilterStateRow(method="ukf", pressure=0.0, runs=1, arrays={}, code_version="1")
    results.put_filter_states(connection, CLUTCH, [state])
    assert [finding for table in SEALED for finding in findings(connection, table, sa.true())] == []


def test_a_damaged_row_is_neither_read_nor_changed_unless_damage_is_allowed(connection: Connection) -> None:
    results.put_predictions(connection, CLUTCH, [ROW])
    connection.execute(sa.update(prediction).values(payload='{"a":2}'))
    connection.execute(sa.update(clutch).where(clutch.c.clutch_id == CLUTCH).values(summary='{"at_least":'))
    assert len(findings(connection, prediction, sa.true())) == 1
    for read in (
        lambda: results.predictions_of(connection, CLUTCH, "particle", 0.0),
        lambda: clutches.get(connection, CLUTCH),
        lambda: amend(connection, prediction, [sa.true()], code_version="2"),
    ):
        with pytest.raises(DamagedData, match="is not what was stored"):
            read()
    listed = {row.clutch_id: list(row.summary) for row in clutches.page(connection, limit=None)}
    assert listed[CLUTCH] == ["damaged"], "a list names it"
    allow_damage(connection)
    assert results.predictions_of(connection, CLUTCH, "particle", 0.0)[0].payload == {"a": 2}
    assert clutches.get(connection, CLUTCH) == replace(clutch_row(), summary={})
    clutches.set_summary(connection, CLUTCH, 0.0, {}, life="", state="check", if_disputed="check")
    assert findings(connection, clutch, sa.true()) == [], "what is computed again has the right checksum"
