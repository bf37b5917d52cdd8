"""The body of one run: bit for bit, in little memory, and under a tag that no channel had to be read for."""

import gzip
import json
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet  # type: ignore[import-untyped]
import pytest

from models.arrays import FloatArray
from service.errors import NotAcceptableError, NotFoundError
from service.queries import raw_run
from service.queries.raw_run import entity_tag, write_run
from storage import channels, clutches, runs
from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.storage.samples import clutch_row, new_run
from tests.support import stationary

SAMPLES = 20_000
CLUTCH = clutch_row().clutch_id


def dynamic(samples: int = SAMPLES) -> dict[str, FloatArray]:
    """A record with a peak in each channel, and values that are hard to write."""
    rng = np.random.default_rng(3)
    time = np.arange(samples) / 1000
    found = {
        "time_s": time,
        "pressure_bar": 5 + 0.01 * rng.standard_normal(samples),
        "speed_rpm": 1000 - 990 * np.cos(time),
        "torque_nm": 20 + rng.standard_normal(samples),
    }
    found["pressure_bar"][777], found["speed_rpm"][778], found["torque_nm"][779] = 8.5, 2500.0, -77.25
    found["torque_nm"][:5] = -0.0, 5e-324, 1e-7, 0.1, 123456789.0 / 1e3
    return found


def store(database: Database, columns: dict[str, FloatArray], run_id: str) -> None:
    """A run with its channels, not evaluated: what its receipt says is no matter here."""
    receipt = {"run_id": run_id, "cycles": 0, "fits": []}
    with database.writing() as connection:
        row = replace(new_run(), clutch_id=CLUTCH, run_id=run_id, receipt=receipt)
        channels.write(connection, runs.insert(connection, row), channels.encoded(columns))


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    found = open_database(f"sqlite:///{tmp_path / 'clutchlife.db'}")
    with found.writing() as connection:
        clutches.insert(connection, clutch_row())
    store(found, dynamic(), "raw")
    plateaus = {name: np.array(values) for name, values in stationary(0)["channels"].items()}
    store(found, plateaus, "plateaus")
    yield found
    found.close()


def written(database: Database, path: Path, run_id: str = "raw", points: int | None = None, **more: Any) -> bytes:
    """The body, whose tag is the one that was announced."""
    asked = {"points": points, "kind": "json"} | more
    tag = entity_tag(database, CLUTCH, run_id, **asked)  # type: ignore[arg-type]
    assert write_run(database, CLUTCH, run_id, path=path, **asked) == tag  # type: ignore[arg-type]
    return path.read_bytes()


def test_all_samples_bit_for_bit_behind_the_receipt(database: Database, tmp_path: Path) -> None:
    body = json.loads(written(database, tmp_path / "body"))
    with database.reading() as connection:
        row = runs.get(connection, CLUTCH, "raw")
    assert row is not None
    assert row.receipt.items() <= body.items()
    assert body.keys() - row.receipt.keys() == {
        "channels", "samples", "changes", "doubts", "reading", "received_by", "sent_cycles", "state",
    }  # fmt: skip
    assert body["samples"] == SAMPLES
    assert list(body["channels"]) == list(dynamic())
    for name, column in dynamic().items():
        assert np.array(body["channels"][name]).tobytes() == column.tobytes(), name


def test_a_plot_has_samples_as_they_were_measured_and_every_peak(database: Database, tmp_path: Path) -> None:
    body = json.loads(written(database, tmp_path / "body", points=500))
    found = {name: np.array(values) for name, values in body["channels"].items()}
    assert {column.size for column in found.values()} == {len(body["channels"]["time_s"])}
    assert 400 <= found["time_s"].size <= 500
    rows = np.round(found["time_s"] * 1000).astype(int)
    assert (rows[0], rows[-1], body["samples"]) == (0, SAMPLES - 1, SAMPLES)
    for name, column in dynamic().items():
        assert found[name].tobytes() == column[rows].tobytes()
        assert (found[name].min(), found[name].max()) == (column.min(), column.max())


@pytest.mark.parametrize("points", [1, 10, 159])
def test_plateaus_come_whole(database: Database, tmp_path: Path, points: int) -> None:
    body = json.loads(written(database, tmp_path / "body", "plateaus", points=points))
    assert len(body["channels"]["torque_nm"]) == body["samples"] == 160


def test_a_packed_body_is_the_same_body(database: Database, tmp_path: Path) -> None:
    packed = written(database, tmp_path / "a", points=500, compressed=True)
    assert gzip.decompress(packed) == written(database, tmp_path / "b", points=500)
    assert packed == written(database, tmp_path / "another name", points=500, compressed=True)


def test_parquet_has_all_samples_units_and_the_receipt(database: Database, tmp_path: Path) -> None:
    written(database, tmp_path / "run.parquet", kind="parquet")
    table = parquet.read_table(tmp_path / "run.parquet")
    assert table.column_names == list(dynamic())
    for name, column in dynamic().items():
        assert table[name].to_numpy().tobytes() == column.tobytes()
    assert table.schema.field("torque_nm").metadata == {b"unit": b"Nm"}
    assert json.loads(table.schema.metadata[b"clutchlife"])["run_id"] == "raw"


def test_without_the_extra_parquet_is_not_given(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(raw_run, "_PACKAGE", "no-such-package")
    with pytest.raises(NotAcceptableError, match=r"pip install -e '\.\[parquet\]'"):
        written(database, tmp_path / "body", kind="parquet")


def test_the_tag_follows_from_the_receipt_and_the_request_alone(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(channels, "stored", None)  # no channel can be read
    monkeypatch.setattr(channels, "read", None)
    asked: list[dict[str, Any]] = [
        {"points": None, "kind": "json"},
        {"points": 500, "kind": "json"},
        {"points": 500, "kind": "json", "compressed": True},
        {"points": None, "kind": "parquet"},
    ]

    def tags() -> list[str]:
        return [entity_tag(database, CLUTCH, "raw", **arguments) for arguments in asked]

    before = tags()
    assert len({*before}) == len(asked)
    assert tags() == before
    with database.writing() as connection:
        row = runs.get(connection, CLUTCH, "raw")
        assert row is not None
        runs.set_receipt(connection, row.run_key, row.receipt | {"cycles": 7})
    assert not {*tags()} & {*before}
    with pytest.raises(NotFoundError):
        entity_tag(database, CLUTCH, "nobody", points=None, kind="json")


def test_memory_is_that_of_a_channel_whatever_the_length(database: Database, tmp_path: Path) -> None:
    """One channel as stored and decoded, and a part of its text; the text whole would be five times the channels."""
    samples = 100_000
    store(database, dynamic(samples), "long")
    for points in (None, 500):
        tracemalloc.start()
        body = tmp_path / "body"
        write_run(database, CLUTCH, "long", points=points, kind="json", path=body)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 1.5 * 4 * 8 * samples  # all channels once would be 4 * 8 a sample
    assert body.stat().st_size < 50_000
