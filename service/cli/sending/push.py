"""`clutchlife push` and `spool`: runs sent, and what waits to be sent."""

import json
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Annotated

import typer

from service.cli import options
from service.cli.sending.delivery import transmit
from service.cli.sending.spool import (
    INSPECTIONS,
    REFUSED,
    REPLACED,
    RUNS,
    WAITING,
    Entry,
    HeldError,
    Spool,
    default_folder,
)
from service.client.clutchlife.answers import JsonObject, RefusedError, ServiceAwayError
from service.client.clutchlife.transport import Service, connect
from service.runs import manifest

SPOOL = default_folder()
_REMEDY = (
    "Give --kind and --cycles, or name a profile with --rig, or list the file in a "
    f"{manifest.MANIFEST} beside it, or use clutchlife import, which asks for them"
)
SpoolFolder = Annotated[Path, typer.Option("--spool", help="Where runs wait until the service has stored them")]


def push(
    paths: Annotated[list[Path], typer.Argument(metavar="PATH...", help="Run files, or folders of them")],
    clutch: Annotated[str, typer.Option(help="The clutch that was tested")],
    url: options.Url = options.URL,
    key: options.Key = None,
    spool: SpoolFolder = SPOOL,
    patience: options.Patience = 60.0,
    kind: Annotated[str | None, typer.Option(help="For files that are not JSON: the kind of run")] = None,
    cycles: Annotated[float | None, typer.Option(help="For files that are not JSON: duty cycles since new")] = None,
    rig: Annotated[
        str | None, typer.Option(help="For files that are not JSON: the rig profile to read them with")
    ] = None,
    channel_map: options.ChannelMap = None,
    decimal: options.Decimal = None,
    missing: options.Missing = None,
    good: options.Good = None,
) -> None:
    """Send run files to the service.

    A JSON run is complete. For other files (CSV, workbooks, TDMS, MDF4, MATLAB, HDF5, Parquet), state kind and cycles
    in the options or in a `runs.json`. JSON files in a folder named inspections are sent as inspections. A `clutch.json`
    registers the clutch that it names.

    While the service is away, runs wait in the spool; the next call sends them first. A corrected file replaces the
    version that waits.
    """
    reading = {"map": channel_map, "decimal": decimal, "missing": missing, "good": good}
    with options.errors_in_a_line():
        try:
            files = manifest.find(paths)
        except FileNotFoundError as error:
            options.fail(str(error), options.EX_DATAERR)
        unlisted = manifest.unlisted(paths)
        if rig is not None:
            files += [manifest.RunFile(path=record) for record in unlisted]
        elif unlisted:
            names = ", ".join(str(record) for record in unlisted)
            options.say(f"not sent, because kind and cycles are not known: {names}. {_REMEDY}")
        record = _record(paths, clutch)
        if record is None:
            _require_known(url, key, clutch)
        waiting = Spool.of(spool, url, clutch)
        runs = [_request(file, kind, cycles, reading, rig) for file in files if not file.is_inspection]
        inspections = [(file.path, None) for file in files if file.is_inspection]
        digests: set[str] = set()
        for resource, requests in ((RUNS, runs), (INSPECTIONS, inspections)):
            added, replaced = waiting.add(requests, resource)
            digests |= added
            for entry in replaced:
                options.say(_replacement(waiting, entry))
        _warn_of_others(waiting, digests)
        transmit([waiting], url, key, patience, lambda service, _: _register(service, clutch, record))


def _request(
    file: manifest.RunFile, kind: str | None, cycles: float | None, reading: Mapping[str, str | None], rig: str | None
) -> tuple[Path, dict[str, str] | None]:
    """A file and its request's parameters, from its manifest or else the options; None for a JSON body."""
    if file.path.suffix == ".json":
        return file.path, None
    stated: Mapping[str, str | None]
    if file.parameters is not None:
        stated = file.parameters
    elif rig is None and (kind is None or cycles is None):  # a rig's profile finds them
        options.fail(f"the kind and the cycles of {file.path} are not known. {_REMEDY}", options.EX_USAGE)
    else:
        stated = {"kind": kind, "cycles": None if cycles is None else repr(cycles), "filename": file.path.name}
    parameters = {**reading, "rig": rig, **stated}
    return file.path, {name: value for name, value in parameters.items() if value is not None}


