"""`clutchlife import`: a rig's file as it would be read, asked about where that is open, sent, and kept as a rig profile."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from service.cli.options import EX_DATAERR, ChannelMap, Decimal, Good, Missing, asking, fail, out, print_line
from service.cli.runs import run_line
from service.client.clutchlife.answers import JsonObject, suggested
from service.client.clutchlife.transport import Service

_KINDS = ("stationary_stribeck", "dynamic_stribeck")
#: Rows that are shown.
_ROWS = 3


@asking
def import_file(
    service: Service,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", exists=True, dir_okay=False, help="A file of the rig's recorder")
    ],
    clutch: Annotated[str, typer.Option(help="The clutch that was tested")],
    rig: Annotated[
        str | None, typer.Option(help="The rig profile for the file; default: the profile that fits")
    ] = None,
    kind: Annotated[str | None, typer.Option(help=f"The kind of run: {' or '.join(_KINDS)}")] = None,
    cycles: Annotated[float | None, typer.Option(min=0, help="Duty cycles since new")] = None,
    channel_map: ChannelMap = None,
    decimal: Decimal = None,
    missing: Missing = None,
    good: Good = None,
    save: Annotated[
        str | None, typer.Option("--save", help="Save how the file is read as a rig profile of this name")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Ask nothing; end if something is missing")] = False,
) -> None:
    """Show how a file is read, ask for what is missing, send the file, and save the answers as a rig profile.

    For the next file of the rig use `clutchlife push --rig NAME`, or import again.
    """
    reading = {"map": channel_map, "decimal": decimal, "missing": missing, "good": good}
    options: JsonObject = {"kind": kind, "cycles": cycles, "rig": rig} | reading
    profile: JsonObject | None = None
    while True:
        shown = _sent(service, "/v1/import/preview", file, options | {"clutch_id": clutch}, profile)
        _show(shown)
        if not shown["missing"] or shown["problem"] is not None or yes:
            break
        profile = _answered(shown, options, profile)
    if shown["problem"] is not None:
        fail(shown["problem"], EX_DATAERR)
    if shown["missing"]:
        fail(f"still missing: {', '.join(shown['missing'])}", EX_DATAERR)
    if shown["suggestion"] is not None and profile is None:
        if yes:
            why = shown["suggestion"]["why"]
            fail(f"{why}; {suggested(shown['suggestion'])}. To confirm that, import it without --yes", EX_DATAERR)
        profile, options["time"] = shown["profile"], shown["suggestion"]["time"] or None
    if not yes and not typer.confirm(_question(shown, clutch), default=shown["suggestion"] is None):
        raise typer.Exit(0)
    if shown["rig"] is None and save is None and not yes:
        question = "Name of a new rig profile for such files (leave it empty to save none)"
        save = typer.prompt(question, default="", show_default=False) or None
    if save is not None:
        _save(service, save, shown)
        options, profile = options | {"rig": save, "map": None}, None
    elif profile is None:
        options["rig"] = shown["rig"]
    options |= {"kind": options["kind"] or shown["kind"], "cycles": shown["cycles"]}
    receipt = _sent(service, f"/v1/clutches/{clutch}/runs/file", file, options, profile)
    print_line(run_line(receipt) + ("  stored before" if receipt["duplicate"] else ""))


def _question(shown: JsonObject, clutch: str) -> str:
    """The question for the user before a file is sent."""
    if shown["suggestion"] is None:
        return f"Send it to {clutch}?"
    sure = f"{shown['suggestion']['confidence']:.0%}"
    return f"These columns are suggested, not certain ({sure}). Are they right? Send it to {clutch}?"


def _sent(service: Service, path: str, file: Path, given: JsonObject, profile: JsonObject | None) -> JsonObject:
    """The service's answer to the file, read by an unsaved profile, a saved one, or none."""
    parameters = {name: str(value) for name, value in given.items() if value is not None} | {"filename": file.name}
    if profile is None:
        return service.post_file(path, file, parameters)
    for name in ("rig", "map"):  # the profile holds both
        parameters.pop(name, None)
    return service.post_form(path, file, profile, parameters)


def _show(shown: JsonObject) -> None:
    """Print the preview: one row per column of the file, then the plateaus and fits."""
    title = None if shown["rig"] is None else f"read by the rig profile {shown['rig']}"
    grid = Table(title=title, title_justify="left")
    for name in ("#", "column", "channel", "unit", "scale", "offset", *(f"row {row + 1}" for row in range(_ROWS))):
        grid.add_column(name)
    for index, column in enumerate(shown["columns"]):
        read = column["channel"] is not None
        channel = column["channel"] or "left out"
        unit = (column["unit"] if read else column["stated_unit"]) or ""
        converted = (f"{column[name]:g}" if read else "" for name in ("scale", "offset"))
        rows = (row[index] if index < len(row) else "" for row in shown["first_rows"][:_ROWS])
        grid.add_row(str(index + 1), column["title"], channel, unit, *converted, *rows)
    out.print(grid)
    for warning in shown["warnings"]:
        print_line(f"{warning['code']}: {warning['message']}")
    pieces = f", {len(shown['pieces'])} pieces are cut" if shown["pieces"] else ""
    cycles = "cycles not known" if shown["cycles"] is None else f"{shown['cycles']:g} cycles"
    kind = shown["kind"] or "kind not known"
    out.print(f"{kind}, {cycles}: {shown['rows']} rows{pieces}, {len(shown['fits'])} curves")
    for fit in shown["fits"]:
        mse = "" if fit["mse_percent"] is None else f", MSE {fit['mse_percent']:.2g} %"
        points = f"{fit['points']} points, RMSE {fit['rmse_nm']:.2g} Nm{mse}"
        out.print(f"  {fit['pressure_bar']:g} bar: {points}", markup=False)


def _answered(shown: JsonObject, given: JsonObject, profile: JsonObject | None) -> JsonObject | None:
    """Ask for each missing fact; returns the profile with the answers, and changes `given` in place."""
    columns = [dict(column) for column in shown["profile"]["columns"]]
    edited = False
    for name in shown["missing"]:
        if name == "kind":
            given["kind"] = _choice("Kind of run", list(shown["kinds"] or _KINDS))
        elif name == "cycles":
            said = shown["suggested_run"]["cycles"]
            given["cycles"] = typer.prompt("Duty cycles since new", type=float, default=said)
        elif name.startswith("unit of "):
            own_column = next(column for column in columns if column["title"] == name.removeprefix("unit of "))
            own_column |= {"unit": _choice(name[0].upper() + name[1:], shown["units"][own_column["channel"]])}
            edited = True
        else:
            title = _choice(f"Column of {name}", [column["title"] for column in columns if column["channel"] is None])
            next(column for column in columns if column["title"] == title)["channel"] = name
            edited = True
    return shown["profile"] | {"columns": columns} if edited else profile


def _choice(question: str, values: list[str]) -> str:
    """Ask for one of the values by its number."""
    for place, value in enumerate(values, 1):
        print_line(f"  {place}  {value}")
    while True:
        number: int = typer.prompt(f"{question} (1 to {len(values)})", type=int)
        if 1 <= number <= len(values):
            return values[number - 1]


def _save(service: Service, name: str, shown: JsonObject) -> None:
    """Save the reading of the file as a rig profile of this name."""
    body = shown["profile"] | {"name": name, "kind": shown["profile"]["kind"] or shown["kind"]}
    service.post("/v1/rigs", body)
    pattern = body["file_name"]
    cycles = f"file names such as {pattern} give the cycles" if pattern else "give the cycles with each file"
    print_line(f"saved as rig profile {name}; {cycles}")
