"""`clutchlife runs`: the runs of a clutch, whether each counts, and why not."""

import json
from typing import Annotated, Any

import typer

from service.cli.connection import service_at
from service.cli.options import URL, ClutchId, Json, Key, Patience, Url, out


def runs(
    clutch: ClutchId,
    held: Annotated[bool, typer.Option("--held", help="Only runs that wait to be confirmed or corrected")] = False,
    as_json: Json = False,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """List a clutch's runs by cycles, with doubts and warnings."""
    with service_at(url, key, patience) as service:
        items = list(service.pages(f"/v1/clutches/{clutch}/runs", **({"state": "held"} if held else {})))
    if as_json:
        out.print_json(json.dumps(items))
        return
    for item in items:
        out.print(run_line(item), markup=False, soft_wrap=True)
        for notice in [*item["doubts"], *item["warnings"]]:
            out.print(f"    {notice['code']}: {notice['message']}", markup=False, soft_wrap=True)
    if not items:
        out.print(f"{clutch} has no {'held ' if held else ''}runs", markup=False)


def run_line(receipt: dict[str, Any]) -> str:
    """A run in a line."""
    sent = "" if receipt["cycles"] == receipt["sent_cycles"] else f" (sent as {receipt['sent_cycles']:g})"
    return f"{receipt['cycles']:>12g}  {receipt['state']:<9}  {receipt['kind']:<19}  {receipt['run_id']}{sent}"
