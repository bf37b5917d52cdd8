"""`clutchlife runs`, `withdraw`, `end`, `confirm`, `correct`, `changes`: the runs of a clutch, what is changed of them
afterwards, and the audit trail. Nothing is deleted.
"""

import json
from typing import Annotated

import typer

from service.cli.options import EX_USAGE, ClutchId, Json, Reason, asking, fail, listed, print_line
from service.client.clutchlife.answers import JsonObject
from service.client.clutchlife.transport import Service

RunId = Annotated[str, typer.Argument(metavar="RUN")]


@asking
def runs(
    service: Service,
    clutch: ClutchId,
    held: Annotated[bool, typer.Option("--held", help="Only runs that wait to be confirmed or corrected")] = False,
    as_json: Json = False,
) -> None:
    """List a clutch's runs by cycles, with doubts and warnings."""
    items = service.pages(f"/v1/clutches/{clutch}/runs", **({"state": "held"} if held else {}))
    listed(items, as_json, _print_runs, f"{clutch} has no {'held ' if held else ''}runs")


@asking
def withdraw(
    service: Service,
    clutch: ClutchId,
    run: RunId,
    reason: Reason,
    undo: Annotated[bool, typer.Option("--undo", help="Undo the withdrawal")] = False,
) -> None:
    """Withdraw a run: it no longer counts, but stays stored."""
    change = "restore" if undo else "withdraw"
    _show(service.post(f"/v1/clutches/{clutch}/runs/{run}/{change}", {"reason": reason}))


@asking
def end(
    service: Service,
    clutch: ClutchId,
    cycles: Annotated[
        float | None, typer.Option(min=0, help="Duty cycles since new at the end; default: those of the last run")
    ] = None,
    reason: Annotated[str, typer.Option(help="worn, or other if the clutch was taken out before its end")] = "worn",
    note: Annotated[str, typer.Option(help="A remark")] = "",
) -> None:
    """Declare the end of a clutch's life. The service then refuses duty and tests until a rebuild, and the fleet
    learns from the end."""
    if reason not in ("worn", "other"):
        fail(f"--reason must be worn or other, got {reason!r}", EX_USAGE)
    if cycles is None:
        summary = service.get(f"/v1/clutches/{clutch}")["summary"]
        cycles = None if summary is None else summary["as_of_cycles"]
    if cycles is None:
        fail(f"{clutch} has no run yet: state --cycles", EX_USAGE)
    declared = {"kind": "maintenance", "event": "end_of_life", "cycles": cycles, "reason": reason, "note": note}
    receipt = service.post(f"/v1/clutches/{clutch}/runs", declared)
    _show(receipt)
    if receipt["state"] == "accepted":
        undo = f"clutchlife withdraw {clutch} {receipt['run_id']} --reason ..."
        print_line(f"{clutch}: ended at {receipt['cycles']:,.0f} cycles ({reason}); to undo this: {undo}")


@asking
def confirm(
    service: Service,
    clutch: ClutchId,
    runs: Annotated[list[str] | None, typer.Argument(metavar="[RUN]...", help="The names of the runs")] = None,
    every: Annotated[bool, typer.Option("--all", help="All held runs")] = False,
    doubt: Annotated[str, typer.Option(help="All held runs for this code, as cycles_off_pace")] = "",
    reason: Reason = "",
) -> None:
    """Accept one or more held runs as they were sent."""
    if bool(runs) + every + bool(doubt) != 1:
        fail("name the runs, or use --all or --doubt CODE", EX_USAGE)
    if not runs:
        held_runs = service.pages(f"/v1/clutches/{clutch}/runs", state="held")
        runs = [run["run_id"] for run in held_runs if every or doubt in {item["code"] for item in run["doubts"]}]
    if not runs:
        print_line(f"{clutch} has no {f'runs held for {doubt}' if doubt else 'held runs'}")
        return
    for receipt in service.post(f"/v1/clutches/{clutch}/runs/confirm", {"run_ids": runs, "reason": reason})["items"]:
        _show(receipt)


@asking
def correct(
    service: Service,
    clutch: ClutchId,
    reason: Reason,
    run: Annotated[str | None, typer.Argument(metavar="[RUN]", help="The name of the run")] = None,
    cycles: Annotated[
        float | None, typer.Option(min=0, help="The right number of cycles, from new to this run")
    ] = None,
    rig: Annotated[str | None, typer.Option(help="Read the run's file again with this rig profile")] = None,
    doubt: Annotated[
        str,
        typer.Option(help="All runs held for this code, as counter: each at the cycles that its doubt asks about"),
    ] = "",
) -> None:
    """Correct the cycles of a run, or of all runs with one doubt; or read a run's file again with another rig profile."""
    if (run is None) == (not doubt) or (run is not None and (cycles is None) == (rig is None)):
        raise typer.BadParameter("name a run with --cycles or --rig, or use --doubt CODE")
    if run is None:
        held_runs = service.pages(f"/v1/clutches/{clutch}/runs", state="held")
        likely = {
            item["run_id"]: notice["likely_cycles"]
            for item in held_runs
            for notice in item["doubts"]
            if notice["code"] == doubt and notice.get("likely_cycles") is not None
        }
        if not likely:
            print_line(f"{clutch} has no runs held for {doubt} with cycles that are likely")
            return
        for receipt in service.post(f"/v1/clutches/{clutch}/runs/correct", {"cycles": likely, "reason": reason})[
            "items"
        ]:
            _show(receipt)
        return
    change = {"rig": rig} if cycles is None else {"cycles": cycles}
    _show(service.patch(f"/v1/clutches/{clutch}/runs/{run}", change | {"reason": reason}))


def _show(receipt: JsonObject) -> None:
    _print_runs([receipt | {"warnings": []} | ({} if receipt["state"] == "held" else {"doubts": []})])


def _print_runs(items: list[JsonObject]) -> None:
    for item in items:
        print_line(run_line(item))
        for notice in [*item["doubts"], *item["warnings"]]:
            print_line(f"    {notice['code']}: {notice['message']}")


def run_line(receipt: JsonObject) -> str:
    sent = "" if receipt["cycles"] == receipt["sent_cycles"] else f" (sent as {receipt['sent_cycles']:g})"
    return f"{receipt['cycles']:>12g}  {receipt['state']:<9}  {receipt['kind']:<19}  {receipt['run_id']}{sent}"


@asking
def changes(service: Service, clutch: ClutchId, as_json: Json = False) -> None:
    """List the audit trail of a clutch, newest first."""

    def show(items: list[JsonObject]) -> None:
        for item in items:
            print_line(_change(item))

    listed(service.pages(f"/v1/clutches/{clutch}/changes"), as_json, show, f"nothing was changed of {clutch}")


def _change(item: JsonObject) -> str:
    of_run = "" if item["run_id"] is None else f" {item['run_id']}"
    names = [name for name in item["after"] if name != "doubts" and item["before"].get(name) != item["after"][name]]
    changed = ", ".join(f"{name} {_shown(item['before'].get(name))} -> {_shown(item['after'][name])}" for name in names)
    reason = f": {item['reason']}" if item["reason"] else ""
    return f"{item['at']}  {item['by']}  {item['action']}{of_run} ({changed}){reason}"


def _shown(value: object) -> str:
    return "-" if value is None else value if isinstance(value, str) else json.dumps(value)
