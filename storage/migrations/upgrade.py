"""Bring a database to the code's revision: an empty one gets the tables as they are, an older one the steps that it lacks.

A step is named, and applied and recorded in the caller's transaction.

A new step is a file in `versions/` whose `revision` is its own name and whose `down_revision` is the step before.
Names begin with a number that increases: they alone say which revision is the newest, and Alembic is loaded only to migrate.
Steps only go forward: going back is restoring a backup.
"""

import os
import threading
from functools import cache
from pathlib import Path

import sqlalchemy as sa
from sqlalchemy import Connection

from storage.tables import metadata

# Alembic keeps the step that it runs in module globals: one at a time in a process.
_one_at_a_time = threading.Lock()


#: Where the steps are.
FOLDERS: tuple[Path, ...] = (Path(__file__).parent / "versions",)
#: Where Alembic records the revision.
_recorded = sa.table("alembic_version", sa.column("version_num", sa.String))


@cache
def head() -> str:
    """The revision that this code needs. Raises RuntimeError where the installation lacks the migrations."""
    if not revisions():
        raise RuntimeError("the migrations are missing from this installation")
    return max(revisions())


@cache
def revisions() -> frozenset[str]:
    """All revisions from which this code can migrate."""
    return frozenset(step.stem for folder in FOLDERS for step in folder.glob("s*.py"))


def current(connection: Connection) -> str | None:
    """The database's revision; None if it is empty."""
    if not sa.inspect(connection).has_table(_recorded.name):
        return None
    return connection.scalar(sa.select(_recorded.c.version_num))


def upgrade(connection: Connection) -> None:
    """Make all tables, or run the missing steps, without committing, in a database that is empty or at one of `revisions()`.

    The transaction must have been begun as a writing one.
    """
    from alembic import command  # start-up time: a database at the head needs no step
    from alembic.config import Config  # start-up time

    with _one_at_a_time:
        config = Config()
        # A % in a path would be read as interpolation.
        config.set_main_option("script_location", str(Path(__file__).parent).replace("%", "%%"))
        config.set_main_option("version_locations", os.pathsep.join(map(str, FOLDERS)).replace("%", "%%"))
        config.set_main_option("path_separator", "os")
        config.attributes["connection"] = connection
        if current(connection) is None:
            metadata.create_all(connection, checkfirst=False)
            command.stamp(config, "head")
        else:
            command.upgrade(config, "head")