def _replacement(spool: Spool, entry: Entry) -> str:
    """The line on a waiting file that a newer version replaces."""
    kept = f"the old version is kept in {spool.body(entry)}"
    if entry.perhaps_stored:
        kept += "; one attempt got no answer, so the old version may be stored: if so, withdraw it"
    return f"{entry.label}: replaces the version that waited since {entry.since}; {kept}"


def _warn_of_others(spool: Spool, digests: set[str]) -> None:
    """Print one line if other runs of the clutch wait than those given to this command; refusals were reported when
    they came."""
    other_entries = [entry for entry in spool.waiting() if entry.digest not in digests]
    if other_entries:
        oldest = min(entry.since for entry in other_entries)
        count = "1 other run waits" if len(other_entries) == 1 else f"{len(other_entries)} other runs wait"
        options.say(f"{count} for {spool.clutch_id} since {oldest} and will be sent too: see clutchlife spool list")


def _record(paths: list[Path], clutch_id: str) -> JsonObject | None:
    """The clutch's record in a `clutch.json` in one of the folders; None if there is none for this clutch."""
    for record in (path / manifest.CLUTCH_FILE for path in paths):
        body = json.loads(record.read_bytes()) if record.is_file() else {}
        if not isinstance(body, dict):
            raise ValueError(f"{record} must hold a JSON object")  # noqa: TRY004  (a wrong file, not a wrong call)
        if body.get("clutch_id") == clutch_id:
            return body
    return None


def _require_known(url: str, key: str | None, clutch_id: str) -> None:
    """End the command, before anything is kept, if the service does not know the clutch: its id may be mistyped."""
    with connect(url, key=key) as http:
        try:
            Service(http=http, patience=0.0).get(f"/v1/clutches/{clutch_id}")
        except ServiceAwayError:
            return
        except RefusedError as error:
            if error.unknown:
                options.fail(str(error), options.EX_DATAERR)


def _register(service: Service, clutch_id: str, record: JsonObject | None) -> None:
    """Register the clutch from its record; without a record it must be registered already."""
    if record is None:
        service.get(f"/v1/clutches/{clutch_id}")
    else:
        service.post("/v1/clutches", record)


app = typer.Typer(help="Runs that wait to be sent, or were refused.", no_args_is_help=True)

Clutch = Annotated[str | None, typer.Option("--clutch", help="Only this clutch")]


@app.command(name="list")
def list_runs(
    clutch: Clutch = None,
    spool: SpoolFolder = SPOOL,
    as_json: Annotated[bool, typer.Option("--json", help="Print the runs as JSON")] = False,
) -> None:
    """List the runs that wait, with the last answer; the refused runs, with the reason; and the replaced versions."""
    with options.errors_in_a_line():
        entries = _spooled_entries(spool, clutch)
        if as_json:
            typer.echo(json.dumps({"items": [_item(spool, entry) for entry in entries]}, indent=1, ensure_ascii=False))
            return
        _print(spool, entries)
        if not entries:
            options.print_line(f"nothing is in the spool {spool}")


@app.command()
def send(
    clutch: Clutch = None,
    url: options.Url = options.URL,
    key: options.Key = None,
    spool: SpoolFolder = SPOOL,
    patience: options.Patience = 60.0,
) -> None:
    """Send the runs that wait for the service at --url. Runs for other addresses stay, because the key belongs to this
    service."""
    with options.errors_in_a_line():
        same_service: list[Spool] = []
        for each in Spool.every(spool) if clutch is None else [Spool.of(spool, url, clutch)]:
            count = len(each.waiting())
            if count and each.url == url.rstrip("/"):
                same_service.append(each)
            elif count:
                options.say(
                    f"{count} runs in {each.folder} are not sent: they belong to {each.clutch_id} at {each.url}"
                )
        if not same_service:
            options.print_line(f"nothing waits for {url}")
            return
        transmit(same_service, url, key, patience, lambda service, each: _register(service, each.clutch_id, None))


