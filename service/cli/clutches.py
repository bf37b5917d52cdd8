"""`clutchlife register`, `list`, `status`, `watch`, `edit`, `archive`, `model`: clutches, their states and records."""

import json
import math
import time
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from service.cli import options
from service.cli.tables import cycles, model_name, show_table
from service.client.clutchlife import Client, ClutchlifeError
from service.client.clutchlife.answers import JsonObject
from service.client.clutchlife.transport import Service

#: What `status` ends with, as plugins of monitoring programs do: all is well, a warning, critical, unknown.
OK, WARNING, CRITICAL, UNKNOWN = range(4)
_CODES = {"normal": OK, "failure": CRITICAL}


@options.asking
def register(
    service: Service,
    clutch: options.ClutchId,
    set_fields: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="FIELD=VALUE",
            help="A field, such as friction_material=paper or geometry.friction_faces=4; may be repeated",
        ),
    ] = None,
    record: Annotated[
        Path | None, typer.Option(exists=True, dir_okay=False, help="A JSON file with the clutch's record")
    ] = None,
) -> None:
    """Register a clutch, so that you can send its runs. Fields that you omit have the values of the reference paper."""
    fields: JsonObject = {} if record is None else json.loads(record.read_bytes())
    if not isinstance(fields, dict):
        raise ValueError(f"{record} must hold a JSON object")  # noqa: TRY004  (a wrong file, not a wrong call)
    for assignment in set_fields or ():
        _assign(fields, {}, assignment)
    service.post("/v1/clutches", fields | {"clutch_id": clutch})
    options.print_line(f"{clutch} is registered; send runs with: clutchlife push FILES --clutch {clutch}")


@options.asking
def list_clutches(
    service: Service,
    state: Annotated[str | None, typer.Option(help="Only clutches in this state, such as maintenance")] = None,
    find: Annotated[
        str | None, typer.Option(help="Only clutches with this text in their name, friction material or fluid")
    ] = None,
    archived: Annotated[bool, typer.Option("--archived", help="Only archived clutches")] = False,
    as_json: options.Json = False,
) -> None:
    """List clutches, what needs somebody first, with their state and remaining cycles."""
    chosen = {"state": state, "find": find, "archived": "true" if archived else None}
    items = service.pages("/v1/clutches", **{name: value for name, value in chosen.items() if value is not None})
    columns = ("clutch", "state", "at", "safe for", "50 % chance of", "held")
    nothing = "no clutch is registered; register one with: clutchlife register ID"
    options.listed(items, as_json, lambda items: show_table(columns, map(_row, items)), nothing)


def _row(item: JsonObject) -> list[str]:
    """A clutch as a row of the printed list."""
    held_count = str(item["held"]) if item["held"] else ""
    summary, numbers = item["summary"], ["-", "-", "-"]
    if summary:
        if summary["as_of_cycles"] is not None:
            numbers[0] = cycles(summary["as_of_cycles"])
        if summary["at_least"] is not None:
            numbers[1] = cycles(math.floor(summary["at_least"]))
        if summary["status"] not in ("insufficient_data", "ended"):
            numbers[2] = cycles(summary["remaining_cycles"]["0.5"])
    state = item["state"]["name"].replace("_", " ")
    ended = "ended, " if summary and summary["ended"] else ""
    return [item["clutch_id"], ended + state, *numbers, held_count]


def status(
    clutch: options.ClutchId,
    as_json: options.Json = False,
    url: options.Url = options.URL,
    key: options.Key = None,
    patience: options.Patience = 10.0,
) -> None:
    """Print a clutch's state and what to do. The exit code is 0 for normal, 1 for check, maintenance or out of
    specification, 2 for failure, 3 if the state is unknown."""
    try:
        with Client(url, key, patience=patience) as client:
            item = client.clutch(clutch)
    except (ClutchlifeError, ValueError, OSError) as error:
        options.say(f"clutchlife: the state is unknown: {error}")
        raise typer.Exit(UNKNOWN) from None
    if as_json:
        options.out.print_json(json.dumps(item))
    else:
        options.print_line(_headline(item))
        options.print_line(item["action"])
    raise typer.Exit(_CODES.get(item["state"]["name"], WARNING))


