"""The raw channels of runs, in either database and in each kind of store beside it."""

import numpy as np
import pytest
from numpy.typing import NDArray
from sqlalchemy import Connection
from sqlalchemy.exc import IntegrityError

from service import repository
from service.changes import raw_records
from storage import clutches, raw_columns, runs
from storage.blobs import raw_stores
from storage.blobs.stores import DATABASE, open_store
from storage.encoding import LONG
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from tests.storage.samples import clutch_row, columns, new_run, read_from


def test_channels_keep_their_order_and_their_bits_and_are_written_once(connection: Connection) -> None:
    sent = {"time_s": np.array([0.0, -0.0, 5e-324, 1e308]), **columns(1, 5000), "empty": np.zeros(0)}
    key, bare = (runs.insert(connection, new_run(number)) for number in range(2))
    raw_columns.write(connection, key, raw_columns.encoded(sent))
    raw_columns.write(connection, bare, raw_columns.encoded({}))
    back = raw_columns.values_of(raw_columns.stored_of_run(connection, key))
    assert list(back) == list(sent) == list(raw_columns.lengths(connection, key))
    assert all(back[name].tobytes() == column.tobytes() for name, column in sent.items())
    assert (
        raw_columns.values_of(raw_columns.stored_of_run(connection, bare))
        == raw_columns.lengths(connection, bare)
        == {}
    )
    with pytest.raises(LookupError, match="has no channel torque_nm"):
        raw_columns.stored(connection, bare, "torque_nm")
    with pytest.raises(IntegrityError, match=r"(?i)unique"), connection.begin_nested():
        raw_columns.write(connection, key, raw_columns.encoded(sent))
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), connection.begin_nested():
        raw_columns.write(connection, 99, raw_columns.encoded(sent))


def test_short_channels_are_never_stored_as_decimals() -> None:
    sent = {"short": np.arange(LONG - 1.0), "long": np.arange(float(LONG))}
    codecs = [codec for _, codec, _, _ in raw_columns.encoded(sent).columns]
    assert codecs == ["shuffle-zlib", "decimal-zlib"]


def test_a_damaged_channel_is_named(connection: Connection) -> None:
    key = runs.insert(connection, new_run())
    raw_columns.write(connection, key, raw_columns.encoded(columns(1)))
    connection.exec_driver_sql("UPDATE channel SET data = substr(data, 1, 50) WHERE name = 'speed_rpm'")
    with pytest.raises(DamagedData, match="channel speed_rpm: "):
        raw_columns.values_of(raw_columns.stored_of_run(connection, key))
    with pytest.raises(DamagedData, match="channel speed_rpm: "):
        raw_columns.stored(connection, key, "speed_rpm").values()


@pytest.fixture(params=["database", "in_folder", "in_bucket"])
def place(request: pytest.FixtureRequest) -> str:
    """Where long columns are: in the database, or in a store beside it."""
    return DATABASE if request.param == DATABASE else str(request.getfixturevalue(request.param))


def store_long_run(database: Database, place: str, sent: dict[str, NDArray[np.float64]]) -> int:
    """A run whose long columns are in that place."""
    raw_records.use(database, place)
    columns = repository.placed(database, raw_columns.encoded(sent))
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        run_key = runs.insert(connection, new_run(0))
        raw_columns.write(connection, run_key, columns)
    return run_key


def test_columns_keep_their_bits_wherever_they_are(database: Database, place: str) -> None:
    sent = columns(7, 50_000) | {"oil_temperature_c": np.zeros(50_000), "time_s": np.arange(50_000) / 1000}
    run_key = store_long_run(database, place, sent)
    with database.reading() as connection:
        held = raw_columns.stored_of_run(connection, run_key)
        rows = connection.exec_driver_sql("SELECT name, codec, length(data) FROM channel").fetchall()
        assert raw_columns.lengths(connection, run_key) == dict.fromkeys(sent, 50_000)
        alone = [raw_columns.stored(connection, run_key, name) for name in sent]
        numbers = raw_stores.numbers(connection)
    assert [each.values().tobytes() for each in alone] == [column.tobytes() for column in sent.values()]
    kept = raw_columns.values_of(held)
    assert list(kept) == list(sent)
    assert all(kept[name].tobytes() == column.tobytes() for name, column in sent.items())
    codecs, sizes = {name: codec for name, codec, _ in rows}, {name: size for name, _, size in rows}
    assert (codecs["time_s"], codecs["torque_nm"]) == ("decimal-zlib", "shuffle-zlib")
    assert 0 < sizes["oil_temperature_c"] < raw_columns.MAX_INLINE  # a short one stays in the database
    assert (sizes["torque_nm"] > raw_columns.MAX_INLINE) == (place == DATABASE)
    assert numbers == ({} if place == DATABASE else {place: (3, 3)})


def test_a_column_that_is_damaged_or_missing_in_its_store_is_named(database: Database, raw_address: str) -> None:
    run_key = store_long_run(database, raw_address, columns(7, 50_000))
    one = read_from(database, raw_columns.stored, run_key, "torque_nm")
    store = open_store(raw_address)
    whole = store.get(one.blob)
    store.put(one.blob, whole[:-1])
    with pytest.raises(DamagedData, match=f"channel torque_nm: the raw record {one.blob} in .* is damaged"):
        one.values()
    store.delete(one.blob)
    with pytest.raises(DamagedData, match=f"channel torque_nm: the raw record {one.blob} is missing"):
        one.values()
    store.put(one.blob, whole)
    assert one.values().size == 50_000


def test_short_columns_go_to_no_store_and_ask_for_none(database: Database, in_folder: str) -> None:
    raw_records.use(database, in_folder)
    short = raw_columns.encoded(columns(1, raw_columns.MAX_INLINE // 16))
    assert not short.is_long
    assert repository.placed(database, short).columns == short.columns
    assert list(open_store(in_folder).names()) == []
