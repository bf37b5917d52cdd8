"""`clutchlife fleet`: what clutches of a kind have taught; works on the database, while the service runs."""

from datetime import UTC, datetime
from typing import Annotated, Any

import typer

from service.cli.options import DATABASE, Database, existing, out

app = typer.Typer(help="The priors that earlier clutches taught.")


@app.callback(invoke_without_command=True)
def show(context: typer.Context, database: Database = DATABASE) -> None:
    """The newest version of every kind's prior."""
    if context.invoked_subcommand is not None:
        return
    from service.queries.fleet_priors import newest  # loaded by the commands that need it

    with existing(database) as opened:
        priors = newest(opened)
    for item in priors:
        out.print(_line(item), markup=False, soft_wrap=True)
    if not priors:
        out.print("no fleet has taught a prior yet: run `clutchlife fleet refresh`", markup=False)


@app.command()
def refresh(
    database: Database = DATABASE,
    quiet: Annotated[bool, typer.Option("--quiet", help="Say only what has changed")] = False,
) -> None:
    """Learn every kind's prior anew, and bring the predictions up to date with it."""
    from service.queries.fleet_priors import newest  # loaded by the commands that need it
    from service.workflows.learn_fleet import refresh as refreshed  # as above

    with existing(database) as opened:
        done = refreshed(opened, now=datetime.now(UTC).isoformat(timespec="seconds"))
        priors = newest(opened)
    for item in priors:
        new = item["kind"] in done.kinds
        if new or not quiet:
            out.print(_line(item) + (" (new)" if new else ""), markup=False, soft_wrap=True)
    for clutch_id in done.changed:
        out.print(f"{clutch_id}: tracked anew", markup=False)
    if not priors and not quiet:
        out.print("no three clutches of a kind have six tests each: all priors stay weak", markup=False)


def _line(item: dict[str, Any]) -> str:
    kind, population = item["kind"], item["population"]
    made = f"{kind['friction_material']} on {kind['reaction_plate']} in {kind['fluid']}, {kind['origin']}"
    return (
        f"{made}: version {item['version']}, {item['clutches']} clutches; "
        f"change {population['change']['median']:.2f} of the initial value, "
        f"scale {population['scale_cycles']['median']:.0f} cycles"
    )
