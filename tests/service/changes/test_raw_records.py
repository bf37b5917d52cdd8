"""Raw records beside the database: never lost, whoever ends in the middle; what nothing names is collected, nothing else."""

import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import delete

from service import repository
from service.changes import raw_records
from storage import clutches, raw_columns, runs
from storage.blobs import raw_stores
from storage.blobs.stores import DATABASE, FolderStore, open_store
from storage.engine.database import Database
from storage.engine.errors import DamagedData, DatabaseBusy, RawStoreUnavailable
from storage.engine.opening import open_database
from storage.raw_columns import Encoded
from storage.tables import channel
from tests.journeys.faults.test_kills import killed_after
from tests.storage.samples import clutch_row, columns, new_run, read_from

LENGTH = 20_000
GRACE = 3600.0


def put(database: Database, number: int) -> Encoded:
    """A run's columns, on their way into the database."""
    return repository.placed(database, raw_columns.encoded(columns(number, LENGTH)))


def name(database: Database, number: int, encoded: Encoded) -> int:
    """The run itself."""
    with database.writing() as connection:
        if clutches.get(connection, "bench3-017") is None:
            clutches.insert(connection, clutch_row())
        run_key = runs.insert(connection, new_run(number))
        raw_columns.write(connection, run_key, encoded)
    return run_key


def store(database: Database, *numbers: int) -> dict[int, int]:
    """number -> run_key of runs."""
    return {number: name(database, number, put(database, number)) for number in numbers}


def all_there(database: Database, keys: dict[int, int]) -> bool:
    """Whether runs are as they were sent, bit for bit."""
    with database.reading() as connection:
        held = {number: raw_columns.stored_of_run(connection, key) for number, key in keys.items()}
    return all(
        np.array_equal(raw_columns.values_of(held[number])[name_], values)
        for number in keys
        for name_, values in columns(number, LENGTH).items()
    )


def collect(database: Database, *, later: float = 0.0) -> raw_records.Collected:
    """The collection of the one store, as so many seconds from now."""
    (collected,) = raw_records.collect(database, grace=GRACE, now=time.time() + later)
    return collected


def crash(*_: object) -> None:
    raise KeyboardInterrupt


def test_what_no_run_names_is_removed_after_the_grace_period_and_nothing_else(
    database: Database, raw_address: str
) -> None:
    raw_records.use(database, raw_address)
    keys = store(database, 1, 2)
    on_its_way = put(database, 3)
    found = collect(database)
    assert (found.named, found.new, found.removed) == (6, 3, 0)
    # it was slow, and nothing of it is lost; that two runs name it, of which one does no longer, keeps it
    former, keys[3] = name(database, 5, on_its_way), name(database, 3, on_its_way)
    with database.writing() as connection:
        connection.execute(delete(channel).where(channel.c.run_key == former))
    put(database, 4)  # its service ended before the row
    found = collect(database, later=2 * GRACE)
    assert (found.named, found.new, found.removed) == (9, 0, 3)
    assert all_there(database, keys)
    assert collect(database, later=2 * GRACE).removed == 0


def test_a_run_whose_blobs_are_removed_meanwhile_is_refused_not_lost(database: Database, raw_address: str) -> None:
    """The same content as that of an old orphan: it is put while the collection is about to remove it."""
    raw_records.use(database, raw_address)
    put(database, 1)
    again = put(database, 1)
    assert collect(database, later=2 * GRACE).removed == 3
    with pytest.raises(DatabaseBusy, match="try again"):
        name(database, 1, again)
    assert read_from(database, runs.count) == 0
    assert all_there(database, store(database, 1))  # sent again, put again


