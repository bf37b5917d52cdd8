"""`clutchlife backup`: a consistent copy of the database."""

from pathlib import Path

from service.cli.options import DATABASE, Database, errors_in_a_line, out, require_database, require_file


def backup(path: Path, database: Database = DATABASE) -> None:
    """A consistent copy of the database at PATH, as it is, while the service runs."""
    from storage.engine.sqlite.database import back_up  # start-up time

    with errors_in_a_line():
        require_file(database, "back it up with pg_dump --format=custom")
        require_database(database)
        back_up(database, path)
    out.print(str(path), markup=False, soft_wrap=True)
