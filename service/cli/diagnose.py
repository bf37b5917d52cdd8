"""`clutchlife diagnose` and `clutchlife model`: what the simulation gets wrong and why, and under which model is tracked."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from service.cli.diagnosis_view import shown
from service.cli.options import EX_DATAERR, EX_TEMPFAIL, EX_USAGE, URL, Key, Patience, Url, err, fail, out, told
from service.cli.sending.client import RefusedError, Service, ServiceAwayError, connect

#: Seconds that one question waits for the report, and between two looks at it.
_WAIT, _LOOK = 10, 0.5

Id = Annotated[str, typer.Argument(metavar="ID")]


def diagnose(
    clutch: Id,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
    adopt: Annotated[bool, typer.Option("--adopt", help="Track under the extended model, where one is found")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="The report as the service gives it")] = False,
) -> None:
    """Show what the simulation gets wrong about a clutch, name the cause, and say what an extended model gains."""
    with _service(url, key, patience) as service:
        columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
        with Progress(*columns, console=err, transient=True) as progress:
            progress.add_task("diagnosing", total=None)
            report = ask(service, clutch, adopt=adopt)
    if as_json:
        typer.echo(json.dumps(report, indent=1, ensure_ascii=False))
    elif report["status"] == "finished":
        for part in shown(report):
            out.print(part)
        if report["adoptable"] and not report["adopted"]:
            out.print(f"To track under it: clutchlife model {clutch} --adopt {report['diagnosis_id']}", markup=False)
    if report["status"] != "finished":
        fail(f"the diagnosis failed: {report['problem']}")


def ask(service: Service, clutch: str, *, adopt: bool, look: Callable[[float], None] = time.sleep) -> dict[str, Any]:
    """The report of a diagnosis that is asked for now, once it has ended."""
    at = f"/v1/clutches/{clutch}/diagnoses"
    report = service.post(at, json.dumps({"adopt": adopt}).encode(), prefer=f"wait={_WAIT}")
    while report["status"] == "running":
        look(_LOOK)
        report = service.get(f"{at}/{report['diagnosis_id']}")
    return report


def model(
    clutch: Id,
    url: Url = URL,
    key: Key = None,
    patience: Patience = 10.0,
    adopt: Annotated[str | None, typer.Option(metavar="DIAGNOSIS", help="Adopt what this diagnosis found")] = None,
    baseline: Annotated[bool, typer.Option("--baseline", help="Return to the baseline")] = False,
) -> None:
    """Show the model that a clutch is tracked under, adopt an extended one, or return to the baseline."""
    if adopt is not None and baseline:
        fail("say --adopt or --baseline, not both", EX_USAGE)
    at = f"/v1/clutches/{clutch}/model"
    with _service(url, key, patience) as service:
        if adopt is None and not baseline:
            found = service.get(at)
        else:
            found = service.put(at, json.dumps({"diagnosis_id": adopt}).encode())
    out.print(f"{clutch} is tracked under: {_named(found['model'])}", markup=False)
    for version in found["versions"]:
        since = f"  version {version['version']}, {version['adopted_at']}: {_named(version['model'])}"
        out.print(since + (f" by {version['diagnosis_id']}" if version["diagnosis_id"] else ""), markup=False)


def _named(model: dict[str, Any]) -> str:
    effects = ", ".join(model["effects"])
    return f"{model['name']} ({effects})" if effects else str(model["name"])


@contextmanager
def _service(url: str, key: str | None, patience: float) -> Iterator[Service]:
    """The service; what it refuses and that it is away end the command."""
    with told(), connect(url, key=key) as http:
        try:
            yield Service(http=http, patience=patience)
        except ServiceAwayError as error:
            fail(str(error), EX_TEMPFAIL)
        except RefusedError as error:
            fail(str(error), EX_DATAERR)
