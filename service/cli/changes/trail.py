"""`clutchlife changes`: who changed what of a clutch and its runs, when and why."""

import json
from typing import Any

from service.cli.connection import service_at
from service.cli.options import URL, ClutchId, Json, Key, Patience, Url, out


def changes(
    clutch: ClutchId, as_json: Json = False, url: Url = URL, key: Key = None, patience: Patience = 10.0
) -> None:
    """List the audit trail of a clutch, newest first."""
    with service_at(url, key, patience) as service:
        items = list(service.pages(f"/v1/clutches/{clutch}/changes"))
    if as_json:
        out.print_json(json.dumps(items))
        return
    for item in items:
        out.print(_line(item), markup=False, soft_wrap=True)
    if not items:
        out.print(f"nothing was changed of {clutch}", markup=False)


def _line(item: dict[str, Any]) -> str:
    of_run = "" if item["run_id"] is None else f" {item['run_id']}"
    names = [name for name in item["after"] if name != "doubts" and item["before"].get(name) != item["after"][name]]
    changed = ", ".join(f"{name} {_shown(item['before'].get(name))} -> {_shown(item['after'][name])}" for name in names)
    reason = f": {item['reason']}" if item["reason"] else ""
    return f"{item['at']}  {item['by']}  {item['action']}{of_run} ({changed}){reason}"


def _shown(value: object) -> str:
    return "-" if value is None else value if isinstance(value, str) else json.dumps(value)
