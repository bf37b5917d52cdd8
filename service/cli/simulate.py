"""`clutchlife simulate`: a simulated campaign, a file a run."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from service.cli.options import EX_USAGE, Seed, err, errors_in_a_line, fail, out, print_line, spinning
from service.client.clutchlife.answers import JsonObject
from service.runs import manifest

if TYPE_CHECKING:
    from models.rig.programme import RigProgramme
    from models.rig.simulated_runs import SimulatedRun
    from service.runs.record_writer import RecordFormat

#: The campaign ends at this share of the mean COF when new. Chosen: a little below the end of life at 0.5.
_STOP = 0.45


def simulate(
    out_folder: Annotated[Path, typer.Option("--out", help="The folder to write to")],
    seed: Seed = 7,
    form: Annotated[
        Literal["json", "csv", "tdms", "mdf4"], typer.Option("--format", help="Format of the tests' files")
    ] = "json",
    raw: Annotated[bool, typer.Option("--raw", help="Write stationary tests as sampled records")] = False,
    raw_rate: Annotated[float, typer.Option(min=10, max=2000, help="Sampling rate of raw records [Hz]")] = 100.0,
    dynamic: Annotated[bool, typer.Option(help="Simulate dynamic tests too")] = True,
    ageing: Annotated[Literal["cycles", "energy"], typer.Option(help="What ages the clutch")] = "cycles",
    noise: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=0.2,
            help="Standard deviation of a plateau's torque, as a share of it; default: that of the reference",
        ),
    ] = None,
    tests: Annotated[
        int, typer.Option(min=1, help="End after this number of stationary tests, or earlier if the clutch is worn")
    ] = 40,
    hide: Annotated[
        list[str] | None,
        typer.Option(metavar="EFFECT[:SIZE]", help="Hide an effect, to rehearse a diagnosis; may be repeated"),
    ] = None,
    film: Annotated[
        bool, typer.Option("--film", help="Add the lag of friction from the reference's oil film; answer.json says so")
    ] = False,
    plate_rise: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=500,
            help="Write the plate's temperature too; the value is its rise above the oil at 0.32 W/mm², in K",
        ),
    ] = None,
    frequency: Annotated[
        list[float] | None,
        typer.Option(
            min=0.01, max=5, help="Frequency of the speed in dynamic tests, in Hz; repeat it to test at several"
        ),
    ] = None,
    pressures: Annotated[
        list[float] | None, typer.Option(min=4, max=8, help="Pressure of the tests in bar; repeat it for several")
    ] = None,
    plan: Annotated[
        Path | None,
        typer.Option(
            help="Run this plan of a diagnosis (CSV or JSON) on the clutch in --out; combine it only with --alternative"
        ),
    ] = None,
    alternative: Annotated[int, typer.Option(min=1, help="Number of the alternative to run; 1 is the best")] = 1,
) -> None:
    """Simulate a clutch's life on the rig, and write one file per run. `clutchlife push` sends the files.

    The folder `inspections` gets the lining's roughness and skewness at each stationary test.

    Without --hide a diagnosis finds nothing. `answer.json` beside the runs has the true end of life, the hidden
    effects and the film; push does not send it. To see all effects, give --hide a wrong name.

    Run-in and duty blocks are always JSON. Tests in another format are listed in runs.json, which push reads.
    """
    from models.rig import campaign, hidden, stationary, temperatures, truth  # start-up time
    from models.rig.simulated_runs import RunKind  # start-up time
    from service.runs import record_writer, simulated  # start-up time

    with errors_in_a_line():
        if plan is not None:
            _run_plan(out_folder, plan, alternative)
            return
        record_format = record_writer.RecordFormat(form)
        record_writer.require_writer(record_format)
        programme = _programme(raw_rate if raw else None, dynamic, ageing, frequency or [], pressures or [])
        sizes = _sizes(hide or [])
        out_folder.mkdir(parents=True, exist_ok=True)
        clutch, clutch_id = campaign.simulated_clutch(seed), f"sim-{seed}"
        if film:
            sizes.setdefault("squeeze_film", clutch.lag.film_time)
        clutch = hidden.clutch_for(clutch, sizes)
        manifest.write(out_folder / manifest.CLUTCH_FILE, simulated.simulated_clutch_body(clutch_id))
        wear_and_cycles: list[tuple[float, float]] = []
        inspections = 0
        listed: list[JsonObject] = []
        with spinning(err) as progress:
            task = progress.add_task("run-in", total=clutch.end_of_life(_STOP))
            sensor = stationary.SHARP if noise is None else replace(stationary.SHARP, noise=noise)
            runs = campaign.simulate(
                seed, clutch=clutch, sensor=sensor, programme=programme, stop_fraction=_STOP, most_tests=tests
            )
            for run in runs:
                description = f"{run.kind.value.replace('_', ' ')}, {run.cycles} cycles"
                progress.update(task, description=description, completed=run.wear)
                record = hidden.hidden_in(run, clutch, sizes)
                if plate_rise is not None:
                    record = temperatures.with_plate(record, clutch.geometry, plate_rise)
                listed += _write(out_folder, record, record_format)
                if run.kind is RunKind.STATIONARY_STRIBECK:
                    inspection = simulated.simulated_inspection(truth.surface(clutch, run.wear), run.cycles)
                    (out_folder / manifest.INSPECTIONS).mkdir(exist_ok=True)
                    name = f"inspection-{run.cycles:05.0f}.json"
                    manifest.write(out_folder / manifest.INSPECTIONS / name, inspection)
                    inspections += 1
                wear_and_cycles.append((run.wear, run.cycles))
        if listed:
            manifest.write(out_folder / manifest.MANIFEST, listed)
        end = campaign.end_of_life(wear_and_cycles, clutch)
        halving = "does not halve in this campaign" if end is None else f"halves after {end:.0f} cycles"
        wear, last = wear_and_cycles[-1]
        answer = {
            "seed": seed,
            "hidden": hidden.described(sizes),
            "halved_at_cycles": clutch.end_of_life() if ageing == "cycles" else end,
            "cycles": last,
            "wear": wear,
            "noise": sensor.noise,
            "ageing": ageing,
            "plate_rise": plate_rise,
            "planned_tests": 0,
        }
        manifest.write(out_folder / manifest.ANSWER, answer)
        made_so_far = f"{len(wear_and_cycles)} simulated runs and {inspections} inspections"
        out.print(f"{made_so_far} of {clutch_id} in {out_folder}", markup=False, soft_wrap=True)
        out.print(f"the true mean COF {halving}")


def _run_plan(folder: Path, plan: Path, alternative: int) -> None:
    """Run one test of a plan on the clutch of a simulated campaign, as described in the folder's `answer.json`."""
    from models.rig import campaign, hidden, stationary, temperatures  # start-up time
    from models.rig.programme import Ageing  # start-up time
    from service.runs import simulated  # start-up time

    if not (folder / manifest.ANSWER).is_file():
        fail(f"{folder} holds no simulated campaign: give the folder in which you simulated the clutch", EX_USAGE)
    answer = json.loads((folder / manifest.ANSWER).read_bytes())
    sizes = {effect["effect"]: effect["size"] for effect in answer["hidden"]}
    clutch = hidden.clutch_for(campaign.simulated_clutch(answer["seed"]), sizes)
    runs = campaign.planned(
        answer["seed"],
        simulated.planned_tests(plan, alternative),
        clutch=clutch,
        sensor=replace(stationary.SHARP, noise=answer["noise"]),
        ageing=Ageing(answer["ageing"]),
        cycles=answer["cycles"],
        wear=answer["wear"],
        made=answer["planned_tests"],
    )
    for run in runs:
        record = hidden.hidden_in(run, clutch, sizes)
        if answer["plate_rise"] is not None:
            record = temperatures.with_plate(record, clutch.geometry, answer["plate_rise"])
        manifest.write(folder / f"{record.run_id}.json", simulated.simulated_body(record))
        answer |= {"cycles": record.cycles, "wear": record.wear}
        answer["planned_tests"] += record.duty is None
        print_line(f"{record.kind.value.replace('_', ' ')} at {record.cycles} cycles: {record.run_id}")
    manifest.write(folder / manifest.ANSWER, answer)
    print_line(f"now push {folder} again, and diagnose")


