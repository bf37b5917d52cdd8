"""`clutchlife push`: send run files, keep what could not be sent, safe to repeat."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress

from service.cli.options import (
    EX_DATAERR,
    EX_TEMPFAIL,
    EX_USAGE,
    URL,
    Key,
    Patience,
    Url,
    err,
    errors_in_a_line,
    fail,
    out,
)
from service.cli.sending.client import RefusedError, Service, ServiceAwayError, connect
from service.cli.sending.spool import Spool, default_folder
from service.run_files import manifest

SPOOL = default_folder()


@dataclass
class Sent:
    """How many of the pushed runs were stored, were stored already, were refused, or failed inside the service."""

    stored: int = 0
    duplicates: int = 0
    refused: int = 0
    failed: int = 0


def push(
    paths: Annotated[list[Path], typer.Argument(metavar="PATH...", help="Run files, or folders of them")],
    clutch: Annotated[str, typer.Option(help="The clutch that was tested")],
    url: Url = URL,
    key: Key = None,
    spool: Annotated[Path, typer.Option("--spool", help="Where runs wait until the service has stored them")] = SPOOL,
    patience: Patience = 60.0,
    kind: Annotated[str | None, typer.Option(help="For files that are not JSON: the kind of run")] = None,
    cycles: Annotated[float | None, typer.Option(help="For files that are not JSON: duty cycles since new")] = None,
    channel_map: Annotated[str | None, typer.Option("--map", help="Channels by name: torque_nm:Mz,speed_rpm:n")] = None,
) -> None:
    """Send run files: JSON, or CSV, TDMS, MDF4 and Parquet, with their kind and cycles in a runs.json or in options.

    Runs that the service cannot store now wait in the spool and are sent first next time.
    """
    with errors_in_a_line():
        try:
            files = manifest.find(paths)
        except FileNotFoundError as error:
            fail(str(error), EX_DATAERR)
        for record in manifest.unlisted(paths):
            err.print(f"{record} is not listed in {manifest.MANIFEST} and not sent", markup=False, soft_wrap=True)
        waiting = Spool.of(spool, url, clutch)
        for file in files:
            if file.path.suffix == ".json":
                waiting.add(file.path.read_bytes())
            else:
                parameters = _parameters(file, kind, cycles)
                waiting.add_file(file.path, ({} if channel_map is None else {"map": channel_map}) | parameters)
        with connect(url, key=key) as http, Progress(console=err, transient=True) as progress:
            task = progress.add_task("sending", total=len(list(waiting.waiting())))

            def show_wait(reason: str, seconds: float) -> None:
                progress.update(task, description=f"{reason}; again in {seconds:.0f} s")

            service = Service(http=http, patience=patience, on_wait=show_wait)
            sent = Sent()
            try:
                _register(service, clutch, paths)
                for entry in waiting.waiting():
                    _send(service, clutch, waiting, entry, sent)
                    progress.update(task, description="sending", advance=1)
            except ServiceAwayError as error:
                left = len(list(waiting.waiting()))
                fail(f"{error}; {left} runs wait in {waiting.folder}: push again to send them", EX_TEMPFAIL)
            except RefusedError as error:
                fail(str(error), EX_DATAERR)
        out.print(f"{sent.stored} stored, {sent.duplicates} known already, {sent.refused} refused")
        if sent.failed:
            fail(
                f"the service failed on {sent.failed} runs, which wait in {waiting.folder}: see its log",
                EX_TEMPFAIL,
            )
        if sent.refused:
            fail(f"refused runs and the reasons are in {waiting.folder / 'refused'}", EX_DATAERR)


def _parameters(file: manifest.RunFile, kind: str | None, cycles: float | None) -> dict[str, str]:
    """The parameters of a record's request: from its manifest, else from the options."""
    if file.parameters is not None:
        return dict(file.parameters)
    if kind is None or cycles is None:
        remedy = f"give --kind and --cycles, or list it in a {manifest.MANIFEST} beside it"
        fail(f"{file.path} is no JSON file: {remedy}", EX_USAGE)
    return {"kind": kind, "cycles": repr(cycles), "filename": file.path.name}


def _register(service: Service, clutch_id: str, paths: list[Path]) -> None:
    """Register the clutch from a `clutch.json` in one of the folders; without one it must be registered already."""
    record = next((path / manifest.CLUTCH_FILE for path in paths if (path / manifest.CLUTCH_FILE).is_file()), None)
    if record is None:
        service.get(f"/v1/clutches/{clutch_id}")
        return
    body = json.loads(record.read_bytes())
    if not isinstance(body, dict):
        raise ValueError(f"{record} must hold a JSON object")  # noqa: TRY004  (a wrong file, not a wrong call)
    body["clutch_id"] = clutch_id
    service.post("/v1/clutches", json.dumps(body).encode())


def _send(service: Service, clutch_id: str, waiting: Spool, entry: Path, sent: Sent) -> None:
    try:
        parameters = waiting.parameters(entry)
        if parameters is None:
            receipt = service.post(f"/v1/clutches/{clutch_id}/runs", entry.read_bytes())
        else:
            receipt = service.post_file(f"/v1/clutches/{clutch_id}/runs/file", entry, parameters)
    except RefusedError as error:
        if error.status in (0, 401, 403, 404):
            raise
        if error.status >= 500:
            sent.failed += 1
            err.print(f"failed, {error}: {entry} stays in the spool", markup=False, soft_wrap=True)
            return
        sent.refused += 1
        aside = waiting.refused(entry, error.problem)
        err.print(f"refused, {error}: {aside}", markup=False, soft_wrap=True)
        return
    waiting.done(entry)
    sent.duplicates += receipt["duplicate"]
    sent.stored += not receipt["duplicate"]
