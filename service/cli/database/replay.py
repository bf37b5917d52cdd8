"""`clutchlife replay`: all results computed again, on the database itself."""

from typing import TYPE_CHECKING, Annotated

import typer

from service.cli.options import DATABASE, Database, Scheduler, err, executor, existing, fail, print_line

if TYPE_CHECKING:
    from service.work.background import AtOnce


def replay(
    clutch_ids_given: Annotated[list[str] | None, typer.Argument(metavar="[ID...]", help="Left out: all")] = None,
    database: Database = DATABASE,
    scheduler: Scheduler = "local",
) -> None:
    """Recompute all results from the raw runs, with the code that is installed now.

    A clutch with a run that this code cannot evaluate keeps the results that it has; the others are gone on with.
    """
    from service.work.background import in_background  # start-up time: only this command needs it
    from service.work.progress import progress  # start-up time: only this command needs it

    def replay_all(at_once: "AtOnce") -> list[str]:
        from service.workflows import replay as workflow  # start-up time, in the background

        wanted, left = clutch_ids_given or workflow.clutch_ids(opened), []
        advance(0, total=len(wanted))
        for replayed in workflow.replay(opened, wanted, computing, at_once=at_once):
            if replayed.error is not None:
                left.append(replayed.clutch_id)
                err.print(f"{replayed.clutch_id}: not replayed: {replayed.error}", markup=False, soft_wrap=True)
            else:
                print_line(f"{replayed.clutch_id}: {replayed.runs} runs")
            advance()
        return left

    with existing(database) as opened, executor(scheduler) as computing, progress(err, "replaying") as advance:
        left = in_background(replay_all)
    if left:
        fail(f"{len(left)} clutches keep the results that they had: {', '.join(left)}")
