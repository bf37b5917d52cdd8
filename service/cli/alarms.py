"""`clutchlife alarms`: what rules have raised, and that somebody has seen it."""

import json
from typing import Annotated

import typer

from service.cli.answers.tables import show_table
from service.cli.connection import service_at
from service.cli.options import URL, Json, Key, Patience, Url, out


def alarms(
    everything: Annotated[bool, typer.Option("--all", help="Those that are over, too")] = False,
    clutch: Annotated[str | None, typer.Option(help="Of this clutch only")] = None,
    acknowledge: Annotated[str | None, typer.Option(metavar="EVENT", help="Acknowledge this one")] = None,
    note: Annotated[str, typer.Option(help="Of an acknowledgement: a remark")] = "",
    rules: Annotated[bool, typer.Option("--rules", help="List the rules instead")] = False,
    as_json: Json = False,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """List the alarms that are raised, newest first, or acknowledge one."""
    chosen = {"state": None if everything else "open", "clutch_id": clutch}
    given = {name: value for name, value in chosen.items() if value is not None}
    with service_at(url, key, patience) as service:
        if acknowledge is not None:
            body = json.dumps({"note": note}).encode()
            items = [service.post(f"/v1/alarms/events/{acknowledge}/acknowledge", body)]
        elif rules:
            items = list(service.pages("/v1/alarms"))
        else:
            items = list(service.pages("/v1/alarms/events", **given))
    if as_json:
        out.print_json(json.dumps(items))
    elif rules:
        show_table(("rule", "of", "quantity", "limit"), ([*map(str, _rule(item))] for item in items))
    elif not items:
        out.print("no alarm is raised", markup=False)
    else:
        for item in items:
            line = f"{item['event_id']}  {item['state']:<12}  since {item['raised_at'][:19]}  {item['message']}"
            out.print(line, markup=False, soft_wrap=True)


def _rule(item: dict[str, object]) -> tuple[object, ...]:
    limit = next((f"{side} {item[side]:g}" for side in ("below", "above") if item[side] is not None), "")
    return item["name"] or item["alarm_id"], item["clutch_id"] or item["kind"] or "all", item["quantity"], limit
