"""Bring a database to the code's revision: an empty one gets the tables as they are, an older one the steps that it lacks.

A step is named, and applied and recorded in the caller's transaction.

A new step is a file in `versions/` whose `revision` is its own name and whose `down_revision` is the step before.
Steps only go forward: going back is restoring a backup.
"""

import threading
from functools import cache
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection

from storage.tables import metadata

# Alembic keeps the step that it runs in module globals: one at a time in a process.
_one_at_a_time = threading.Lock()


def _config() -> Config:
    config = Config()
    # A % in a path would be read as interpolation.
    config.set_main_option("script_location", str(Path(__file__).parent).replace("%", "%%"))
    config.set_main_option("path_separator", "os")
    return config


@cache
def head() -> str:
    """The revision that this code needs."""
    revision = ScriptDirectory.from_config(_config()).get_current_head()
    if revision is None:
        raise RuntimeError("the migrations are missing from this installation")
    return revision


@cache
def revisions() -> frozenset[str]:
    """All revisions that this code can bring to the head."""
    return frozenset(step.revision for step in ScriptDirectory.from_config(_config()).walk_revisions())


def current(connection: Connection) -> str | None:
    """The revision that the database is at; None where it is empty."""
    return MigrationContext.configure(connection).get_current_revision()


def upgrade(connection: Connection) -> None:
    """Make all tables, or run the missing steps, without committing, in a database that is empty or at one of `revisions()`.

    The transaction must have been begun as a writing one.
    """
    with _one_at_a_time:
        config = _config()
        config.attributes["connection"] = connection
        if current(connection) is None:
            metadata.create_all(connection, checkfirst=False)
            command.stamp(config, "head")
        else:
            command.upgrade(config, "head")
