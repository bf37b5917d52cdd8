"""`clutchlife spool`: what waits to be sent, was refused or was replaced; send it, or delete it."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from service.cli.options import EX_DATAERR, EX_TEMPFAIL, URL, Key, Patience, Url, errors_in_a_line, fail, print_line
from service.cli.sending.entry import INSPECTIONS, Entry
from service.cli.sending.folder_lock import HeldError
from service.cli.sending.push import SPOOL, SpoolFolder
from service.cli.sending.spool import Spool
from service.cli.sending.spool_files import REFUSED, REPLACED
from service.cli.sending.transmission import say, transmit

app = typer.Typer(help="Runs that wait to be sent, or were refused.", no_args_is_help=True)

Clutch = Annotated[str | None, typer.Option("--clutch", help="Of this clutch only")]
WAITING, BROKEN = "waiting", "broken"


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """An entry with the spool that it is in, and what it is there: waiting, broken, refused or replaced."""

    spool: Spool
    state: str
    entry: Entry

    @property
    def place(self) -> str:
        """The folder below the spool's."""
        return self.state if self.state in (REFUSED, REPLACED) else ""


@app.command(name="list")
def list_runs(
    clutch: Clutch = None,
    spool: SpoolFolder = SPOOL,
    as_json: Annotated[bool, typer.Option("--json", help="Print the runs as JSON")] = False,
) -> None:
    """What waits, since when, how often it was tried and what was answered; what was refused and why; what was replaced."""
    with errors_in_a_line():
        kept = _kept(spool, clutch)
        if as_json:
            typer.echo(json.dumps({"items": [_item(run) for run in kept]}, indent=1, ensure_ascii=False))
            return
        _print(kept)
        if not kept:
            print_line(f"nothing is in the spool {spool}")


@app.command()
def send(
    clutch: Clutch = None,
    url: Url = URL,
    key: Key = None,
    spool: SpoolFolder = SPOOL,
    patience: Patience = 60.0,
) -> None:
    """Send what waits for the service at --url; no other address is asked, for the key is this service's."""
    with errors_in_a_line():
        spools = [kept for kept in Spool.every(spool) if kept.waiting()]
        if clutch is not None:
            spools = [kept for kept in [Spool.of(spool, url, clutch)] if kept.waiting()]
        here = [kept for kept in spools if kept.url == url.rstrip("/")]
        for kept in spools:
            if kept not in here:
                whose = f"{kept.clutch_id} at {kept.url}" if kept.url else "a clutch that is not stated: give --clutch"
                say(f"{len(kept.waiting())} runs in {kept.folder} are not sent: they are of {whose}")
        if not here:
            print_line(f"nothing waits for {url}")
            return
        transmit(here, url, key, patience, lambda service, kept: service.get(f"/v1/clutches/{kept.clutch_id}"))


@app.command()
def empty(
    refused: Annotated[bool, typer.Option("--refused", help="Only refused runs and replaced versions")] = False,
    clutch: Clutch = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask")] = False,
    spool: SpoolFolder = SPOOL,
) -> None:
    """Delete what is in the spool, for good, after showing it and asking; runs that were never sent are counted."""
    with errors_in_a_line():
        kept = [run for run in _kept(spool, clutch) if run.place or not refused]
        if not kept:
            print_line("nothing to delete")
            return
        _print(kept)
        waiting = sum(not run.place for run in kept)
        question = f"Delete these {len(kept)} for good? {waiting} of them wait and were never stored."
        if not yes and not typer.confirm(question, err=True):
            fail("nothing was deleted")
        try:
            for owner in {run.spool.folder: run.spool for run in kept}.values():
                with owner.sending(0.0):
                    for run in kept:
                        if run.spool == owner:
                            owner.discard(run.place, run.entry)
        except HeldError:
            fail("a process is sending from the spool: try again when it has ended", EX_TEMPFAIL)
        print_line(f"{len(kept)} deleted, {waiting} of them never stored")


def _kept(folder: Path, clutch: str | None) -> list[Kept]:
    """Everything in the spools, of one clutch where it is given."""
    kept = []
    if folder.exists() and not folder.is_dir():
        fail(f"{folder} is not a folder", EX_DATAERR)
    for spool in Spool.every(folder):
        if clutch is None or spool.clutch_id == clutch:
            states = {
                WAITING: spool.waiting(),
                BROKEN: spool.broken(),
                REFUSED: spool.refused(),
                REPLACED: spool.replaced(),
            }
            kept += [
                Kept(spool=spool, state=state, entry=entry) for state, members in states.items() for entry in members
            ]
    return kept


def _item(run: Kept) -> dict[str, Any]:
    entry, head = run.entry, run.entry.head
    return {
        "state": run.state,
        "clutch_id": run.spool.clutch_id,
        "url": run.spool.url,
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
        "problem": run.spool.problem(entry) if run.state == REFUSED else None,
        "path": str(run.spool.folder / run.place / entry.body),
    }


def _print(kept: list[Kept]) -> None:
    """A line a clutch, and a line a run."""
    owner = None
    for run in kept:
        if run.spool != owner:
            owner = run.spool
            name = (
                f"{owner.clutch_id} at {owner.url}" if owner.clutch_id else "clutch not stated (an earlier release's)"
            )
            print_line(f"{name}, in {owner.folder}")
        print_line(f"  {_line(run)}")


def _line(run: Kept) -> str:
    entry, head = run.entry, run.entry.head
    kind = "inspection" if entry.resource == INSPECTIONS else head.kind or "kind not stated"
    cycles = "cycles not stated" if head.cycles is None else f"{head.cycles:g} cycles"
    tried = (
        "not tried yet" if not entry.tries else f"tried {entry.tries} times, last {entry.last_try}: {entry.last_answer}"
    )
    if run.state == REFUSED:
        problem = run.spool.problem(entry)
        tried = str(problem.get("detail") or problem.get("title") or "the reason is not there")
    elif run.state == BROKEN:
        tried = "not kept whole: push its file again"
    elif run.state == REPLACED:
        tried = "a newer version was pushed"
    return f"{run.state:<8}  {entry.label}  {kind}  {cycles}  since {entry.since}  {tried}"
