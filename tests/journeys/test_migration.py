"""A service's database goes from a file to a server and back: its answers and every table are the same."""

from pathlib import Path

import pytest

from tests.journeys.test_postgresql import ENVIRONMENT, asked, fill
from tests.storage.engine.postgresql.server import PostgresServer
from tests.storage.test_transfer import digests
from tests.support import clutchlife, serving


@pytest.mark.slow
def test_there_and_back_answers_and_tables_are_the_same(tmp_path: Path, postgresql: PostgresServer) -> None:
    on_server = postgresql.empty()
    in_file, back = (f"sqlite:///{tmp_path}/{name}.db" for name in ("first", "back"))
    with serving(in_file, loaded=True, environment=ENVIRONMENT) as server:
        fill(server.url)
        answers = asked(server)
        running = clutchlife("migrate", "--from", in_file, "--to", on_server, code=1)
        assert "a service uses this database already" in running
    before = digests(in_file)
    said = clutchlife("migrate", "--from", in_file, "--to", on_server)
    assert f"{sum(rows for rows, _ in before.values())} rows of 5 clutches are the same in both databases" in said
    assert "must be empty" in clutchlife("migrate", "--from", in_file, "--to", on_server, code=1)
    assert digests(on_server) == before
    clutchlife("migrate", "--from", on_server, "--to", back)
    assert digests(back) == before
    assert " 0 findings" in clutchlife("verify", "--sample", "1", "--database", back)
    for address in (on_server, back):
        with serving(address, loaded=True, environment=ENVIRONMENT) as server:
            again = asked(server)
        assert again.keys() == answers.keys()
        assert [name for name, answer in answers.items() if again[name] != answer] == []
    postgresql.drop(on_server)
