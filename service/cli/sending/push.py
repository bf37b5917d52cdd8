"""`clutchlife push`: send run files, keep what could not be sent, safe to repeat."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import (
    EX_DATAERR,
    EX_USAGE,
    URL,
    ChannelMap,
    Decimal,
    Key,
    Missing,
    Patience,
    Url,
    errors_in_a_line,
    fail,
)
from service.cli.sending.entry import INSPECTIONS, RUNS, Entry
from service.cli.sending.spool import Spool, default_folder
from service.cli.sending.transmission import say, transmit
from service.client.clutchlife.answers import RefusedError, ServiceAwayError
from service.client.clutchlife.transport import Service, connect
from service.run_files import manifest

SPOOL = default_folder()
_REMEDY = (
    "Push a file with --kind and --cycles, or with --rig where a profile finds them; list it in a "
    f"{manifest.MANIFEST} beside it; or use clutchlife import, which asks"
)
SpoolFolder = Annotated[Path, typer.Option("--spool", help="Where runs wait until the service has stored them")]


def push(
    paths: Annotated[list[Path], typer.Argument(metavar="PATH...", help="Run files, or folders of them")],
    clutch: Annotated[str, typer.Option(help="The clutch that was tested")],
    url: Url = URL,
    key: Key = None,
    spool: SpoolFolder = SPOOL,
    patience: Patience = 60.0,
    kind: Annotated[str | None, typer.Option(help="For files that are not JSON: the kind of run")] = None,
    cycles: Annotated[float | None, typer.Option(help="For files that are not JSON: duty cycles since new")] = None,
    rig: Annotated[
        str | None, typer.Option(help="For files that are not JSON: the rig by whose profile they are read")
    ] = None,
    channel_map: ChannelMap = None,
    decimal: Decimal = None,
    missing: Missing = None,
) -> None:
    """Send run files: JSON, or CSV, TDMS, MDF4 and Parquet, with their kind and cycles in a runs.json or in options.

    JSON files in a folder named inspections are sent as inspections.

    Runs that the service cannot store now wait in the spool and are sent first next time. A file that is pushed again with
    other content takes the place of the version that waits.
    """
    reading = {"map": channel_map, "decimal": decimal, "missing": missing}
    with errors_in_a_line():
        try:
            files = manifest.find(paths)
        except FileNotFoundError as error:
            fail(str(error), EX_DATAERR)
        unlisted = manifest.unlisted(paths)
        if rig is not None:
            files += [manifest.RunFile(path=record) for record in unlisted]
        elif unlisted:
            names = ", ".join(str(record) for record in unlisted)
            say(f"not sent, for their kind and cycles are not known: {names}. {_REMEDY}")
        if _record(paths) is None:
            _require_known(url, key, clutch)
        waiting = Spool.of(spool, url, clutch)
        runs = [_request(file, kind, cycles, reading, rig) for file in files if not file.of_inspection]
        inspections = [(file.path, None) for file in files if file.of_inspection]
        digests: set[str] = set()
        for resource, requests in ((RUNS, runs), (INSPECTIONS, inspections)):
            added, replaced = waiting.add(requests, resource)
            digests |= added
            for entry in replaced:
                say(_replacement(waiting, entry))
        _warn_of_others(waiting, digests)
        transmit([waiting], url, key, patience, lambda service, _: _register(service, clutch, paths))


def _request(
    file: manifest.RunFile, kind: str | None, cycles: float | None, reading: Mapping[str, str | None], rig: str | None
) -> tuple[Path, dict[str, str] | None]:
    """A file and the parameters of its request; None for a JSON body."""
    if file.path.suffix == ".json":
        return file.path, None
    given = {name: value for name, value in {**reading, "rig": rig}.items() if value is not None}
    return file.path, given | _parameters(file, kind, cycles, by_rig=rig is not None)


def _replacement(spool: Spool, entry: Entry) -> str:
    stored = "; a try got no answer, so it may be stored: withdraw it then" if entry.perhaps_stored else ""
    place = spool.folder / "replaced" / entry.body
    return f"{entry.label}: the version that waited since {entry.since} is replaced and not sent, see {place}{stored}"


def _warn_of_others(spool: Spool, digests: set[str]) -> None:
    """One line where other runs of the clutch wait than those that were just given; refusals were said when they came."""
    others = [entry for entry in spool.waiting() if entry.digest not in digests]
    if others:
        oldest = min(entry.since for entry in others)
        count = "1 other run waits" if len(others) == 1 else f"{len(others)} other runs wait"
        say(f"{count} for {spool.clutch_id} since {oldest} and will be sent too: see clutchlife spool list")


def _parameters(file: manifest.RunFile, kind: str | None, cycles: float | None, *, by_rig: bool) -> dict[str, str]:
    """The parameters of a record's request: from its manifest, else from the options; a rig's profile finds the others."""
    if file.parameters is not None:
        return dict(file.parameters)
    if by_rig:
        given = {"kind": kind, "cycles": None if cycles is None else repr(cycles), "filename": file.path.name}
        return {name: value for name, value in given.items() if value is not None}
    if kind is None or cycles is None:
        fail(f"the kind and the cycles of {file.path} are not known. {_REMEDY}", EX_USAGE)
    return {"kind": kind, "cycles": repr(cycles), "filename": file.path.name}


def _record(paths: list[Path]) -> Path | None:
    """The `clutch.json` in one of the folders."""
    return next((path / manifest.CLUTCH_FILE for path in paths if (path / manifest.CLUTCH_FILE).is_file()), None)


def _require_known(url: str, key: str | None, clutch_id: str) -> None:
    """End the command, before anything is kept, where the service says that it knows no such clutch: it may be mistyped."""
    with connect(url, key=key) as http:
        try:
            Service(http=http, patience=0.0).get(f"/v1/clutches/{clutch_id}")
        except ServiceAwayError:
            return
        except RefusedError as error:
            if error.unknown:
                fail(str(error), EX_DATAERR)


def _register(service: Service, clutch_id: str, paths: list[Path]) -> None:
    """Register the clutch from a `clutch.json` in one of the folders; without one it must be registered already."""
    record = _record(paths)
    if record is None:
        service.get(f"/v1/clutches/{clutch_id}")
        return
    body = json.loads(record.read_bytes())
    if not isinstance(body, dict):
        raise ValueError(f"{record} must hold a JSON object")  # noqa: TRY004  (a wrong file, not a wrong call)
    body["clutch_id"] = clutch_id
    service.post("/v1/clutches", json.dumps(body).encode())
