"""`clutchlife raw`: where long raw records are kept, moved to another place, and freed of what no run names."""

from typing import Annotated

import typer
from rich.progress import Progress

from service.cli.options import DATABASE, Database, err, existing, print_line

app = typer.Typer(help="Where long raw records are kept beside the database.", no_args_is_help=True)

_SECONDS_AN_HOUR = 3600.0
#: Hours that a blob may be without a run that names it. Chosen: no run takes longer from its arrival to its commit, nor do
#: the clocks of a store and of this machine differ by more; the least that is allowed is what a single run may take.
_GRACE_HOURS, _MIN_GRACE_HOURS = 24.0, 1.0

Address = Annotated[str, typer.Option("--to", help="database, folder:///path or s3://bucket/prefix")]


@app.command("list")
def list_stores(database: Database = DATABASE) -> None:
    """Show every place in which long raw records are, how many columns and blobs, and which place new ones go to."""
    from storage.blobs import raw_stores  # start-up time

    with existing(database) as opened, opened.reading() as connection:
        stores, numbers = raw_stores.all_of(connection), raw_stores.numbers(connection)
    for store in stores:
        columns, blobs = numbers.get(store.address, (0, 0))
        used = ", in use" if store.in_use else ""
        print_line(f"{store.address}: {columns} columns in {blobs} blobs{used}")
    if not any(store.in_use for store in stores):
        print_line("new raw records go into the database")


@app.command()
def move(to: Address, database: Database = DATABASE) -> None:
    """Have new long raw records go to an address, and take those that are stored there too.

    May run beside the service, and be interrupted and repeated. What is left in the former place `collect` removes.
    """
    from service.workflows.raw_records import move as move_all  # start-up time

    with existing(database) as opened, Progress(console=err, transient=True) as progress:
        task = progress.add_task("moving columns", total=None)
        moved = move_all(opened, to, tell=lambda count: progress.update(task, completed=count))
    print_line(f"{moved} columns are moved")


@app.command()
def relocate(
    address: Annotated[str, typer.Argument(help="Where they were, as `list` shows it")],
    to: Address,
    database: Database = DATABASE,
) -> None:
    """Look for the raw records of one store at another address, to which the whole store was copied by other means.

    All must be there. A run that comes in meanwhile is refused, or the command is: then copy and try again.
    """
    from service.workflows.raw_records import relocate as look_at  # start-up time

    with existing(database) as opened:
        count = look_at(opened, address, to)
    print_line(f"{count} blobs are looked for there")


@app.command()
def collect(
    database: Database = DATABASE,
    grace_hours: Annotated[
        float, typer.Option(min=_MIN_GRACE_HOURS, help="What was put within so many hours is left")
    ] = _GRACE_HOURS,
) -> None:
    """Remove blobs that no run names, as interrupted posts and moves leave them. Safe while services run."""
    from service.workflows.raw_records import collect as collect_all  # start-up time

    with existing(database) as opened:
        for store in collect_all(opened, grace=grace_hours * _SECONDS_AN_HOUR):
            line = f"{store.address}: {store.named} blobs in use, {store.removed} removed, {store.new} too new to be removed"
            print_line(line)
