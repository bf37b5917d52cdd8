"""Any value that another program or a failing disk changes is found, and no answer is ever made of it."""

import logging
import random
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa

from storage.rows import covered
from storage.tables import CHECKSUM, metadata
from tests.service.clients import client_of, client_on, clutchlife
from tests.support import post_tests, stationary

pytestmark = pytest.mark.slow

RUNS = "/v1/clutches/{}/runs"
#: Rows of a clutch c1 are found by its name or by its runs.
OF_CLUTCH = "clutch_id = 'c1'"
OF_RUN = "run_key IN (SELECT run_key FROM run WHERE clutch_id = 'c1')"


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two clutches with tests, a corrected one and a withdrawn one among them."""
    path = tmp_path_factory.mktemp("stored") / "a.db"
    with client_of(path) as client:
        assert client.post("/v1/clutches", json={"clutch_id": "c2"}).status_code == 201
        for name in ("c1", "c2"):
            post_tests(client, *(5000.0 * number for number in range(8)), to=name)
            for way, body in (("r35000", {"cycles": 36_000.0}), ("r10000/withdraw", {})):
                method = "PATCH" if body else "POST"
                body |= {"reason": "mistyped"}
                assert client.request(method, f"{RUNS.format(name)}/{way}", json=body).status_code == 200
    return path


def after_the_next_test(path: Path, clutch_id: str) -> tuple[int, Any]:
    """What a clutch's next test is answered, and the remaining life then, without what says when."""
    with client_on(f"sqlite:///{path}") as client:
        posted = client.post(RUNS.format(clutch_id), json=stationary(40_000.0, run_id="next"))
        if posted.status_code != 201:
            return posted.status_code, posted.json()["type"]
        remaining = client.get(f"/v1/clutches/{clutch_id}/remaining-useful-life").json()
    receipt = posted.json()
    for answer in (receipt, remaining):
        for name in ("received_at", "revision", "clutch_id"):
            answer.pop(name, None)
    return 201, [receipt, remaining]


@pytest.fixture(scope="module")
def intact(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Any]:
    return after_the_next_test(Path(shutil.copy(stored, tmp_path_factory.mktemp("intact") / "a.db")), "c1")


def changed_somewhere(path: Path, rng: random.Random) -> str:
    """Change a byte of one value of a row of the clutch c1, or a number by a little; what was changed."""
    tables = [table for table in metadata.sorted_tables if CHECKSUM in table.c and not table.name.startswith("alarm")]
    with closing(sqlite3.connect(path)) as connection, connection:
        while True:
            table = rng.choice(tables)
            column, _ = rng.choice(covered(table))
            if not {"clutch_id", "run_key"} & set(table.c.keys()) or column in table.primary_key.columns:
                continue
            name, where = table.name, OF_CLUTCH if "clutch_id" in table.c else OF_RUN
            if table.c[column].foreign_keys:
                continue
            rows = connection.execute(f"SELECT rowid, {column} FROM {name} WHERE {where}").fetchall()  # noqa: S608
            if not rows or (chosen := rng.choice(rows))[1] is None:
                continue
            row, value = chosen
            new = other(value, rng, of=table.c[column])
            connection.execute(f"UPDATE {name} SET {column} = ? WHERE rowid = ?", (new, row))  # noqa: S608
            return f"{column} of {name} {row}"


def other(value: Any, rng: random.Random, of: sa.Column[Any]) -> Any:
    if isinstance(value, (int, float)) and not isinstance(of.type, sa.Text):
        return value + 1 if isinstance(value, int) else value * 1.01 + 1e-9
    data = bytearray(value if isinstance(value, bytes) else value.encode())
    if not data:
        return b"x" if isinstance(value, bytes) else "x"
    place = rng.randrange(len(data))
    data[place] ^= 1
    return bytes(data) if isinstance(value, bytes) else data.decode(errors="replace")


@pytest.mark.parametrize("seed", range(40))
def test_a_value_that_was_changed_anywhere_is_found_and_leads_to_no_other_answer(
    stored: Path, intact: tuple[int, Any], tmp_path: Path, seed: int, caplog: pytest.LogCaptureFixture
) -> None:
    """A changed state or summary was carried on, and one unreadable value ended verify before the other clutches."""
    path = Path(shutil.copy(stored, tmp_path / "a.db"))
    what = changed_somewhere(path, random.Random(seed))  # noqa: S311
    with caplog.at_level(logging.CRITICAL):
        said = clutchlife("verify", "--database", f"sqlite:///{path}", code=1)
    assert "c1: " in said, what
    assert "c2: " not in said, what
    assert "16 runs of 2 clutches were checked" in said, what
    status, answer = after_the_next_test(path, "c1")
    assert (status, answer) in (intact, (503, "urn:clutchlife:problem:damaged")), what
    assert after_the_next_test(path, "c2") == intact, what
