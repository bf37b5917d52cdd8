"""`clutchlife simulate`: a simulated campaign, a file a run."""

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from service.cli.options import Seed, err, out, told
from service.formats import run_files


def simulate(
    out_folder: Annotated[Path, typer.Option("--out", help="The folder to write to")],
    seed: Seed = 7,
) -> None:
    """Simulate a clutch's life on the rig and write it, a file a run; `clutchlife push` sends it."""
    from models.rig import campaign  # what only this command needs is loaded by it alone
    from service.formats import simulated

    with told():
        out_folder.mkdir(parents=True, exist_ok=True)
        clutch_id = f"sim-{seed}"
        run_files.write(out_folder / run_files.CLUTCH_FILE, simulated.simulated_clutch_body(clutch_id))
        written = 0
        with Progress(console=err, transient=True) as progress:
            task = progress.add_task("simulating", total=None)
            for run in campaign.simulate(seed):
                run_files.write(out_folder / f"{run.run_id}.json", simulated.simulated_body(run))
                written += 1
                progress.update(task, description=f"simulating, {run.cycles} cycles", advance=1)
        end = campaign.simulated_clutch(seed).end_of_life()
        truth = "never" if end is None else f"after {end:.0f} cycles"
        out.print(f"{written} simulated runs of the simulated clutch {clutch_id} in {out_folder}", soft_wrap=True)
        out.print(f"the truth: its mean COF has halved {truth}")
