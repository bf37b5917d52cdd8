"""Filter states that are kept in memory are carried on to what the stored ones give."""

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from storage import results
from storage.engine.database import HISTORIES, STATES, Database
from storage.engine.opening import open_database
from tests.service.changes.benches import CLUTCH, Bench, body, send_to


def stored(database: Database) -> tuple[object, dict[str, np.ndarray]]:
    """The stored predictions, and the arrays of the filter states."""
    with database.reading() as connection:
        predictions = [results.predictions_of(connection, CLUTCH, method, 0.0) for method in ("particle", "ukf")]
        ((_, row),) = results.filter_states_of(connection, CLUTCH).items()
    return predictions, row.arrays


def test_kept_states_give_what_stored_ones_give(tmp_path: Path, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """One process takes in all tests; of the other life each test is taken in by a process that has kept nothing."""
    runs = [body("test", f"t{k}", 500.0 * k) for k in range(9)]
    for run in runs[:6]:
        send_to(bench.database, run)
    copy = tmp_path / "copy.db"
    with closing(sqlite3.connect(copy)) as target, closing(sqlite3.connect(str(bench.database.path))) as source:
        source.backup(target)
    for run in runs[6:]:
        with closing(open_database(f"sqlite:///{copy}")) as fresh:
            send_to(fresh, run)
    monkeypatch.setattr(results, "filter_states_of", lambda *_: pytest.fail("the stored states were read"))
    for run in runs[6:]:
        send_to(bench.database, run)
    monkeypatch.undo()
    with closing(open_database(f"sqlite:///{copy}")) as fresh:
        (predictions, arrays), (wanted, wanted_arrays) = stored(bench.database), stored(fresh)
    assert predictions == wanted
    assert arrays.keys() == wanted_arrays.keys()
    assert all(np.array_equal(arrays[name], wanted_arrays[name]) for name in arrays)


def test_states_of_an_earlier_revision_are_not_carried_on(bench: Bench) -> None:
    """A test is corrected, which tracks the life again: what was kept of the life as it was is not used."""
    for number in range(1, 7):
        send_to(bench.database, body("test", f"t{number}", 500.0 * number))
    before = bench.database.kept[STATES].get(CLUTCH)
    sizes = [bench.database.kept[what]._bytes for what in (HISTORIES, STATES)]
    assert 6 * 1_500 < sizes[0] < 100_000 < sizes[1] < 1_000_000
    bench.correct("t6", 3_400.0)
    send_to(bench.database, body("test", "t7", 4_000.0))
    after = bench.database.kept[STATES].get(CLUTCH)
    assert before.revision < after.revision - 1
    progress = after.filters["particle"].states["weak"].history.progress
    assert progress.tolist() == [500.0, 1_000.0, 1_500.0, 2_000.0, 2_500.0, 3_400.0, 4_000.0]
