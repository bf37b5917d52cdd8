"""`clutchlife withdraw`, `end`, `confirm`, `correct`: what is changed of a run afterwards. Nothing is deleted."""

import json
from typing import Annotated, Any

import typer

from service.cli.changes.runs import run_line
from service.cli.connection import service_at
from service.cli.options import EX_USAGE, URL, ClutchId, Key, Patience, Url, fail, out

RunId = Annotated[str, typer.Argument(metavar="RUN")]
Reason = Annotated[str, typer.Option("--reason", help="Why; the audit trail keeps it")]


def withdraw(
    clutch: ClutchId,
    run: RunId,
    reason: Reason,
    undo: Annotated[bool, typer.Option("--undo", help="Take the withdrawal back")] = False,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Take a run out of a clutch's history; it stays stored."""
    _post(clutch, run, "restore" if undo else "withdraw", reason, url, key, patience)


def end(
    clutch: ClutchId,
    cycles: Annotated[
        float | None, typer.Option(min=0, help="Duty cycles since new at the end; left out, those of the last run")
    ] = None,
    reason: Annotated[
        str, typer.Option(help="worn, or other: taken out before its end, which would have come later")
    ] = "worn",
    note: Annotated[str, typer.Option(help="A remark")] = "",
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
) -> None:
    """Declare that a clutch's life has ended: no more duty or tests until a rebuild, and its fleet learns from it."""
    if reason not in ("worn", "other"):
        fail(f"--reason must be worn or other, got {reason!r}", EX_USAGE)
    with service_at(url, key, patience) as service:
        if cycles is None:
            summary = service.get(f"/v1/clutches/{clutch}")["summary"]
            cycles = None if summary is None else summary["as_of_cycles"]
        if cycles is None:
            fail(f"{clutch} has no run yet: give --cycles", EX_USAGE)
        declared = {"kind": "maintenance", "event": "end_of_life", "cycles": cycles, "reason": reason, "note": note}
        receipt = service.post(f"/v1/clutches/{clutch}/runs", json.dumps(declared).encode())
    _show(receipt)
    if receipt["state"] == "accepted":
        undo = f"clutchlife withdraw {clutch} {receipt['run_id']} --reason ..."
        out.print(
            f"{clutch}: ended at {receipt['cycles']:,.0f} cycles ({reason}); taken back by: {undo}",
            markup=False,
            soft_wrap=True,
        )


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
