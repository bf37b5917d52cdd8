"""`clutchlife alarms`: what rules have raised, and that somebody has seen it."""

from typing import Annotated

import typer

from service.cli.options import Json, asking, listed, print_line
from service.cli.tables import show_table
from service.client.clutchlife.answers import JsonObject
from service.client.clutchlife.transport import Service


@asking
def alarms(
    service: Service,
    everything: Annotated[bool, typer.Option("--all", help="Include alarms that are over")] = False,
    clutch: Annotated[str | None, typer.Option(help="Only this clutch")] = None,
    acknowledge: Annotated[str | None, typer.Option(metavar="EVENT", help="Acknowledge this alarm")] = None,
    note: Annotated[str, typer.Option(help="A remark on the acknowledgement")] = "",
    rules: Annotated[bool, typer.Option("--rules", help="List the rules instead")] = False,
    as_json: Json = False,
) -> None:
    """List raised alarms, newest first, or acknowledge one."""
    if acknowledge is not None:
        event = service.post(f"/v1/alarms/events/{acknowledge}/acknowledge", {"note": note})
        listed([event], as_json, _show_events, "")
    elif rules:
        rows = service.pages("/v1/alarms")
        listed(rows, as_json, _show_rules, "no alarm rule exists: add one on the page Alarms")
    else:
        chosen = {"state": None if everything else "open", "clutch_id": clutch}
        options = {name: value for name, value in chosen.items() if value is not None}
        listed(service.pages("/v1/alarms/events", **options), as_json, _show_events, "no alarm is raised")


def _show_events(items: list[JsonObject]) -> None:
    for item in items:
        print_line(f"{item['event_id']}  {item['state']:<12}  since {item['raised_at'][:19]}  {item['message']}")


def _show_rules(items: list[JsonObject]) -> None:
    show_table(("rule", "of", "quantity", "limit"), map(_rule, items))


def _rule(item: JsonObject) -> list[str]:
    limit = next((f"{side} {item[side]:g}" for side in ("below", "above") if item[side] is not None), "")
    whose = item["clutch_id"] or item["kind"] or "all"
    return [item["name"] or item["alarm_id"], str(whose), item["quantity"], limit]
