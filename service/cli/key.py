"""`clutchlife key`: make, list and revoke keys; works on the database, so it needs the machine that holds it."""

from contextlib import closing
from datetime import UTC, datetime
from typing import Annotated

import typer

from service.cli.options import DATABASE, EX_USAGE, Database, errors_in_a_line, existing, fail, out

app = typer.Typer(help="Keys for the service.", no_args_is_help=True)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


@app.command()
def create(
    scope: Annotated[str, typer.Option(help="read, ingest (may post runs too) or admin")],
    note: Annotated[str, typer.Option(help="Who or what it is for")] = "",
    database: Database = DATABASE,
) -> None:
    """Print a new key, once; only its hash is stored."""
    from service.web.auth import SCOPES, make_key  # start-up time
    from storage import keys  # start-up time
    from storage.engine.database import open_database  # start-up time

    if scope not in SCOPES:
        fail(f"scope must be one of {', '.join(SCOPES)}, got {scope!r}", EX_USAGE)
    secret, row = make_key(scope, note, created_at=_now())
    with errors_in_a_line(), closing(open_database(database)) as opened, opened.writing() as connection:
        keys.insert(connection, row)
    out.print(secret, markup=False, soft_wrap=True)


@app.command(name="list")
def list_keys(database: Database = DATABASE) -> None:
    """All keys: name, scope, when made, when revoked."""
    from storage import keys  # start-up time

    with existing(database) as opened, opened.reading() as connection:
        rows = keys.all_keys(connection)
    for row in rows:
        state = f"revoked {row.revoked_at}" if row.revoked_at else "active"
        out.print(f"{row.key_id}  {row.scope:<6}  {row.created_at}  {state}  {row.note}", markup=False)


@app.command()
def revoke(key_id: str, database: Database = DATABASE) -> None:
    """End a key by its name (the eight digits after `clutchlife_`)."""
    from storage import keys  # start-up time

    with existing(database) as opened, opened.writing() as connection:
        done = keys.revoke(connection, key_id, _now())
    if not done:
        fail(f"there is no active key {key_id!r}")
