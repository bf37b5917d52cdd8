"""`clutchlife diagnose`: a diagnosis asked for, awaited and printed."""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.columns import Columns
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from service.cli.options import ClutchId, asking, err, fail, out, print_line
from service.cli.tables import chance, cycles, number
from service.client.clutchlife.client import diagnosed
from service.client.clutchlife.transport import Service

_Cells = list[list[float | None]]
#: A verdict as the page has it, and its colour.
_VERDICTS = {
    "model_adequate": ("Model adequate", "green"),
    "cause_named": ("Cause named", "yellow"),
    "cause_ambiguous": ("Cause ambiguous", "yellow"),
    "unexplained_structure": ("Unexplained structure", "red"),
    "insufficient_data": ("Too little data", "cyan"),
}
#: An axis is named where chance alone makes such a pattern less often than this.
_SHOWN_P = 0.01
#: Candidates that are less probable, or come after this many, are shown by `--json` only. Chosen: 1 in 20; a screenful.
_MIN_PROBABILITY, _MAX_CANDIDATES = 0.05, 6
#: A gain in log evidence [nats] from which the evidence has this name. Derived: 2 ln B of 6 and 2 in R. E. Kass, A. E.
#: Raftery, Bayes Factors, JASA 90, 1995, section 3.2.
_EVIDENCE = ((3.0, "strong"), (1.0, "moderate"), (0.0, "weak"))
#: Cells of two characters across a map; finer axes are averaged. Chosen: two maps fit 80 characters.
_MAX_CELLS = 15
#: A cell is marked from this share of the largest residual on: share, mark, colours for residuals above and below zero.
#: Chosen: quarters.
_MARKS = ((0.75, "##", 160, 27), (0.5, "++", 203, 69), (0.25, "+ ", 217, 153))


def _spelt(slug: str) -> str:
    """The name of an effect or an axis in words, without its unit."""
    return re.sub(r"_(rpm|bar|s|c|nm)$", "", slug).replace("_", " ")


def shown(report: Mapping[str, Any]) -> Iterator[RenderableType]:
    """The parts of a finished report, to be printed one by one."""
    words, colour = _VERDICTS[report["verdict"]]
    causes = f": {', '.join(map(_spelt, report['causes']))}" if report["causes"] else ""
    yield Panel(Text(report["summary"]), title=Text(f"{words}{causes}", style=f"bold {colour}"), border_style=colour)
    if report["candidates"]:
        shown_ones = [item for item in report["candidates"] if (item["probability"] or 0.0) >= _MIN_PROBABILITY]
        yield _candidates((shown_ones or report["candidates"])[:_MAX_CANDIDATES])
    if report["friction_law"] is not None:
        yield Text(_friction_law(report["friction_law"]))
    if report["maps"] is not None:
        yield _maps(report["maps"])
    axes = [_spelt(item["axis"]) for item in report["baseline"]["where"] if item["p_value"] < _SHOWN_P]
    if axes:
        yield Text(f"The baseline's error depends on: {', '.join(axes)}")
    yield from _gain(report)
    tests = report["advice"]
    if len(tests) > 1:
        yield Text("What to test next. One of these is enough; the best comes first:", style="bold")
    for advice in tests:
        yield Text(f"{'- ' if len(tests) > 1 else 'What to test next: '}{advice['test']} ({_use(advice)})")
    if report["isolability"] is not None:
        yield from _isolability(report["isolability"])
    if report["visible"]:
        yield _visible(report["visible"])
    for note in report["notes"]:
        yield Text(f"Note: {note}", style="dim")
    if report["adopted"]:
        yield Text("The extended model is adopted: tracking and remaining life use it from now on.", style="bold")


def _friction_law(law: Mapping[str, Any]) -> str:
    """The deviation of the friction curve from eq. 3, and the smaller error of the curve as found on held-out runs."""
    low, high = law["interval_percent"]
    text = (
        f"Friction curve against eq. 3: {number(law['rms_percent'], 2)} % ({number(low, 2)} to {number(high, 2)} %) RMS"
    )
    if law["gain"] is not None and law["gain"]["reduction_percent"] is not None:
        text += f"; the curve as found predicts held-out runs {number(law['gain']['reduction_percent'], 2)} % better"
    return text


def _use(advice: Mapping[str, Any]) -> str:
    """The purpose of an advised test: it narrows the size of a named cause, or distinguishes two causes."""
    cause, other = map(_spelt, advice["separates"])
    if advice["narrows"]:
        return f"narrows the size of {cause} to {100 * advice['narrows']:.0f} % of its present uncertainty"
    against = "no effect at all" if other == "baseline" else other
    return f"distinguishes {cause} from {against}; expected evidence: {_evidence(advice['nats'])}"


