"""`clutchlife restore`: a backup is put back; or, with a clutch and a run, a withdrawal is taken back."""

from pathlib import Path
from typing import Annotated

import typer

from service.cli.changes import run_changes
from service.cli.options import (
    DATABASE,
    EX_USAGE,
    URL,
    Database,
    Key,
    Patience,
    Url,
    errors_in_a_line,
    fail,
    out,
    require_file,
)


def restore(
    backup_or_clutch: Annotated[str, typer.Argument(metavar="BACKUP|ID", help="A backup; or the clutch of a run")],
    run: Annotated[str | None, typer.Argument(metavar="[RUN]", help="The run whose withdrawal is taken back")] = None,
    database: Database = DATABASE,
    reason: Annotated[str | None, typer.Option(help="Of a run: why; the audit trail keeps it")] = None,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Put the file BACKUP in the place of the database, which is kept beside it; or take the withdrawal of RUN back.

    No service may use the database meanwhile. A backup of an earlier release is migrated when the service starts.
    """
    if run is not None:
        if reason is None:
            fail("a run is restored for a reason: give --reason", EX_USAGE)
        run_changes.restore(backup_or_clutch, run, reason, url, key, patience)
        return
    from storage.engine.sqlite.backup import restore as put_back  # start-up time

    with errors_in_a_line():
        require_file(database, "put a dump back with pg_restore, while no service runs")
        kept = put_back(database, Path(backup_or_clutch))
    out.print(f"{backup_or_clutch} is in the place of {database}", markup=False, soft_wrap=True)
    if kept is not None:
        out.print(f"what was there is kept as {kept}", markup=False, soft_wrap=True)