def test_a_removal_that_is_still_going_on_refuses_runs_that_begin_after_it(
    database: Database, in_folder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    raw_records.use(database, in_folder)
    put(database, 1)
    with monkeypatch.context() as cut_off:
        cut_off.setattr(FolderStore, "delete", crash)
        with pytest.raises(KeyboardInterrupt):
            collect(database, later=2 * GRACE)
    with pytest.raises(DatabaseBusy):
        name(database, 1, put(database, 1))
    collect(database, later=4 * GRACE)  # takes up what the former one left
    assert all_there(database, store(database, 1))


def test_columns_move_between_places_and_back_bit_for_bit(database: Database, in_folder: str, in_bucket: str) -> None:
    """The first move is cut off, loses nothing and goes on."""
    keys = store(database, 1, 2)  # in the database, as an earlier release left them

    def stop(count: int) -> None:
        if count == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        raw_records.move(database, in_folder, tell=stop)
    assert all_there(database, keys)
    for place, moved in ((in_folder, 2), (in_bucket, 6), (DATABASE, 6)):
        assert raw_records.move(database, place, tell=lambda _: None) == moved
        assert all_there(database, keys)
        assert read_from(database, raw_stores.numbers) == ({} if place == DATABASE else {place: (6, 6)})
        assert raw_records.move(database, place, tell=lambda _: None) == 0
    found = raw_records.collect(database, grace=GRACE, now=time.time() + 2 * GRACE)
    assert [(each.address, each.removed) for each in found] == [(in_folder, 6), (in_bucket, 6)]
    assert all_there(database, keys)


def test_what_is_damaged_is_not_moved(database: Database, in_folder: str, in_bucket: str) -> None:
    raw_records.use(database, in_folder)
    store(database, 1)
    (blob, _), *_ = open_store(in_folder).names()
    open_store(in_folder).put(blob, b"damaged")
    with pytest.raises(DamagedData, match=blob):
        raw_records.move(database, in_bucket, tell=lambda _: None)
    assert not open_store(in_bucket).exists(blob)


def test_a_store_belongs_to_one_database(database: Database, tmp_path: Path, raw_address: str) -> None:
    raw_records.use(database, raw_address)
    keys = store(database, 1)
    with closing(open_database(f"sqlite:///{tmp_path}/other.db")) as other:
        with pytest.raises(ValueError, match="another database"):
            raw_records.use(other, raw_address)
        assert raw_records.collect(other, grace=0.0, now=time.time() + GRACE) == []
    open_store(raw_address).set_mark("of somebody else")
    with pytest.raises(ValueError, match="is not marked as this database's"):
        collect(database, later=2 * GRACE)
    assert all_there(database, keys)


def test_a_start_that_is_cut_off_between_row_and_mark_can_be_repeated(
    database: Database, in_folder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as cut_off:
        cut_off.setattr(FolderStore, "set_mark", crash)
        with pytest.raises(KeyboardInterrupt):
            raw_records.use(database, in_folder)
    raw_records.use(database, in_folder)
    raw_records.use(database, in_folder)
    assert all_there(database, store(database, 1))
    raw_records.use(database, DATABASE)
    assert read_from(database, raw_stores.in_use) is None


def test_a_store_that_was_copied_is_found_at_its_new_address(
    database: Database, tmp_path: Path, in_folder: str
) -> None:
    raw_records.use(database, in_folder)
    keys = store(database, 1)
    on_its_way = put(database, 2)
    to = f"folder://{tmp_path}/moved"
    with pytest.raises(RawStoreUnavailable):
        raw_records.relocate(database, in_folder, to)
    Path(in_folder.removeprefix("folder://")).rename(tmp_path / "moved")
    assert raw_records.relocate(database, in_folder, to) == 3
    assert all_there(database, keys)
    with pytest.raises(DatabaseBusy):  # it was put at the former address
        name(database, 2, on_its_way)
    with pytest.raises(ValueError, match="known are"):
        raw_records.relocate(database, in_folder, to)


def test_kills_between_blob_and_row_lose_no_run_and_leave_only_what_is_collected(
    tmp_path: Path, in_folder: str
) -> None:
    url = f"sqlite:///{tmp_path}/kills.db"
    with closing(open_database(url)) as opened:
        raw_records.use(opened, in_folder)
        keys = store(opened, 0)

    def ingest(number: int) -> None:
        with closing(open_database(url)) as own:
            name(own, number, put(own, number))

    begin = time.perf_counter()
    ingest(1)
    longest = time.perf_counter() - begin
    ended = [killed_after(longest * number / 8, lambda number=number: ingest(2 + number)) for number in range(12)]
    with closing(open_database(url)) as again:
        known = read_from(again, runs.keys, "bench3-017")
        keys |= {number: known[f"run-{number:04d}"] for number in range(1, 14) if f"run-{number:04d}" in known}
        assert all(2 + number in keys for number, whole in enumerate(ended) if whole)
        assert all_there(again, keys)
        collect(again, later=2 * GRACE)
        assert all_there(again, keys)
        left = {blob for blob, _ in open_store(in_folder).names()}
        with again.reading() as connection:
            (used,) = raw_stores.all_of(connection)
            assert raw_stores.named(connection, used.store_key, left) == left