@options.asking
def watch(
    service: Service,
    clutch: options.ClutchId,
    every: Annotated[float, typer.Option(min=0.1, help="Seconds between two requests")] = 5.0,
    looks: Annotated[
        int | None, typer.Option(min=1, help="End after this number of requests; default: at Ctrl-C")
    ] = None,
) -> None:
    """Print a clutch's state whenever it changes, until Ctrl-C."""
    before, count = "", 0
    while looks is None or count < looks:
        if count:
            time.sleep(every)
        headline = _headline(service.get(f"/v1/clutches/{clutch}"))
        if headline != before:
            options.print_line(f"{datetime.now().astimezone():%H:%M:%S}  {headline}")
        before, count = headline, count + 1


def _headline(item: JsonObject) -> str:
    return f"{item['clutch_id']}: {item['headline']}"


@options.asking
def edit(
    service: Service,
    clutch: options.ClutchId,
    reason: options.Reason,
    set_fields: Annotated[
        list[str],
        typer.Option(
            "--set", metavar="FIELD=VALUE", help="A field, such as end_of_life.cof_fraction=0.4; may be repeated"
        ),
    ],
) -> None:
    """Change fields of a clutch's record; all results are computed again."""
    address = f"/v1/clutches/{clutch}"
    record = service.get(address)
    fields: JsonObject = {}
    for assignment in set_fields:
        _assign(fields, record, assignment)
    changed = service.patch(address, fields | {"reason": reason})
    for name in fields:
        options.print_line(f"{clutch}: {name} = {json.dumps(changed[name])}")


@options.asking
def archive(
    service: Service,
    clutch: options.ClutchId,
    undo: Annotated[bool, typer.Option("--undo", help="Bring it back")] = False,
    reason: options.Reason = "",
) -> None:
    """Archive a finished clutch: lists omit it, it takes no more runs, and its fleet still learns from it."""
    changed = service.patch(f"/v1/clutches/{clutch}", {"archived": not undo, "reason": reason})
    options.print_line(f"{clutch} is {'archived' if changed['archived'] else 'in use'}")


def _assign(fields: JsonObject, record: JsonObject, assignment: str) -> None:
    """Set a part of a field, as `geometry.friction_faces=4`, in the field to be sent; its other parts keep their
    recorded values."""
    name, equals, text = assignment.partition("=")
    field, dot, part = name.strip().partition(".")
    if not equals or not field:
        options.fail(f"--set takes FIELD=VALUE, got {assignment!r}", options.EX_USAGE)
    try:
        value = json.loads(text)
    except ValueError:
        value = text
    if not dot:
        fields[field] = value
        return
    parent = fields.get(field, record.get(field, {}))
    if not isinstance(parent, dict):
        options.fail(f"{field} is a single value: set it as {field}=VALUE", options.EX_USAGE)
    fields[field] = parent | {part: value}


@options.asking
def model(
    service: Service,
    clutch: options.ClutchId,
    adopt: Annotated[
        str | None, typer.Option(metavar="DIAGNOSIS", help="Adopt the extended model of this diagnosis")
    ] = None,
    baseline: Annotated[bool, typer.Option("--baseline", help="Return to the baseline")] = False,
) -> None:
    """Show a clutch's model, adopt an extended model, or return to the baseline."""
    if adopt is not None and baseline:
        options.fail("use --adopt or --baseline, not both", options.EX_USAGE)
    address = f"/v1/clutches/{clutch}/model"
    changes = adopt is not None or baseline
    current = service.put(address, {"diagnosis_id": adopt}) if changes else service.get(address)
    options.print_line(f"{clutch} is tracked with: {model_name(current['model'])}")
    for version in current["versions"]:
        since = f"  version {version['version']}, {version['adopted_at']}: {model_name(version['model'])}"
        options.print_line(since + (f" by {version['diagnosis_id']}" if version["diagnosis_id"] else ""))
