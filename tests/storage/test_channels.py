"""The raw channels of runs, in either database and in each kind of store beside it."""

import numpy as np
import pytest
from numpy.typing import NDArray
from sqlalchemy import Connection
from sqlalchemy.exc import IntegrityError

from service import stored_runs
from service.workflows import raw_records
from storage import channels, clutches, runs
from storage.blobs import raw_stores
from storage.blobs.stores import DATABASE, open_store
from storage.encoding import LONG
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from tests.storage.samples import clutch_row, columns, new_run, read_from


def test_channels_keep_their_order_and_their_bits_and_are_written_once(connection: Connection) -> None:
    sent = {"time_s": np.array([0.0, -0.0, 5e-324, 1e308]), **columns(1, 5000), "empty": np.zeros(0)}
    key, bare = (runs.insert(connection, new_run(number)) for number in range(2))
    channels.write(connection, key, channels.encoded(sent))
    channels.write(connection, bare, channels.encoded({}))
    back = channels.values_of(channels.stored_of_run(connection, key))
    assert list(back) == list(sent) == list(channels.lengths(connection, key))
    assert all(back[name].tobytes() == column.tobytes() for name, column in sent.items())
    assert channels.values_of(channels.stored_of_run(connection, bare)) == channels.lengths(connection, bare) == {}
    with pytest.raises(LookupError, match="has no channel torque_nm"):
        channels.stored(connection, bare, "torque_nm")
    with pytest.raises(IntegrityError, match=r"(?i)unique"), connection.begin_nested():
        channels.write(connection, key, channels.encoded(sent))
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), connection.begin_nested():
        channels.write(connection, 99, channels.encoded(sent))


def test_short_channels_are_never_stored_as_decimals() -> None:
    sent = {"short": np.arange(LONG - 1.0), "long": np.arange(float(LONG))}
    codecs = [codec for _, codec, _, _ in channels.encoded(sent).columns]
    assert codecs == ["shuffle-zlib", "decimal-zlib"]


def test_a_damaged_channel_is_named(connection: Connection) -> None:
    key = runs.insert(connection, new_run())
    channels.write(connection, key, channels.encoded(columns(1)))
    connection.exec_driver_sql("UPDATE channel SET data = substr(data, 1, 50) WHERE name = 'speed_rpm'")
    with pytest.raises(DamagedData, match="channel speed_rpm: "):
        channels.values_of(channels.stored_of_run(connection, key))
    with pytest.raises(DamagedData, match="channel speed_rpm: "):
        channels.stored(connection, key, "speed_rpm").values()


@pytest.fixture(params=["database", "in_folder", "in_bucket"])
def place(request: pytest.FixtureRequest) -> str:
    """Where long columns are: in the database, or in a store beside it."""
    return DATABASE if request.param == DATABASE else str(request.getfixturevalue(request.param))


def store_long_run(database: Database, place: str, sent: dict[str, NDArray[np.float64]]) -> int:
    """A run whose long columns are in that place."""
    raw_records.use(database, place)
    columns = stored_runs.placed(database, channels.encoded(sent))
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        run_key = runs.insert(connection, new_run(0))
        channels.write(connection, run_key, columns)
    return run_key


def test_columns_keep_their_bits_wherever_they_are(database: Database, place: str) -> None:
    sent = columns(7, 50_000) | {"oil_temperature_c": np.zeros(50_000), "time_s": np.arange(50_000) / 1000}
    run_key = store_long_run(database, place, sent)
    with database.reading() as connection:
        held = channels.stored_of_run(connection, run_key)
        rows = connection.exec_driver_sql("SELECT name, codec, length(data) FROM channel").fetchall()
        assert channels.lengths(connection, run_key) == dict.fromkeys(sent, 50_000)
        alone = [channels.stored(connection, run_key, name) for name in sent]
        numbers = raw_stores.numbers(connection)
    assert [each.values().tobytes() for each in alone] == [column.tobytes() for column in sent.values()]
    kept = channels.values_of(held)
    assert list(kept) == list(sent)
    assert all(kept[name].tobytes() == column.tobytes() for name, column in sent.items())
    codecs, sizes = {name: codec for name, codec, _ in rows}, {name: size for name, _, size in rows}
    assert (codecs["time_s"], codecs["torque_nm"]) == ("decimal-zlib", "shuffle-zlib")
    assert 0 < sizes["oil_temperature_c"] < channels.MAX_INLINE  # a short one stays in the database
    assert (sizes["torque_nm"] > channels.MAX_INLINE) == (place == DATABASE)
    assert numbers == ({} if place == DATABASE else {place: (3, 3)})


def test_a_column_that_is_damaged_or_missing_in_its_store_is_named(database: Database, raw_address: str) -> None:
    run_key = store_long_run(database, raw_address, columns(7, 50_000))
    one = read_from(database, channels.stored, run_key, "torque_nm")
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
    short = channels.encoded(columns(1, channels.MAX_INLINE // 16))
    assert not short.is_long
    assert stored_runs.placed(database, short).columns == short.columns
    assert list(open_store(in_folder).names()) == []
