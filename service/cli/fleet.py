"""`clutchlife fleet`: the priors learned from clutches of a kind; works on the database, while the service runs."""

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any

import typer

from service.cli.options import DATABASE, Database, Scheduler, err, executor, existing, out, read_only

if TYPE_CHECKING:
    from service.work.background import AtOnce
    from service.workflows.learn_fleet import Refreshed

app = typer.Typer(help="The priors learned from earlier clutches.")


@app.callback(invoke_without_command=True)
def show(context: typer.Context, database: Database = DATABASE) -> None:
    """The newest version of every kind's prior."""
    if context.invoked_subcommand is not None:
        return
    from service.queries.fleet_priors import newest  # start-up time

    with read_only(database) as opened:
        priors = newest(opened)
    for item in priors:
        out.print(_line(item), markup=False, soft_wrap=True)
    if not priors:
        out.print("no prior has been learned from a fleet yet: run `clutchlife fleet refresh`", markup=False)


@app.command()
def refresh(
    database: Database = DATABASE,
    scheduler: Scheduler = "local",
    quiet: Annotated[bool, typer.Option("--quiet", help="Print changes only")] = False,
) -> None:
    """Learn every kind's prior again, and update the predictions of clutches whose prior has changed."""
    from service.work.background import in_background  # start-up time
    from service.work.progress import progress  # start-up time

    def learn(at_once: "AtOnce") -> "tuple[Refreshed, list[dict[str, Any]]]":
        from service.queries.fleet_priors import newest  # start-up time, in the background
        from service.workflows.learn_fleet import refresh as learn_priors  # start-up time, in the background

        now = datetime.now(UTC).isoformat(timespec="seconds")
        return learn_priors(opened, now=now, at_once=at_once, executor=computing, advance=advance), newest(opened)

    with existing(database) as opened, executor(scheduler) as computing, progress(err, "learning") as advance:
        done, priors = in_background(learn)
    for item in priors:
        new = item["kind"] in done.kinds
        if new or not quiet:
            out.print(_line(item) + (" (new)" if new else ""), markup=False, soft_wrap=True)
    for clutch_id in done.changed:
        out.print(f"{clutch_id}: predictions updated", markup=False)
    for clutch_id, reason in done.left.items():
        out.print(f"{clutch_id}: {reason}", markup=False)
    if not priors and not quiet:
        out.print("no kind has three clutches with six tests each: all priors stay weak", markup=False)


def _line(item: dict[str, Any]) -> str:
    kind, population = item["kind"], item["population"]
    made = f"{kind['friction_material']} on {kind['reaction_plate']} in {kind['fluid']}, {kind['origin']}"
    return (
        f"{made}: version {item['version']}, {item['clutches']} clutches; "
        f"change {population['change']['median']:.2f} of the initial value, "
        f"scale {population['scale_cycles']['median']:.0f} cycles"
    )
