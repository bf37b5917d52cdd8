"""`clutchlife withdraw`, `restore`, `confirm`, `correct`: what is changed of a run afterwards. Nothing is deleted."""

import json
from typing import Annotated, Any

import typer

from service.cli.changes.runs import run_line
from service.cli.connection import service_at
from service.cli.options import URL, ClutchId, Key, Patience, Url, out

RunId = Annotated[str, typer.Argument(metavar="RUN")]
Reason = Annotated[str, typer.Option("--reason", help="Why; the audit trail keeps it")]


def withdraw(
    clutch: ClutchId, run: RunId, reason: Reason, url: Url = URL, key: Key = None, patience: Patience = 10.0
) -> None:
    """Take a run out of a clutch's history; it stays stored."""
    _post(clutch, run, "withdraw", reason, url, key, patience)


def restore(
    clutch: ClutchId, run: RunId, reason: Reason, url: Url = URL, key: Key = None, patience: Patience = 10.0
) -> None:
    """Take a withdrawal back."""
    _post(clutch, run, "restore", reason, url, key, patience)


def confirm(
    clutch: ClutchId, run: RunId, reason: Reason = "", url: Url = URL, key: Key = None, patience: Patience = 10.0
) -> None:
    """Accept a held run as it was sent."""
    _post(clutch, run, "confirm", reason, url, key, patience)


def correct(
    clutch: ClutchId,
    run: RunId,
    cycles: Annotated[float, typer.Option(min=0, help="Duty cycles since new when the run was made")],
    reason: Reason,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Correct the cycles of a run that was sent with others."""
    body = json.dumps({"cycles": cycles, "reason": reason}).encode()
    with service_at(url, key, patience) as service:
        _show(service.patch(f"/v1/clutches/{clutch}/runs/{run}", body))


def _post(clutch: str, run: str, change: str, reason: str, url: str, key: str | None, patience: float) -> None:
    with service_at(url, key, patience) as service:
        _show(service.post(f"/v1/clutches/{clutch}/runs/{run}/{change}", json.dumps({"reason": reason}).encode()))


def _show(receipt: dict[str, Any]) -> None:
    out.print(run_line(receipt), markup=False, soft_wrap=True)
    if receipt["state"] == "held":
        for doubt in receipt["doubts"]:
            out.print(f"    {doubt['code']}: {doubt['message']}", markup=False, soft_wrap=True)