@app.command()
def empty(
    refused: Annotated[bool, typer.Option("--refused", help="Only refused runs and replaced versions")] = False,
    clutch: Clutch = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask")] = False,
    spool: SpoolFolder = SPOOL,
) -> None:
    """Show what is in the spool, ask whether to delete it, and then delete it for good."""
    with options.errors_in_a_line():
        listed = [entry for entry in _spooled_entries(spool, clutch) if entry.state != WAITING or not refused]
        if not listed:
            options.print_line("nothing to delete")
            return
        _print(spool, listed)
        waiting = sum(entry.state == WAITING for entry in listed)
        question = f"Delete these {len(listed)} for good? {waiting} of them were never stored by the service."
        if not yes and not typer.confirm(question, err=True):
            options.fail("nothing was deleted")
        try:
            for owner, entries in groupby(listed, _owner):
                with Spool.of(spool, *owner).sending(0.0):
                    Spool.of(spool, *owner).discard(entries)
        except HeldError:
            options.fail("another process is sending from the spool: try again when it has ended", options.EX_TEMPFAIL)
        options.print_line(f"{len(listed)} deleted; the service never stored {waiting} of them")


def _spooled_entries(folder: Path, clutch: str | None) -> list[Entry]:
    """All entries in the spools, or those of one clutch."""
    if folder.exists() and not folder.is_dir():
        options.fail(f"{folder} is not a folder", options.EX_DATAERR)
    spools = [spool for spool in Spool.every(folder) if clutch in (None, spool.clutch_id)]
    return [entry for spool in spools for entry in (*spool.waiting(), *spool.refused(), *spool.replaced())]


def _owner(entry: Entry) -> tuple[str, str]:
    """The service and the clutch that a file is sent to."""
    return entry.url, entry.clutch_id


def _item(folder: Path, entry: Entry) -> JsonObject:
    """A waiting or refused file as JSON."""
    head = entry.head
    return {
        "state": entry.state,
        "clutch_id": entry.clutch_id,
        "url": entry.url,
        "resource": entry.resource,
        "run_id": head.run_id,
        "files": list(entry.sources),
        "kind": head.kind,
        "cycles": head.cycles,
        "since": entry.since,
        "tries": entry.tries,
        "last_try": entry.last_try,
        "last_answer": entry.last_answer,
        "perhaps_stored": entry.perhaps_stored,
        "problem": entry.problem if entry.state == REFUSED else None,
        "path": str(folder / entry.body),
    }


def _print(folder: Path, kept: list[Entry]) -> None:
    """Print one line per clutch and one per run."""
    for (url, clutch_id), entries in groupby(kept, _owner):
        options.print_line(f"{clutch_id} at {url}, in {folder}")
        for entry in entries:
            options.print_line(f"  {_line(entry)}")


def _line(entry: Entry) -> str:
    """A waiting or refused file as a printed line."""
    head = entry.head
    kind = "inspection" if entry.resource == INSPECTIONS else head.kind or "kind not stated"
    cycles = "cycles not stated" if head.cycles is None else f"{head.cycles:g} cycles"
    if entry.state == REFUSED:
        tried = str(entry.problem.get("detail") or entry.problem.get("title") or "no reason is stored")
    elif entry.state == REPLACED:
        tried = "a newer version was pushed"
    elif entry.tries:
        tried = f"tried {entry.tries} times, last {entry.last_try}: {entry.last_answer}"
    else:
        tried = "not tried yet"
    return f"{entry.state:<8}  {entry.label}  {kind}  {cycles}  since {entry.since}  {tried}"
