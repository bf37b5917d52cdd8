"""The body of one run: bit for bit wherever its channels are, in little memory, under a tag for which no channel is read."""

import gzip
import io
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet  # type: ignore[import-untyped]
import pytest
from fastapi.testclient import TestClient

from models.arrays import FloatArray
from service.answers import raw_run
from service.answers.raw_run import entity_tag, write_run
from service.clutch import items
from service.clutch.analysis import Analysis
from service.clutch.incoming_run import IncomingRun
from service.errors import NotAcceptableError, NotFoundError
from service.web import readiness
from storage import clutches, raw_columns, runs
from storage.blobs.stores import DATABASE, BlobStore, open_store
from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.growth import peak
from tests.service.clients import as_answered, client_on, clutchlife
from tests.storage.samples import clutch_row, new_run, read_from, write_to
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
    run = IncomingRun(kind="dynamic_stribeck", cycles=0.0, run_id=run_id)
    receipt = as_answered(items.receipt(CLUTCH, run, Analysis(), received_at="2026-11-02T08:00:00.000+00:00"))
    with database.writing() as connection:
        row = replace(new_run(), clutch_id=CLUTCH, run_id=run_id, receipt=receipt)
        raw_columns.write(connection, runs.insert(connection, row), raw_columns.encoded(columns))


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    found = open_database(f"sqlite:///{tmp_path / 'clutchlife.db'}")
    write_to(found, clutches.insert, clutch_row())
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


def test_all_samples_bit_for_bit_behind_the_receipt_as_json_and_as_parquet(database: Database, tmp_path: Path) -> None:
    body = json.loads(written(database, tmp_path / "body"))
    row = read_from(database, runs.get, CLUTCH, "raw")
    assert row.receipt.items() <= body.items()
    assert body.keys() - row.receipt.keys() == {
        "channels", "samples", "changes", "doubts", "reading", "received_by", "sent_cycles", "state",
    }  # fmt: skip
    assert body["samples"] == SAMPLES
    assert list(body["channels"]) == list(dynamic())
    for name, column in dynamic().items():
        assert np.array(body["channels"][name]).tobytes() == column.tobytes(), name
    written(database, tmp_path / "run.parquet", kind="parquet")
    table = parquet.read_table(tmp_path / "run.parquet")
    assert table.column_names == list(dynamic())
    for name, column in dynamic().items():
        assert table[name].to_numpy().tobytes() == column.tobytes()
    assert table.schema.field("torque_nm").metadata == {b"unit": b"Nm"}
    assert json.loads(table.schema.metadata[b"clutchlife"])["run_id"] == "raw"


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
    packed = written(database, tmp_path / "a", points=500, compressed=True)
    assert gzip.decompress(packed) == (tmp_path / "body").read_bytes()
    assert packed == written(database, tmp_path / "another name", points=500, compressed=True)
    for points in (1, 10, 159):
        body = json.loads(written(database, tmp_path / "body", "plateaus", points=points))
        assert len(body["channels"]["torque_nm"]) == body["samples"] == 160, "plateaus come whole"


