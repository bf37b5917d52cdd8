"""`clutchlife key`: make, list and revoke keys; works on the database, so it needs the machine that holds it."""

from contextlib import closing
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import DATABASE, EX_USAGE, Database, errors_in_a_line, existing, fail, print_line

if TYPE_CHECKING:
    from storage.keys import KeyRow

app = typer.Typer(help="Keys for the service.", no_args_is_help=True)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


@app.command()
def create(
    scope: Annotated[
        str,
        typer.Option(
            help="What the key may do: read, ingest (read, and add runs, clutches and diagnoses) or admin (everything)"
        ),
    ],
    note: Annotated[str, typer.Option(help="Who or what the key is for")] = "",
    clutch: Annotated[
        list[str] | None, typer.Option(help="A clutch that the key may use; may be repeated; default: all")
    ] = None,
    expires: Annotated[float | None, typer.Option(min=0, help="Days until the key expires; default: never")] = None,
    database: Database = DATABASE,
) -> None:
    """Print a new key, once; only its hash is stored."""
    from service.web.auth import SCOPES, make_key  # start-up time
    from storage import keys  # start-up time
    from storage.engine.opening import open_database  # start-up time

    if scope not in SCOPES:
        fail(f"scope must be one of {', '.join(SCOPES)}, got {scope!r}", EX_USAGE)
    secret, row = make_key(scope, note, created_at=_now(), clutches=clutch or None, days=expires)
    with errors_in_a_line(), closing(open_database(database)) as opened, opened.writing() as connection:
        keys.insert(connection, row)
    print_line(secret)


@app.command(name="list")
def list_keys(database: Database = DATABASE) -> None:
    """List all keys: name, scope, creation, validity, last use (to the hour), and clutches."""
    from storage import keys  # start-up time

    with existing(database, read_only=True) as opened, opened.reading() as connection:
        rows = keys.all_keys(connection)
    if not rows:
        print_line("no key exists")
    for row in rows:
        used = "never used" if row.last_used_at is None else f"used {row.last_used_at}"
        clutches = "" if row.clutches is None else f"  only {', '.join(row.clutches)}"
        print_line(f"{row.key_id}  {row.scope:<6}  {row.created_at}  {_state(row)}  {used}{clutches}  {row.note}")


def _state(row: "KeyRow") -> str:
    if row.revoked_at is not None:
        return f"revoked {row.revoked_at}"
    if row.expires_at is None:
        return "active"
    return f"expired {row.expires_at}" if row.expires_at <= _now() else f"active until {row.expires_at}"


@app.command()
def revoke(key_id: str, database: Database = DATABASE) -> None:
    """End a key by its name (the eight digits after `clutchlife_`)."""
    from storage import keys  # start-up time

    with existing(database) as opened, opened.writing() as connection:
        done = keys.revoke(connection, key_id, _now())
    if not done:
        fail(f"there is no active key {key_id!r}: see clutchlife key list")
