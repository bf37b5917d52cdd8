"""A stored inspection or photograph that is not what was sent is named; a backup holds them all."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.cli.main import app
from service.queries.verification import CheckedInspections, check_inspections
from storage.engine.opening import find_database
from storage.engine.sqlite.database import back_up
from tests.service.clients import client_of
from tests.service.web.routes.surfaces import FRESH, WORN, inspected, png, sha256


@pytest.fixture(scope="module")
def inspected_twice(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A database with two inspections, which show the same photograph, and one of them another."""
    path = tmp_path_factory.mktemp("inspected") / "clutchlife.db"
    with client_of(path) as client:
        for body, reds in ((FRESH, (1,)), (WORN, (1, 2))):
            address = inspected(client, body)
            for red in reds:
                headers = {"Content-Type": "image/png"}
                answer = client.post(f"{address}/photographs", content=png(red), headers=headers)
                assert answer.status_code == 201
    return f"sqlite:///{path}"


@pytest.fixture
def copy(inspected_twice: str, tmp_path: Path) -> str:
    """A backup of it."""
    back_up(inspected_twice, tmp_path / "copy.db")
    return f"sqlite:///{tmp_path}/copy.db"


def verify(url: str, *, code: int = 0) -> str:
    done = CliRunner().invoke(app, ["verify", "--database", url], catch_exceptions=False)
    assert done.exit_code == code, done.output
    return done.output


def test_a_backup_holds_inspections_and_photographs_and_verify_checks_them(copy: str) -> None:
    with closing(find_database(copy)) as database:
        assert check_inspections(database, "c1") == CheckedInspections(inspections=2, photographs=3, findings=())
    assert "2 inspections with 3 photographs are checked" in verify(copy)


@pytest.mark.parametrize(
    ("tampered", "says"),
    [
        ("UPDATE photograph SET data = x'00' WHERE rowid = 2", f"photograph {sha256(png(2))}"),
        ("UPDATE inspection SET content = replace(content, '9.52', '9.25')", "is not what was sent"),
        ("UPDATE inspection SET cycles = 10 WHERE cycles = 0", "it is stored at 10 cycles"),
    ],
)
def test_verify_names_what_is_not_as_it_was_sent(copy: str, tampered: str, says: str) -> None:
    with closing(sqlite3.connect(copy.removeprefix("sqlite:///"))) as connection, connection:
        connection.execute(tampered)
    output = verify(copy, code=1)
    assert says in output
    assert output.count("is not what was sent") == 1


def test_verify_names_a_photograph_that_is_gone(copy: str) -> None:
    with closing(sqlite3.connect(copy.removeprefix("sqlite:///"))) as connection, connection:
        connection.execute("DELETE FROM photograph WHERE data = (SELECT data FROM photograph LIMIT 1)")
    assert "refers to a row of photograph that is missing" in verify(copy, code=1)
