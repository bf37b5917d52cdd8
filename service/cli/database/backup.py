"""`clutchlife backup`, `restore`: a consistent copy of the database, and such a copy put back."""

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import DATABASE, Database, err, errors_in_a_line, print_line, require_database, require_file
from storage.engine.errors import DatabaseTooOld


def backup(path: Path, database: Database = DATABASE) -> None:
    """A consistent copy of the database at PATH, as it is, while the service runs."""
    from storage.engine.sqlite.database import back_up  # start-up time

    with errors_in_a_line():
        require_file(database, "back it up with pg_dump --format=custom")
        require_database(database)
        back_up(database, path)
        left_out = _left_out(path)
    print_line(str(path))
    for address, blobs in left_out.items():
        line = f"{blobs} raw records are not in it, they are in {address}: copy that now, after the database"
        err.print(line, markup=False, soft_wrap=True)


def _left_out(path: Path) -> dict[str, int]:
    """How many blobs the copy names in which store; an earlier revision names none."""
    from storage.blobs import raw_stores  # start-up time
    from storage.engine.opening import find_database  # start-up time

    with closing(find_database(f"sqlite:///{path.absolute()}")) as copied:
        try:
            with copied.reading() as connection:
                return {address: blobs for address, (_, blobs) in raw_stores.numbers(connection).items()}
        except DatabaseTooOld:
            return {}


def restore(
    backup: Annotated[Path, typer.Argument(metavar="BACKUP", help="A backup, made by clutchlife backup")],
    database: Database = DATABASE,
) -> None:
    """Put the file BACKUP in the place of the database, which is kept beside it.

    No service may use the database meanwhile. A backup of an earlier release is migrated when the service starts.
    """
    from storage.engine.sqlite.backup import restore as put_back  # start-up time

    with errors_in_a_line():
        require_file(database, "put a dump back with pg_restore, while no service runs")
        kept = put_back(database, backup)
    print_line(f"{backup} is in the place of {database}")
    if kept is not None:
        print_line(f"what was there is kept as {kept}")
