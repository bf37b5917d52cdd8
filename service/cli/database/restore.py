"""`clutchlife restore`: a backup is put back."""

from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import DATABASE, Database, errors_in_a_line, out, require_file


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
    out.print(f"{backup} is in the place of {database}", markup=False, soft_wrap=True)
    if kept is not None:
        out.print(f"what was there is kept as {kept}", markup=False, soft_wrap=True)
