"""`clutchlife fleet`, `score`: the priors learned from clutches of a kind, and how right predictions were; works on the
database, while the service runs. `fleet` asks a service instead where one is named and no database is.
"""

import time
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from service.cli.options import (
    DATABASE,
    EX_USAGE,
    ChosenDatabase,
    Database,
    Key,
    Scheduler,
    ServiceUrl,
    err,
    errors_in_a_line,
    executor,
    existing,
    fail,
    print_line,
)
from service.client.clutchlife.transport import Service, connect

if TYPE_CHECKING:
    from service.api.fleet import ScoreSummary

app = typer.Typer(help="The priors learned from earlier clutches.")
#: [s] A request for a refresh waits for its end at most, and between two looks at it afterwards.
_WAIT, _LOOK = 10, 0.5


@app.callback(invoke_without_command=True)
def show(context: typer.Context, database: ChosenDatabase = None, url: ServiceUrl = None, key: Key = None) -> None:
    """The newest version of every kind's prior. A service is asked if you name one and no database."""
    if context.invoked_subcommand is not None:
        context.obj = (database, url, key)
        return
    if database is None and url is not None:
        with errors_in_a_line(), connect(url, key=key) as http:
            priors = list(Service(http=http, patience=10.0).pages("/v1/fleet/priors"))
    else:
        from service.answers.fleet_priors import page  # start-up time
        from service.paging import Part  # start-up time

        with existing(database or DATABASE, read_only=True) as opened:
            priors = [item.model_dump() for item in page(opened, Part()).items]
    for item in priors:
        print_line(_line(item))
    if not priors:
        print_line("no prior has been learned from a fleet yet: run `clutchlife fleet refresh`")


@app.command()
def refresh(
    context: typer.Context,
    database: ChosenDatabase = None,
    url: ServiceUrl = None,
    key: Key = None,
    scheduler: Scheduler = "local",
    quiet: Annotated[bool, typer.Option("--quiet", help="Print changes only")] = False,
) -> None:
    """Learn every kind's prior again, and update the predictions of clutches whose prior has changed. A service does it
    if you name one and no database."""
    database, url, key = database or context.obj[0], url or context.obj[1], key or context.obj[2]
    if database is None and url is not None:
        with errors_in_a_line(), connect(url, key=key) as http:
            _refresh_on_service(Service(http=http, patience=10.0), quiet=quiet)
        return
    from service.answers.fleet_priors import page  # start-up time
    from service.changes.learn_fleet import refresh as learn_priors  # start-up time
    from service.jobs.progress import progress  # start-up time
    from service.paging import Part  # start-up time

    now = datetime.now(UTC).isoformat(timespec="seconds")
    with (
        existing(database or DATABASE) as opened,
        executor(scheduler) as computing,
        progress(err, "learning") as advance,
    ):
        done = learn_priors(opened, computing, now=now, advance=advance)
        priors = page(opened, Part()).items
    for item in priors:
        new = item.kind in done.kinds
        if new or not quiet:
            print_line(_line(item.model_dump()) + (" (new)" if new else ""))
    for clutch_id in done.changed:
        print_line(f"{clutch_id}: predictions updated")
    for clutch_id, reason in done.left.items():
        print_line(f"{clutch_id}: {reason}")
    if not priors and not quiet:
        print_line(_NOTHING)


_NOTHING = (
    "nothing was learned: this needs three clutches of the same friction material, reaction plate, fluid and origin,"
    " with six tests each"
)


def _refresh_on_service(service: Service, *, quiet: bool) -> None:
    """Start a refresh on the service, wait until it has ended, and print its changes."""
    job = service.post("/v1/jobs", {"kind": "fleet_refresh"}, prefer=f"wait={_WAIT}")
    while job["state"] in ("waiting", "running"):
        time.sleep(_LOOK)
        job = service.get(f"/v1/jobs/{job['job_id']}")
    if job["state"] != "finished":
        fail(f"the refresh {job['state']}: {job['problem']}")
    result, priors = job["result"], list(service.pages("/v1/fleet/priors"))
    for item in priors if result["kinds"] or not quiet else ():
        print_line(_line(item))
    if result["changed"]:
        print_line(f"predictions updated: {result['changed']}")
    for left in result["reasons"]:
        print_line(f"{left['clutch_id']}: {left['reason']}")
    if not priors and not quiet:
        print_line(_NOTHING)


def _line(item: Mapping[str, Any]) -> str:
    """A fleet's prior as a printed line."""
    kind, population = item["kind"], item["population"]
    kind_text = f"{kind['friction_material']} on {kind['reaction_plate']} in {kind['fluid']}, {kind['origin']}"
    return (
        f"{kind_text}: version {item['version']}, {item['clutches']} clutches; "
        f"change {population['change']['median']:.2f} of the initial value, "
        f"scale {population['scale_cycles']['median']:.0f} cycles"
    )


def score(
    method: Annotated[
        str, typer.Option(help="The filter whose predictions are scored: particle, ukf or grid")
    ] = "particle",
    database: Database = DATABASE,
) -> None:
    """Score the prediction at every test of every life that has ended."""
    from service.answers import scores  # start-up time
    from service.api.life import MethodName  # start-up time
    from storage import clutches  # start-up time

    methods = get_args(MethodName)
    named: MethodName | None = next((name for name in methods if name == method), None)
    if named is None:
        fail(f"method must be one of {', '.join(methods)}, got {method!r}", EX_USAGE)
    with existing(database, read_only=True) as opened:
        with opened.reading() as connection:
            clutch_ids = clutches.all_ids(connection)
        fleet = scores.scores_of_fleet(
            (scores.scores_of_clutch(opened, name, named) for name in clutch_ids), method=named
        )
    for life in fleet.lives:
        print_line(f"{life.clutch_id}: ended at {life.end_of_life_cycles:.0f} cycles")
    if not fleet.lives:
        print_line("no clutch has reached its threshold yet: there is nothing to score")
        return
    print_line("share of life  predictions  CRPS/life  interval/life  coverage  alpha-lambda")
    for stage in fleet.stages:
        print_line(_score(f"{stage.share_of_life:.1f}", stage))
    print_line(_score("all", fleet.overall))


def _score(stage: str, means: "ScoreSummary") -> str:
    shares = (getattr(means, name) for name in ("crps_share", "interval_share", "coverage", "alpha_lambda"))
    columns = ["-" if value is None else f"{value:.3f}" for value in shares]
    return f"{stage:>13}  {means.predictions:>11}  {columns[0]:>9}  {columns[1]:>13}  {columns[2]:>8}  {columns[3]:>12}"
