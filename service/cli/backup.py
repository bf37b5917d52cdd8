"""`clutchlife backup`: a consistent copy of the database."""

from pathlib import Path

from service.cli.options import DATABASE, Database, existing, out


def backup(path: Path, database: Database = DATABASE) -> None:
    """A consistent copy of the database at PATH, while the service runs."""
    with existing(database) as opened:
        opened.backup(path)
    out.print(str(path), markup=False)
