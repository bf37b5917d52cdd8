"""The last computed answers, which the services on a server share."""

from contextlib import closing
from dataclasses import replace

import pytest
from sqlalchemy import text

from storage import clutches
from storage.engine.database import Database, SharedAnswer, SharedAnswers
from storage.engine.opening import open_database
from tests.storage.samples import clutch_row

FIRST = SharedAnswer(clutch_id="c1", name="degradation", release="1.0", revision=3, body=b"\x00first")


@pytest.fixture
def shared(on_server: Database) -> SharedAnswers:
    assert on_server.answers is not None
    return on_server.answers


def test_the_last_of_each_clutch_and_name_is_kept(shared: SharedAnswers) -> None:
    assert shared.newest("c1", "degradation", "1.0") is None
    for kept in (FIRST, replace(FIRST, clutch_id="c2"), replace(FIRST, name="surface", body=b"other")):
        shared.keep(kept)
        assert shared.newest(kept.clutch_id, kept.name, "1.0") == kept
    later = replace(FIRST, revision=4, body=b"later")
    shared.keep(later)
    shared.keep(FIRST)  # of one that was slower
    assert shared.newest("c1", "degradation", "1.0") == later


def test_another_release_computes_its_own_and_replaces_it(shared: SharedAnswers) -> None:
    shared.keep(FIRST)
    assert shared.newest("c1", "degradation", "2.0") is None
    shared.keep(replace(FIRST, release="2.0", revision=2))
    assert shared.newest("c1", "degradation", "1.0") is None
    assert shared.newest("c1", "degradation", "2.0") == replace(FIRST, release="2.0", revision=2)


def test_a_database_of_before_gets_the_table_and_counts_its_commits_on(on_server: Database) -> None:
    with on_server.writing() as connection:
        clutches.insert(connection, clutch_row("c1"))
    with on_server.writing() as connection:
        connection.execute(text("DROP TABLE shared_answer"))
    counted = on_server.watch.snapshot().version
    with closing(open_database(on_server.url)) as opened:
        assert opened.answers is not None
        opened.answers.keep(FIRST)
        assert opened.watch.snapshot().version == counted + 1  # of the commit that made the table
