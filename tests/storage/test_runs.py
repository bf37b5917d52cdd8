"""Clutches, runs, channels and fits: each function against a real file."""

from dataclasses import asdict, replace
from math import nan

import numpy as np
import pytest
from sqlalchemy.exc import IntegrityError

from storage import channels, clutches, fits, runs
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from tests.storage.samples import clutch_row, columns, fit_row, new_run

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
        clutches.set_summary(connection, CLUTCH, 0.5, {"health": nan})


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


def test_summary_and_revision(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        clutches.insert(connection, clutch_row("other"))
        clutches.set_summary(connection, CLUTCH, 0.2, {"health": 0.2})
        assert [clutches.bump_revision(connection, CLUTCH) for _ in range(3)] == [1, 2, 3]
    with database.reading() as connection:
        assert clutches.get(connection, CLUTCH) == replace(clutch_row(), rank=0.2, summary={"health": 0.2}, revision=3)
        assert clutches.get(connection, "other") == clutch_row("other")


def test_an_unknown_clutch_or_run_is_named(database: Database) -> None:
    with database.writing() as connection:
        with pytest.raises(LookupError, match="'nobody'"):
            clutches.set_summary(connection, "nobody", 0.0, {})
        with pytest.raises(LookupError, match="'nobody'"):
            clutches.bump_revision(connection, "nobody")
        with pytest.raises(LookupError, match="run 99"):
            runs.set_results(connection, 99, {}, {}, "0.1.0")


def test_a_run_comes_back_as_it_was_stored(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        keys = [runs.insert(connection, new_run(number)) for number in range(2)]
    with database.reading() as connection:
        for number, key in enumerate(keys):
            stored = runs.get(connection, CLUTCH, f"run-{number:04d}")
            assert stored is not None
            assert asdict(stored) == {**asdict(new_run(number)), "run_key": key}
        assert runs.get(connection, CLUTCH, "unknown") is None
        assert runs.get(connection, "unknown", "run-0000") is None


def test_runs_are_in_order_of_cycles_then_id_whatever_order_they_came_in(database: Database) -> None:
    arrived = [(3, 500.0), (1, 500.0), (2, 0.0), (0, 7000.5), (4, 500.0)]
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        clutches.insert(connection, clutch_row("other"))
        for number, cycles in arrived:
            runs.insert(connection, new_run(number, cycles=cycles))
            runs.insert(connection, new_run(number, cycles=cycles, clutch_id="other"))
    expected = [f"run-{number:04d}" for number in (2, 1, 3, 4, 0)]
    with database.reading() as connection:
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
        assert len(runs.in_order(connection, CLUTCH)) == 5
        assert len(runs.in_order(connection, "unknown")) == 0


def test_runs_of_one_kind_and_without_a_limit(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        for number in range(6):
            kind = "duty_cycles" if number % 2 else "stationary_stribeck"
            runs.insert(connection, replace(new_run(number), kind=kind))
    with database.reading() as connection:
        assert len(runs.page(connection, CLUTCH)) == 6
        first, second = runs.page(connection, CLUTCH, kind="duty_cycles", limit=2)
        assert (first.run_id, second.run_id) == ("run-0001", "run-0003")
        (last,) = runs.page(connection, CLUTCH, kind="duty_cycles", after=(second.cycles, second.run_id))
        assert last.run_id == "run-0005"
        assert runs.page(connection, CLUTCH, kind="maintenance") == []


def test_a_run_belongs_to_a_clutch_and_its_id_is_taken_once(database: Database) -> None:
    with pytest.raises(IntegrityError, match="FOREIGN KEY"), database.writing() as connection:
        runs.insert(connection, new_run())
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        runs.insert(connection, new_run())
    with pytest.raises(IntegrityError, match="UNIQUE"), database.writing() as connection:
        runs.insert(connection, new_run())


def test_a_receipt_is_replaced(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        key = runs.insert(connection, new_run())
        runs.insert(connection, new_run(1))
        runs.set_results(connection, key, {"origin": "measured"}, {"mean_cof": 0.134}, "0.2.0")
    with database.reading() as connection:
        changed, other = runs.page(connection, CLUTCH, limit=9)
        assert changed.details == {"origin": "measured"}
        assert (changed.receipt, changed.code_version) == ({"mean_cof": 0.134}, "0.2.0")
        assert (other.receipt, other.code_version) == (new_run(1).receipt, "0.1.0")


def test_channels_keep_their_order_and_their_bits(database: Database) -> None:
    sent = {"time_s": np.array([0.0, -0.0, 5e-324, 1e308]), **columns(1, 5000), "empty": np.zeros(0)}
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        key, bare = (runs.insert(connection, new_run(number)) for number in range(2))
        channels.write(connection, key, channels.encoded(sent))
        channels.write(connection, bare, channels.encoded({}))
    with database.reading() as connection:
        back = channels.read(connection, key)
        assert list(back) == list(sent)
        assert all(back[name].tobytes() == column.tobytes() for name, column in sent.items())
        assert channels.read(connection, bare) == {}


def test_channels_belong_to_a_run_and_are_written_once(database: Database) -> None:
    with pytest.raises(IntegrityError, match="FOREIGN KEY"), database.writing() as connection:
        channels.write(connection, 7, channels.encoded(columns(1)))
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        key = runs.insert(connection, new_run())
        channels.write(connection, key, channels.encoded(columns(1)))
    with pytest.raises(IntegrityError, match="UNIQUE"), database.writing() as connection:
        channels.write(connection, key, channels.encoded(columns(2)))


def test_a_damaged_channel_is_named(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        key = runs.insert(connection, new_run())
        channels.write(connection, key, channels.encoded(columns(1)))
        connection.exec_driver_sql("UPDATE channel SET data = substr(data, 1, 50) WHERE name = 'speed_rpm'")
    with database.reading() as connection, pytest.raises(DamagedData, match=f"channel speed_rpm of run {key}"):
        channels.read(connection, key)


def test_fits_come_back_and_are_replaced(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        late, early, bare = (runs.insert(connection, new_run(number)) for number in (2, 1, 3))
        fits.write(connection, late, [fit_row(5e5), fit_row(1e5, mse_percent=None)])
        fits.write(connection, early, [fit_row(9e5), fit_row(3e5)])
        fits.write(connection, early, (fit_row(4e5),))
        fits.write(connection, bare, [])
    with database.reading() as connection:
        assert fits.of_clutch(connection, CLUTCH).get(late, []) == [fit_row(1e5, mse_percent=None), fit_row(5e5)]
        of_clutch = fits.of_clutch(connection, CLUTCH)
        assert list(of_clutch) == [early, late]
        assert of_clutch == {early: [fit_row(4e5)], late: [fit_row(1e5, mse_percent=None), fit_row(5e5)]}
        assert fits.of_clutch(connection, CLUTCH).get(bare, []) == []
        assert fits.of_clutch(connection, "unknown") == {}


def test_a_fit_has_sixteen_finite_covariances_and_a_run(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        key = runs.insert(connection, new_run())
        with pytest.raises(ValueError, match="16 numbers, got 3"):
            fits.write(connection, key, [replace(fit_row(1e5), covariance=(1.0, 2.0, 3.0))])
        with pytest.raises(ValueError, match="not JSON compliant"):
            fits.write(connection, key, [replace(fit_row(1e5), covariance=(nan,) * 16)])
    with pytest.raises(IntegrityError), database.writing() as connection:
        fits.write(connection, key, [replace(fit_row(1e5), rmse=nan)])
    with pytest.raises(IntegrityError, match="FOREIGN KEY"), database.writing() as connection:
        fits.write(connection, 99, [fit_row(1e5)])


def test_long_channels_keep_their_order_and_their_bits(database: Database) -> None:
    sent = columns(7, 50_000) | {"oil_temperature_c": np.zeros(50_000), "time_s": np.arange(50_000) / 1000}
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        run_key = runs.insert(connection, new_run(0))
        channels.write(connection, run_key, channels.encoded(sent))
    with database.reading() as connection:
        kept = channels.read(connection, run_key)
        rows = connection.exec_driver_sql("SELECT name, codec FROM channel").fetchall()
        stored = {name: codec for name, codec in rows}  # noqa: C416  (rows are no pairs to mypy)
    assert list(kept) == list(sent)
    assert all(kept[name].tobytes() == column.tobytes() for name, column in sent.items())
    assert {stored["time_s"], stored["torque_nm"]} == {"decimal-zlib", "shuffle-zlib"}
