"""A disk without room is said to be one, and what was sent is not half there."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.web.files import emptied_folder
from service.web.routes import files
from tests.support import stationary

ADDRESS = "/v1/clutches/c1/runs/file?kind=stationary_stribeck&cycles=0&filename=a.csv"


def text() -> str:
    channels = stationary(0)["channels"]
    rows = zip(*channels.values(), strict=True)
    return ",".join(channels) + "\n" + "\n".join(",".join(map(repr, row)) for row in rows)


@pytest.fixture
def full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What comes in is written to the system's own full disk."""

    @contextmanager
    def folder(*, dir: Path) -> Iterator[str]:  # noqa: A002
        del dir
        place = tmp_path / "full"
        place.mkdir()
        (place / "run").symlink_to("/dev/full")
        try:
            yield str(place)
        finally:
            (place / "run").unlink()
            place.rmdir()

    monkeypatch.setattr(files.tempfile, "TemporaryDirectory", folder)


def test_a_file_for_which_the_disk_has_no_room_is_refused_with_the_reason(
    client: TestClient, full: None, caplog: pytest.LogCaptureFixture
) -> None:
    del full
    for sent in ({"content": text()}, {"files": {"file": ("a.csv", text())}}):
        answer = client.post(ADDRESS, **sent)  # type: ignore[arg-type]
        assert (answer.status_code, answer.headers["content-type"]) == (507, "application/problem+json")
        assert answer.json()["type"] == "urn:clutchlife:problem:no-room"
        assert "No space left on device" in answer.json()["detail"]
    said = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert [line.partition(": ")[0] for line in said] == ["POST /v1/clutches/{clutch_id}/runs/file"] * 2
    assert client.get("/v1/clutches/c1/runs").json()["items"] == []


def test_files_are_kept_beside_the_database_while_they_are_read(
    client: TestClient, database_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path(database_url.removeprefix("sqlite:///"))
    beside = path.with_name(f"{path.name}-files")
    seen: list[Path] = []
    read = files.read_file_run

    def watched(given: Path, **of_run: object) -> object:
        seen.append(given)
        return read(given, **of_run)  # type: ignore[arg-type]

    monkeypatch.setattr(files, "read_file_run", watched)
    assert client.post(ADDRESS, content=text()).status_code == 201
    assert [given.parent.parent for given in seen] == [beside]
    assert list(beside.iterdir()) == []


def test_what_a_killed_service_left_of_files_is_gone(tmp_path: Path) -> None:
    left = tmp_path / "a.db-files" / "tmp1234" / "run"
    left.parent.mkdir(parents=True)
    left.write_text("half a run")
    assert list(emptied_folder(tmp_path / "a.db").iterdir()) == []