def _programme(
    raw_rate: float | None, dynamic: bool, ageing: str, frequencies: list[float], pressures: list[float]
) -> "RigProgramme":
    """The programme of fig. 2 with these options; frequencies in Hz and pressures in bar, the reference's without any."""
    from models.rig.programme import Ageing, RigProgramme  # start-up time
    from models.rig.sampled import PROTOCOL, DynamicTest, RawTest  # start-up time
    from service.channels import PASCALS_PER_BAR  # start-up time

    levels = tuple(PASCALS_PER_BAR * level for level in sorted(set(pressures))) or PROTOCOL
    usual = DynamicTest(pressures=levels)
    swings = [replace(usual, frequency=f, duration=max(usual.duration, 1.5 / f)) for f in dict.fromkeys(frequencies)]
    loops = (swings or [usual]) if dynamic else []
    return RigProgramme(
        dynamic=loops[0] if loops else None,
        further=tuple(loops[1:]),
        raw=None if raw_rate is None else RawTest(rate=raw_rate, pressures=levels),
        pressures=levels,
        engagements=True,
        ageing=Ageing(ageing),
    )


def _sizes(hide: list[str]) -> dict[str, float]:
    """The effects to hide by slug, with their sizes; the usual size if none is given."""
    from models.rig import hidden  # start-up time

    sizes = {}
    for text in hide:
        slug, colon, size = text.partition(":")
        effect = hidden.effect_of(slug)
        try:
            sizes[slug] = float(size) if colon else effect.size
        except ValueError:
            fail(f"--hide takes EFFECT[:SIZE], the size in {effect.unit}, got {text!r}", EX_USAGE)
    return sizes


def _write(folder: Path, run: "SimulatedRun", record_format: "RecordFormat") -> list[JsonObject]:
    """Write a run into a file; returns its entry for the manifest unless it is JSON."""
    from service.runs import record_writer, simulated  # start-up time

    if record_format is record_writer.RecordFormat.JSON or run.duty is not None:
        manifest.write(folder / f"{run.run_id}.json", simulated.simulated_body(run))
        return []
    head, name = simulated.simulated_head(run), f"{run.run_id}{record_format.suffix}"
    record_writer.write_record(folder / name, record_format, simulated.simulated_channels(run), head)
    return [{"file": name} | head]