def test_parquet_needs_its_extra(database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(raw_run, "_PACKAGE", "no-such-package")
    with pytest.raises(NotAcceptableError, match=r"pip install -e '\.\[parquet\]'"):
        written(database, tmp_path / "body", kind="parquet")


def test_the_tag_follows_from_receipt_and_request_alone(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("stored", "stored_of_run"):
        monkeypatch.setattr(raw_columns, name, None)  # no channel can be read
    asked: list[dict[str, Any]] = [{}, {"points": 500}, {"points": 500, "compressed": True}, {"kind": "parquet"}]

    def tags() -> list[str]:
        defaults: dict[str, Any] = {"points": None, "kind": "json"}
        return [entity_tag(database, CLUTCH, "raw", **(defaults | arguments)) for arguments in asked]

    before = tags()
    assert len({*before}) == len(asked)
    assert tags() == before
    with database.writing() as connection:
        row = runs.get(connection, CLUTCH, "raw")
        runs.set_receipt(connection, row.run_key, row.receipt | {"cycles": 7})
    assert not {*tags()} & {*before}
    with pytest.raises(NotFoundError):
        entity_tag(database, CLUTCH, "nobody", points=None, kind="json")


def test_memory_is_that_of_a_channel_whatever_the_length(database: Database, tmp_path: Path) -> None:
    """One channel as stored and decoded, and a part of its text; the text whole would be five times the channels."""
    samples = 100_000
    store(database, dynamic(samples), "long")
    body = tmp_path / "body"
    for points in (None, 500):
        write = partial(write_run, database, CLUTCH, "long", points=points, kind="json", path=body)
        assert peak(write) < 1.5 * 4 * 8 * samples  # all channels once would be 4 * 8 a sample
    assert body.stat().st_size < 50_000


RUNS = "/v1/clutches/c1/runs"
PARQUET = {"Accept": "application/vnd.apache.parquet"}


def long_run(cycles: float = 0.0, samples: int = SAMPLES) -> dict[str, Any]:
    """A dynamic test whose torque does not deflate to little."""
    rng, time = np.random.default_rng(int(cycles)), np.arange(samples) / 100
    channels = {
        "time_s": time,
        "pressure_bar": np.full(samples, 5.0),
        "speed_rpm": 1000 - 990 * np.cos(2 * np.pi * 0.1 * time) + rng.normal(scale=1e-2, size=samples),
        "torque_nm": 20 + np.sin(time) + rng.normal(scale=1e-3, size=samples),
    }
    sent = {name: column.tolist() for name, column in channels.items()}
    return {"kind": "dynamic_stribeck", "cycles": cycles, "run_id": f"long-{cycles:g}", "channels": sent}


@contextmanager
def service(database: str, raw: str | None = None) -> Iterator[TestClient]:
    """A service in this process."""
    with client_on(database, raw=raw, max_body_mb=8) as client:
        client.post("/v1/clutches", json={"clutch_id": "c1"})
        yield client


# --- Over HTTP: negotiated, packed, not sent again where it is known; lists hold no channels.

ONE = f"{RUNS}/long-0"


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """A service that has one record of 6,000 samples."""
    with service(f"sqlite:///{tmp_path_factory.mktemp('stored')}/a.db") as client:
        assert client.post(RUNS, json=long_run(samples=6000)).status_code == 201
        yield client


def test_points_thin_the_channels(stored: TestClient) -> None:
    whole, plot = stored.get(ONE).json(), stored.get(f"{ONE}?points=200").json()
    assert len(plot["channels"]["time_s"]) <= 200
    assert plot | {"channels": whole["channels"]} == whole == stored.get(f"{ONE}?points=6000").json()
    for wrong in ("0", "-1", "a", "1.5", "1000001"):
        assert stored.get(f"{ONE}?points={wrong}").status_code == 422
    assert stored.get(f"{RUNS}/nobody?points=2").status_code == 404


@pytest.mark.parametrize(
    ("accepted", "given"),
    [
        ("", "application/json"),
        ("*/*", "application/json"),
        ("text/html,application/xhtml+xml,*/*;q=0.8", "application/json"),
        (f"{PARQUET['Accept']};q=0.3", PARQUET["Accept"]),
        (f"application/json;q=0.5, {PARQUET['Accept'].upper()}; q=0.9", PARQUET["Accept"]),
        (f"application/json, {PARQUET['Accept']};q=0.9", "application/json"),
        (f"application/json;q=0.1, {PARQUET['Accept']};q=0", "application/json"),
        (f"application/json;q=0.1, {PARQUET['Accept']};q=inf", "application/json"),
    ],
)
def test_accept_chooses_the_format(stored: TestClient, accepted: str, given: str) -> None:
    found = stored.get(f"{ONE}?points=100", headers={"Accept": accepted})
    assert (found.status_code, found.headers["content-type"]) == (200, given)
    assert set(found.headers["vary"].split(", ")) == {"Accept", "Accept-Encoding"}


def test_what_is_known_is_not_decoded_nor_sent_and_nothing_is_left_on_disk(
    stored: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    asked = [(address, headers) for address in (ONE, f"{ONE}?points=100") for headers in ({}, PARQUET)]
    tags = [stored.get(address, headers=headers).headers["etag"] for address, headers in asked]
    assert list(tmp_path.iterdir()) == []
    for name in ("stored", "stored_of_run"):
        monkeypatch.setattr(raw_columns, name, None)
    monkeypatch.setattr(raw_run, "write_run", None)
    for tag, (address, headers) in zip(tags, asked, strict=True):
        held = stored.get(address, headers=headers | {"If-None-Match": f'"other", W/{tag}'})
        assert (held.status_code, held.content, held.headers["etag"]) == (304, b"", tag)


def test_a_packed_plot_has_a_tag_of_its_own(stored: TestClient) -> None:
    packed, plain = (
        stored.get(f"{ONE}?points=100", headers={"Accept-Encoding": coding}) for coding in ("gzip", "identity")
    )
    assert packed.json() == plain.json()
    assert (packed.headers["content-encoding"], plain.headers.get("content-encoding")) == ("gzip", None)
    assert packed.headers["etag"] != plain.headers["etag"]
    assert int(packed.headers["content-length"]) < int(plain.headers["content-length"]) == len(plain.content)


def test_lists_hold_no_channels(stored: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither in what is answered nor in what is read for it."""
    stored.post(RUNS, json=stationary(1000)).raise_for_status()
    for name in ("stored", "stored_of_run", "lengths"):
        monkeypatch.setattr(raw_columns, name, None)
    names = ("runs", "runs.csv", "loops", "stribeck", "series", "degradation", "remaining-useful-life", "diagnoses")
    for address in ("/v1/clutches", *(f"/v1/clutches/c1/{name}" for name in names)):
        found = stored.get(address)
        assert (found.status_code, '"channels"' in found.text) == (200, False), address
    assert stored.get(RUNS).json()["items"][0]["run_id"] == "long-0"


# --- Wherever long channels are a run is the same; a store that is away is a problem with its reason, and loses nothing.


@pytest.fixture(params=[DATABASE, "in_folder", "in_bucket"])
def place(request: pytest.FixtureRequest) -> str:
    """Where long columns are."""
    return DATABASE if request.param == DATABASE else str(request.getfixturevalue(request.param))


def blobs(place: str) -> set[str]:
    """What is in a store."""
    return {name for name, _ in open_store(place).names()}


def test_a_run_is_the_same_wherever_its_channels_are(place: str, database_url: str, tmp_path: Path) -> None:
    sent = long_run()
    with service(f"sqlite:///{tmp_path}/plain.db") as plain, service(database_url, place) as client:
        hashes = [each.post(RUNS, json=sent).json()["content_sha256"] for each in (plain, client)]
        assert hashes[0] == hashes[1]
        again = client.post(RUNS, json=sent)
        assert (again.status_code, again.json()["duplicate"]) == (200, True)
        assert client.get(f"{RUNS}/long-0").json()["channels"] == sent["channels"]
        for address, headers in ((f"{RUNS}/long-0?points=300", {}), (f"{RUNS}/long-0", PARQUET)):
            first, second = (each.get(address, headers=headers) for each in (plain, client))
            assert (second.status_code, second.headers["content-type"]) == (200, first.headers["content-type"])
            if not headers:
                assert first.json()["channels"] == second.json()["channels"]
        table = parquet.read_table(io.BytesIO(client.get(f"{RUNS}/long-0", headers=PARQUET).content))
        assert table.to_pydict() == sent["channels"]
        checks = client.get("/readyz").json()["checks"]
        assert "raw" not in checks
    if place != DATABASE:
        assert len(blobs(place)) == 2  # speed and torque; time and pressure deflate to little
    assert "1 runs of 1 clutches were checked" in clutchlife("verify", "--database", database_url)
    clutchlife("replay", "--database", database_url)


def test_a_store_that_is_away_is_a_503_with_its_reason_and_nothing_is_stored(
    database_url: str, in_folder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(readiness, "RAW_LOOK_SECONDS", 0.0)
    folder = Path(in_folder.removeprefix("folder://"))
    with service(database_url, in_folder) as client:
        assert client.post(RUNS, json=long_run()).status_code == 201
        folder.rename(folder.with_name("unmounted"))
        ready = client.get("/readyz")
        assert (ready.status_code, list(ready.json()["checks"])[-1]) == (503, "raw")
        for answer in (client.post(RUNS, json=long_run(1.0)), client.get(f"{RUNS}/long-0")):
            assert (answer.status_code, answer.headers["content-type"]) == (503, "application/problem+json")
            assert answer.json()["type"] == "urn:clutchlife:problem:raw-records"
            assert "Is its disk mounted?" in answer.json()["detail"]
            assert answer.headers["retry-after"]
        assert client.get(f"{RUNS}/long-1").status_code == 404
        client.post("/v1/clutches", json={"clutch_id": "c2"})
        assert client.post("/v1/clutches/c2/runs", json=stationary(0)).status_code == 201  # needs no store
        folder.with_name("unmounted").rename(folder)
        assert client.get("/readyz").status_code == 200
        assert client.post(RUNS, json=long_run(1.0)).status_code == 201
        assert client.get(f"{RUNS}/long-0").json()["channels"] == long_run()["channels"]


def test_a_bucket_that_does_not_answer_is_a_503_without_secrets(
    database_url: str, in_bucket: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with service(database_url, in_bucket) as client:
        monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
        open_store.cache_clear()
        answer = client.post(RUNS, json=long_run())
        assert (answer.status_code, answer.json()["type"]) == (503, "urn:clutchlife:problem:raw-records")
        assert in_bucket in answer.json()["detail"]
        assert client.get(RUNS).json()["items"] == []
    assert "a-very-secret-key" not in caplog.text


def test_a_look_that_takes_long_says_which_part_does_not_answer(
    database_url: str, in_folder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks = []

    class Slow:
        """A store that hangs."""

        def mark(self) -> str:
            looks.append(readiness.time.sleep(3.0))
            return ""

    def slow(_: str) -> BlobStore:
        return Slow()  # type: ignore[return-value]

    with service(database_url, in_folder) as client:
        monkeypatch.setattr(readiness, "open_store", slow)
        for _ in range(2):
            answer = client.get("/readyz")
            assert (answer.status_code, list(answer.json()["checks"])[-1]) == (503, "raw")
            assert "has not answered for 1 s" in answer.json()["checks"]["raw"]
        monkeypatch.undo()
    assert len(looks) <= 1  # the second asked for no look of its own


def test_verify_names_a_blob_that_is_missing_or_damaged(database_url: str, raw_address: str) -> None:
    with service(database_url, raw_address) as client:
        assert client.post(RUNS, json=long_run()).status_code == 201
    store, name = open_store(raw_address), min(blobs(raw_address))
    whole = store.get(name)
    verify = ("verify", "--database", database_url)
    store.put(name, whole[:-1])
    assert f"the raw record {name} in {raw_address} is damaged" in clutchlife(*verify, code=1)
    store.delete(name)
    assert f"the raw record {name} is missing in {raw_address}" in clutchlife(*verify, code=1)
    store.put(name, whole)
    assert "0 findings" in clutchlife(*verify)


def test_backup_names_what_it_leaves_out_and_the_commands_say_where_it_is(
    database_url: str, in_folder: str, in_bucket: str, tmp_path: Path
) -> None:
    with service(database_url, in_folder) as client:
        assert client.post(RUNS, json=long_run()).status_code == 201
    said = clutchlife("backup", str(tmp_path / "a.db"), "--database", database_url)
    assert f"does not contain 2 raw records: copy them now from {in_folder}" in said
    given = ("--database", database_url)
    assert clutchlife("raw", "list", *given) == f"{in_folder}: 2 channels in 2 files, in use\n"
    assert clutchlife("raw", "move", "--to", in_bucket, *given).strip() == "2 channels were moved"
    listed = clutchlife("raw", "list", *given)
    assert f"{in_folder}: 0 channels in 0 files\n{in_bucket}: 2 channels in 2 files, in use\n" == listed
    assert "2 too new to be removed" in clutchlife("raw", "collect", *given)
    clutchlife("raw", "collect", "--grace-hours", "0.5", *given, code=64)
    assert clutchlife("raw", "move", "--to", DATABASE, *given).strip() == "2 channels were moved"
    assert "new raw records go into the database" in clutchlife("raw", "list", *given)
    assert "the place of raw records must be" in clutchlife("raw", "move", "--to", "ftp://id:secret@x", *given, code=64)
    assert "raw records" not in clutchlife("backup", str(tmp_path / "b.db"), *given)


def test_what_was_chosen_once_holds_until_another_is_chosen(database_url: str, in_folder: str) -> None:
    with service(database_url, in_folder):
        pass
    with service(database_url) as client:  # as commands and workers do, which are not told
        assert client.post(RUNS, json=long_run()).status_code == 201
    assert len(blobs(in_folder)) == 2
    with service(database_url, DATABASE) as client:
        assert client.post(RUNS, json=long_run(1.0)).status_code == 201
        assert client.get(f"{RUNS}/long-0").json()["channels"] == long_run()["channels"]
    assert len(blobs(in_folder)) == 2
