"""`clutchlife model`: the model that a clutch is tracked under, shown, adopted or taken back."""

import json
from typing import Annotated, Any

import typer

from service.cli.connection import service_at
from service.cli.options import EX_USAGE, URL, ClutchId, Key, Patience, Url, fail, out


def model(
    clutch: ClutchId,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
    adopt: Annotated[str | None, typer.Option(metavar="DIAGNOSIS", help="Adopt this diagnosis' extended model")] = None,
    baseline: Annotated[bool, typer.Option("--baseline", help="Return to the baseline")] = False,
) -> None:
    """Show the model that a clutch is tracked under, adopt an extended one, or return to the baseline."""
    if adopt is not None and baseline:
        fail("use --adopt or --baseline, not both", EX_USAGE)
    address = f"/v1/clutches/{clutch}/model"
    with service_at(url, key, patience) as service:
        if adopt is None and not baseline:
            current = service.get(address)
        else:
            current = service.put(address, json.dumps({"diagnosis_id": adopt}).encode())
    out.print(f"{clutch} is tracked under: {_named(current['model'])}", markup=False)
    for version in current["versions"]:
        since = f"  version {version['version']}, {version['adopted_at']}: {_named(version['model'])}"
        out.print(since + (f" by {version['diagnosis_id']}" if version["diagnosis_id"] else ""), markup=False)


def _named(model: dict[str, Any]) -> str:
    effects = ", ".join(model["effects"])
    return f"{model['name']} ({effects})" if effects else str(model["name"])
