"""`clutchlife replay`: all results computed anew, on the database itself."""

from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import Progress

from service.cli.options import DATABASE, Database, err, existing, out

if TYPE_CHECKING:
    from service.background import AtOnce


def replay(
    clutch_ids_given: Annotated[list[str] | None, typer.Argument(metavar="[ID...]", help="Left out: all")] = None,
    database: Database = DATABASE,
) -> None:
    """Recompute all results from the raw runs, with the code that is installed now."""
    from service.background import in_background  # start-up time: only this command needs it

    def replay_all(at_once: "AtOnce") -> None:
        from service.workflows.replay import clutch_ids, replay_clutch  # start-up time, in the background

        wanted = clutch_ids_given or clutch_ids(opened)
        task = progress.add_task("replaying", total=len(wanted))
        for clutch_id in wanted:
            runs = replay_clutch(opened, clutch_id, at_once)
            out.print(f"{clutch_id}: {runs} runs", markup=False)
            progress.advance(task)

    with existing(database) as opened, Progress(console=err, transient=True) as progress:
        in_background(replay_all)
