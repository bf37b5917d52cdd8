"""`clutchlife replay`: all results computed anew, on the database itself."""

from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import Progress

from service.cli.options import DATABASE, Database, err, existing, fail, out
from service.errors import ServiceError
from storage.engine.errors import DamagedData

if TYPE_CHECKING:
    from service.background import AtOnce


def replay(
    clutch_ids_given: Annotated[list[str] | None, typer.Argument(metavar="[ID...]", help="Left out: all")] = None,
    database: Database = DATABASE,
) -> None:
    """Recompute all results from the raw runs, with the code that is installed now.

    A clutch with a run that this code cannot evaluate keeps the results that it has; the others are gone on with.
    """
    from service.background import in_background  # start-up time: only this command needs it

    def replay_all(at_once: "AtOnce") -> list[str]:
        from service.workflows.replay import clutch_ids, replay_clutch  # start-up time, in the background

        wanted, left = clutch_ids_given or clutch_ids(opened), []
        task = progress.add_task("replaying", total=len(wanted))
        for clutch_id in wanted:
            try:
                runs = replay_clutch(opened, clutch_id, at_once)
            except (ServiceError, DamagedData) as error:
                left.append(clutch_id)
                err.print(f"{clutch_id}: not replayed: {error}", markup=False, soft_wrap=True)
            else:
                out.print(f"{clutch_id}: {runs} runs", markup=False)
            progress.advance(task)
        return left

    with existing(database) as opened, Progress(console=err, transient=True) as progress:
        left = in_background(replay_all)
    if left:
        fail(f"{len(left)} clutches keep the results that they had: {', '.join(left)}")
