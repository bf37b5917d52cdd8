"""A run is the same wherever its long channels are; a store that is away is a problem with its reason, and loses nothing."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet  # type: ignore[import-untyped]
import pytest
from fastapi.testclient import TestClient

from service.web import readiness
from storage.blobs.stores import DATABASE, BlobStore, open_store
from tests.service.clients import client_on, clutchlife
from tests.support import stationary

SAMPLES = 20_000
RUNS = "/v1/clutches/c1/runs"
PARQUET = {"Accept": "application/vnd.apache.parquet"}


def long_run(cycles: float = 0.0) -> dict[str, Any]:
    """A dynamic test whose torque does not deflate to little."""
    rng, time = np.random.default_rng(int(cycles)), np.arange(SAMPLES) / 100
    channels = {
        "time_s": time,
        "pressure_bar": np.full(SAMPLES, 5.0),
        "speed_rpm": 1000 - 990 * np.cos(2 * np.pi * 0.1 * time) + rng.normal(scale=1e-2, size=SAMPLES),
        "torque_nm": 20 + np.sin(time) + rng.normal(scale=1e-3, size=SAMPLES),
    }
    sent = {name: column.tolist() for name, column in channels.items()}
    return {"kind": "dynamic_stribeck", "cycles": cycles, "run_id": f"long-{cycles:g}", "channels": sent}


@contextmanager
def service(database: str, raw: str | None = None) -> Iterator[TestClient]:
    """A service in this process."""
    with client_on(database, raw=raw, max_body_mb=8) as client:
        client.post("/v1/clutches", json={"clutch_id": "c1"})
        yield client


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
        receipts = [each.post(RUNS, json=sent).json() for each in (plain, client)]
        assert [receipt["content_sha256"] for receipt in receipts] == [receipts[0]["content_sha256"]] * 2
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
    store.put(name, whole[:-1])
    assert f"the raw record {name} in {raw_address} is damaged" in clutchlife(
        "verify", "--database", database_url, code=1
    )
    store.delete(name)
    assert f"the raw record {name} is missing in {raw_address}" in clutchlife(
        "verify", "--database", database_url, code=1
    )
    store.put(name, whole)
    assert "0 findings" in clutchlife("verify", "--database", database_url)


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