def _in_unit(value: str, unit: str) -> str:
    return value if unit == "-" else f"{value} {unit}"


def _table(*columns: str, right: Sequence[str] = ()) -> Table:
    """A table without frames; the columns named in `right` are right-aligned."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in columns:
        table.add_column(name, justify="right" if name in right else "left")
    return table


def _candidates(candidates: Sequence[Mapping[str, Any]]) -> Table:
    """The table of candidate explanations, with probability and estimated size."""
    table = _table("candidate", "probability", "estimate", right=["probability"])
    for candidate in candidates:
        estimate = candidate["estimate"]
        size = f"{number(estimate['value'])} ± {number(estimate['sd'], 2)}"
        amount = f"{_in_unit(size, estimate['unit'])} {estimate['name']}"
        table.add_row(Text(_spelt(candidate["effect"])), chance(candidate["probability"]), Text(amount))
    return table


def _visible(visible: Sequence[Mapping[str, Any]]) -> Table:
    """The smallest detectable size of an effect: in any of its forms, and in its most visible form."""
    shapes = ("in every shape", "in the most visible shape")
    table = _table("smallest visible size of", *shapes, right=shapes)
    for item in visible:
        sizes = (
            "at no size" if size is None else _in_unit(number(size), item["unit"])
            for size in (item["amplitude"], item["least"])
        )
        table.add_row(Text(_spelt(item["effect"])), *sizes)
    return table


def _isolability(isolability: Mapping[str, Any]) -> Iterator[RenderableType]:
    """The pairs of causes that these tests might not distinguish, hardest first, and the causes that they cannot show."""
    hard = [pair for pair in isolability["pairs"] if not pair["apart"]]
    table = _table("causes", "distinguished", "better by this test", "then")
    for pair in hard:
        before, then = (f"{100 * pair[name]:.0f} %" for name in ("probability", "with_test"))
        best = Text(pair["test"] or "no single test distinguishes them")
        table.add_row(Text(" and ".join(map(_spelt, pair["effects"]))), before, best, then)
    if hard:
        yield table
    sure = len(isolability["pairs"]) - len(hard)
    yield Text(f"These tests would distinguish {sure} of {len(isolability['pairs'])} pairs of causes.")
    if isolability["unseen"]:
        yield Text(f"These tests cannot show: {', '.join(map(_spelt, isolability['unseen']))}.")


def _evidence(gain: float | None) -> str:
    """A gain in log evidence [nats] in a word; the number is in `--json`."""
    if gain is None:
        return "-"
    return next((word for least, word in _EVIDENCE if gain >= least), "none")


def _maps(maps: Mapping[str, Any]) -> Group:
    """Both models' residuals by pressure, over speed and over cycles, as shares of the baseline's largest residual."""
    drawn: list[Group] = []
    largest: list[float] = []
    levels, speeds, cycles_at = (maps["axes"][name] for name in ("pressure_bar", "speed_rpm", "cycles"))
    for when, title in (("before", "Baseline"), ("after", "Extended")):
        by_cycles = list(zip(*maps[when]["pressure_cycles"], strict=True))
        tables = [_thinned(maps[when]["speed_pressure"]), _thinned(by_cycles)]
        largest = largest or [
            max((abs(value) for line in table for value in line if value is not None), default=0.0) for table in tables
        ]
        over_speed = _grid(f"{title}: bar over rpm", levels, speeds, tables[0], largest[0])
        over_cycles = _grid(f"{title}: bar over cycles", levels, cycles_at, tables[1], largest[1])
        drawn.append(Group(over_speed, over_cycles))
    legend = Text("Mean residual as a share of the largest one of the baseline ")
    legend.append(f"(over rpm {number(largest[0], 2)}, over cycles {number(largest[1], 2)} standard deviations): ")
    for least, mark, above, below in reversed(_MARKS):
        legend.append(mark, style=f"black on color({above})")
        legend.append(_below(mark), style=f"black on color({below})")
        legend.append(f" {100 * least:.0f} %  ")
    return Group(Columns(drawn, padding=(0, 3)), legend)


def _thinned(table: Sequence[Sequence[float | None]]) -> _Cells:
    """A map with one row per pressure, with columns averaged until they fit the terminal."""
    size = max(1, math.ceil(max(map(len, table), default=0) / _MAX_CELLS))
    return [[_mean(line[start : start + size]) for start in range(0, len(line), size)] for line in table]


def _grid(title: str, rows: Sequence[float], columns: Sequence[float], table: _Cells, largest: float) -> Text:
    """Residuals as coloured blocks, readable without colours too, highest row first."""
    text = Text(f"{title}\n", style="bold")
    for level, line in sorted(zip(rows, table, strict=True), key=lambda pair: -pair[0]):
        text.append(f"{level:5.3g} ", style="not bold")
        for value in line:
            text.append_text(_cell(value, largest))
        text.append("\n")
    first, last = (f"{columns[0]:.0f}", f"{columns[-1]:.0f}") if columns else ("", "")
    width = 2 * max(map(len, table), default=0)
    text.append(" " * 6 + first + last.rjust(max(len(last) + 1, width - len(first))), style="not bold dim")
    return text


def _cell(value: float | None, largest: float) -> Text:
    """One cell of a residual map, marked and coloured by its share of the largest residual."""
    if value is None:
        return Text("  ")
    for share, mark, above, below in _MARKS:
        if abs(value) >= share * largest > 0:
            sign, colour = (mark, above) if value > 0 else (_below(mark), below)
            return Text(sign, style=f"not bold black on color({colour})")
    return Text("· ", style="not bold dim")


def _below(mark: str) -> str:
    """The mark of a negative residual, for the mark of a positive one."""
    return mark.replace("+", "-").replace("#", "=")


def _mean(values: Sequence[float | None]) -> float | None:
    measured = [value for value in values if value is not None]
    return sum(measured) / len(measured) if measured else None


def _gain(report: Mapping[str, Any]) -> Iterator[RenderableType]:
    """The lines on held-out runs and on remaining life before and after the extended model."""
    gain = report["gain"]
    if gain["rmse_before_nm"] is not None:
        spread = "" if gain["reduction_percent_sd"] is None else f" ± {number(gain['reduction_percent_sd'], 2)}"
        yield Text(
            f"On {len(gain['held_out_runs'])} runs that were left out of the fit: error "
            f"{number(gain['rmse_before_nm'])} Nm before, {number(gain['rmse_after_nm'])} Nm after "
            f"({number(gain['reduction_percent'])}{spread} % less); evidence for the extended model: "
            f"{_evidence(gain['log_score_gain'])}"
        )
    life = gain["remaining_useful_life"]
    for when, title in (("before", "baseline"), ("after", "extended")):
        if life[when] and (when == "before" or report["adoptable"]):
            yield Text(f"Remaining life, {title}: {_remaining(life[when])}")


def _remaining(life: Mapping[str, Any]) -> str:
    if life["status"] == "reached":
        return "the end of life is reached"
    if life["status"] == "insufficient_data":
        return "too few tests for a prediction"
    low, middle, high = (life["remaining_cycles"][quantile] for quantile in ("0.05", "0.5", "0.95"))
    return f"{cycles(middle)} cycles (90 %: {cycles(low)} to {cycles(high)})"


@asking
def diagnose(
    service: Service,
    clutch: ClutchId,
    adopt: Annotated[bool, typer.Option("--adopt", help="Adopt the extended model, if there is one")] = False,
    plan: Annotated[
        Path | None, typer.Option(help="Save the advised tests here as a protocol for the rig: CSV, one row per step")
    ] = None,
    isolability: Annotated[
        bool,
        typer.Option(
            "--isolability",
            help="Show which causes these tests could distinguish, and which test would distinguish the rest",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON")] = False,
) -> None:
    """Show what the simulation gets wrong about a clutch, name the cause, and show what an extended model gains."""
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=err, transient=True) as progress:
        progress.add_task("diagnosing", total=None)
        report = diagnosed(service, clutch, adopt=adopt, isolability=isolability)
    if as_json:
        typer.echo(json.dumps(report, indent=1, ensure_ascii=False))
    elif report["status"] == "finished":
        for part in shown(report):
            out.print(part)
        if report["adoptable"] and not report["adopted"]:
            print_line(f"To adopt the extended model: clutchlife model {clutch} --adopt {report['diagnosis_id']}")
    if report["status"] == "finished" and plan is not None:
        plan.write_text(service.table(f"/v1/clutches/{clutch}/diagnoses/{report['diagnosis_id']}/plan.csv"), "utf-8")
    if report["status"] != "finished":
        fail(f"the diagnosis failed: {report['problem']}")
