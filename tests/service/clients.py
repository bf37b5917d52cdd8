"""Clients of a service in this process, and the databases that they begin with."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import pytest
from fastapi.testclient import TestClient
from pydantic import BaseModel
from typer.testing import CliRunner

from service.answers.store import to_json
from service.app import create_app
from service.cli.main import app as command_line
from service.settings import Settings
from tests.storage.samples import lay_empty


def clutchlife(*arguments: object, code: int = 0, answers: str = "") -> str:
    """Run a command in this process, with `answers` to its questions, and return what it printed."""
    called = list(map(str, arguments))
    done = CliRunner().invoke(command_line, called, input=answers, env={"COLUMNS": "200"}, catch_exceptions=False)
    assert done.exit_code == code, done.output
    return done.output


@cache
def _description() -> str:
    return json.dumps(create_app(Settings()).openapi())


def described() -> Any:
    """The description at /openapi.json: made once, for that takes a second, and a copy each, for libraries add to it."""
    return json.loads(_description())


@contextmanager
def client_on(database_url: str, **settings: Any) -> Iterator[TestClient]:
    """A client on this machine of a service on that database, in this process."""
    if database_url.startswith("sqlite:///"):
        lay_empty(Path(database_url.removeprefix("sqlite:///")))
    app = create_app(Settings(workers=0, database=database_url, **({"max_body_mb": 1} | settings)))
    here = {"base_url": "http://127.0.0.1", "client": ("127.0.0.1", 50000)}
    with TestClient(app, raise_server_exceptions=False, **here) as found:
        yield found


def post_run(client: TestClient, run: dict[str, Any], clutch_id: str = "c1") -> dict[str, Any]:
    """Post a run that is stored; its receipt."""
    answer = client.post(f"/v1/clutches/{clutch_id}/runs", json=run)
    assert answer.status_code == 201, answer.text
    return answer.json()


def as_answered(answer: BaseModel) -> Any:
    """An answer as a client reads it."""
    return json.loads(to_json(answer))


def csv_text(channels: dict[str, list[float]]) -> str:
    """Channels as a file of comma-separated values."""
    rows = zip(*channels.values(), strict=True)
    return "".join(line + "\n" for line in [",".join(channels), *(",".join(map(repr, row)) for row in rows)])


def _as_it_is(_client: TestClient) -> None:
    """Add nothing."""


@cache
def _laid(fill: Callable[[TestClient], object]) -> bytes:
    with TemporaryDirectory() as folder:
        with client_on(f"sqlite:///{folder}/a.db") as client:
            assert client.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
            fill(client)
        return Path(folder, "a.db").read_bytes()


@contextmanager
def client_of(path: Path, fill: Callable[[TestClient], object] = _as_it_is) -> Iterator[TestClient]:
    """A client of a service on a database with `c1` and what `fill` adds to it, made once and copied to `path`."""
    path.write_bytes(_laid(fill))
    with client_on(f"sqlite:///{path}") as client:
        yield client


def filled_client(
    fill: Callable[[TestClient], object] | None = None, *, scope: Literal["function", "module"] = "function"
) -> Any:
    """Makes of what fills a database with `c1` the fixture of a client on a copy of it, for a test or all of a module."""
    if fill is None:
        return partial(filled_client, scope=scope)

    @pytest.fixture(scope=scope)
    def found(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
        with client_of(tmp_path_factory.mktemp("filled") / "a.db", fill) as client:
            yield client

    return found
