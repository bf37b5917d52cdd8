"""`clutchlife diagnose`: what the simulation gets wrong about a clutch, and why."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from service.cli.connection import asking
from service.cli.diagnosis_view import shown
from service.cli.options import ClutchId, err, fail, out, print_line
from service.client.clutchlife.client import diagnosed
from service.client.clutchlife.transport import Service


@asking
def diagnose(
    service: Service,
    clutch: ClutchId,
    adopt: Annotated[bool, typer.Option("--adopt", help="Track under the extended model, if there is one")] = False,
    plan: Annotated[
        Path | None, typer.Option(help="Save the advised tests here as a protocol for the rig, a CSV with a row a step")
    ] = None,
    isolability: Annotated[
        bool,
        typer.Option(
            "--isolability", help="Show which causes these tests could tell apart, and which test parts the rest"
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON")] = False,
) -> None:
    """Show what the simulation gets wrong about a clutch, name the cause, and show what an extended model gains."""
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=err, transient=True) as progress:
        progress.add_task("diagnosing", total=None)
        report = diagnosed(service, clutch, adopt=adopt, isolability=isolability)
    if as_json:
        typer.echo(json.dumps(report, indent=1, ensure_ascii=False))
    elif report["status"] == "finished":
        for part in shown(report):
            out.print(part)
        if report["adoptable"] and not report["adopted"]:
            print_line(f"To track under it: clutchlife model {clutch} --adopt {report['diagnosis_id']}")
    if report["status"] == "finished" and plan is not None:
        plan.write_text(service.table(f"/v1/clutches/{clutch}/diagnoses/{report['diagnosis_id']}/plan.csv"), "utf-8")
    if report["status"] != "finished":
        fail(f"the diagnosis failed: {report['problem']}")
