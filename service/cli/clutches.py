"""`clutchlife register`, `list`, `status`, `watch`: clutches made known, and how they are."""

import json
import time
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, NoReturn

import httpx2
import typer

from service.cli.answers.tables import cycles, show_table
from service.cli.changes.clutch_changes import assign
from service.cli.connection import service_at
from service.cli.options import URL, ClutchId, Json, Key, Patience, Url, err, errors_in_a_line, out
from service.client.clutchlife import Client, ClutchlifeError

#: What `status` ends with, as plugins of monitoring programs do: all is well, a warning, critical, unknown.
OK, WARNING, CRITICAL, UNKNOWN = range(4)
_CODES = {"normal": OK, "failure": CRITICAL}


def register(
    clutch: ClutchId,
    set_fields: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="As friction_material=paper or geometry.friction_faces=4"),
    ] = None,
    record: Annotated[
        Path | None, typer.Option(exists=True, dir_okay=False, help="A JSON file with the clutch's record")
    ] = None,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Register a clutch, so that runs of it can be sent; what is not given has the reference's values."""
    with errors_in_a_line():
        fields: dict[str, Any] = {} if record is None else json.loads(record.read_bytes())
        if not isinstance(fields, dict):
            raise ValueError(f"{record} must hold a JSON object")  # noqa: TRY004  (a wrong file, not a wrong call)
        for assignment in set_fields or ():
            assign(fields, {}, assignment)
        with service_at(url, key, patience) as service:
            service.post("/v1/clutches", json.dumps(fields | {"clutch_id": clutch}).encode())
    out.print(f"{clutch} is registered; send runs with: clutchlife push FILES --clutch {clutch}", markup=False)


def list_clutches(
    state: Annotated[str | None, typer.Option(help="Of this state only, as maintenance")] = None,
    find: Annotated[str | None, typer.Option(help="Whose name, friction material or fluid holds this")] = None,
    archived: Annotated[bool, typer.Option("--archived", help="The archived ones")] = False,
    as_json: Json = False,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """List clutches, worst first, with their state and the cycles that remain."""
    chosen = {"state": state, "find": find, "archived": "true" if archived else None}
    with service_at(url, key, patience) as service:
        items = list(
            service.pages("/v1/clutches", **{name: value for name, value in chosen.items() if value is not None})
        )
    if as_json:
        out.print_json(json.dumps(items))
    elif not items:
        out.print("no clutch; register one with: clutchlife register ID", markup=False)
    else:
        show_table(("clutch", "state", "at", "at least", "most likely", "held"), map(_row, items))


def _row(item: dict[str, Any]) -> list[str]:
    summary = item["summary"] or {"as_of_cycles": None, "at_least": None, "remaining_cycles": {"0.5": None}}
    numbers = (summary["as_of_cycles"], summary["at_least"], summary["remaining_cycles"]["0.5"])
    held = str(item["held"]) if item["held"] else ""
    return [item["clutch_id"], item["state"]["name"].replace("_", " "), *map(cycles, numbers), held]


def status(clutch: ClutchId, as_json: Json = False, url: Url = URL, key: Key = None, patience: Patience = 10.0) -> None:
    """Print how a clutch is and what to do about it. Ends with 0 where it is normal, 1 check, maintenance or out of
    specification, 2 failure, 3 unknown, unreachable or misused."""
    try:
        with Client(url, key, patience=patience) as client:
            item = client.clutch(clutch)
    except (ClutchlifeError, httpx2.InvalidURL, ValueError, OSError) as error:
        _unknown(str(error))
    if as_json:
        out.print_json(json.dumps(item))
    else:
        _show(item)
    raise typer.Exit(_CODES.get(item["state"]["name"], WARNING))


def watch(
    clutch: ClutchId,
    every: Annotated[float, typer.Option(min=0.1, help="Seconds between two looks")] = 5.0,
    looks: Annotated[int | None, typer.Option(min=1, help="End after so many looks; left out, at Ctrl-C")] = None,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Print a clutch's line whenever it changes, until Ctrl-C."""
    before, count = "", 0
    with service_at(url, key, patience) as service:
        while looks is None or count < looks:
            if count:
                time.sleep(every)
            item = service.get(f"/v1/clutches/{clutch}")
            line = _line(item)
            if line != before:
                out.print(f"{datetime.now().astimezone():%H:%M:%S}  {line}", markup=False, soft_wrap=True)
            before, count = line, count + 1


def _show(item: dict[str, Any]) -> None:
    out.print(_line(item), markup=False, soft_wrap=True)
    out.print(item["action"], markup=False, soft_wrap=True)


def _line(item: dict[str, Any]) -> str:
    return f"{item['clutch_id']}: {item['headline']}"


def _unknown(reason: str) -> NoReturn:
    err.print(f"clutchlife: unknown: {reason}", markup=False, soft_wrap=True)
    raise typer.Exit(UNKNOWN)
