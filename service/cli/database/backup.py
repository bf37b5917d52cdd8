"""`clutchlife backup`: a consistent copy of the database."""

from contextlib import closing
from pathlib import Path

from service.cli.options import DATABASE, Database, err, errors_in_a_line, out, require_database, require_file
from storage.engine.errors import DatabaseTooOld


def backup(path: Path, database: Database = DATABASE) -> None:
    """A consistent copy of the database at PATH, as it is, while the service runs."""
    from storage.engine.sqlite.database import back_up  # start-up time

    with errors_in_a_line():
        require_file(database, "back it up with pg_dump --format=custom")
        require_database(database)
        back_up(database, path)
        left_out = _left_out(path)
    out.print(str(path), markup=False, soft_wrap=True)
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
