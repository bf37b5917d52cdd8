"""The files of one spool's folder, changed step by step so that a kill between two steps loses nothing and revives nothing.

What is there always means one thing. Bytes (`.body`) without an `.entry` were not kept yet. An `.entry` without bytes
follows them to the folder where they are, or is done. That a newer version replaces older ones is decided by one rename,
that of `replacing.journal`, and carried out by whoever locks the folder next.
"""

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from service.cli.sending import entry as entries
from service.cli.sending.entry import BODY, ENTRY, OLD_BODIES, OLD_PARAMETERS, PARTIAL, PROBLEM, Entry

REFUSED, REPLACED = "refused", "replaced"
_JOURNAL = "replacing.journal"


def write(folder: Path, name: str, content: bytes) -> None:
    """A file below the spool's folder, whole or not at all."""
    partial = folder / (Path(name).name + PARTIAL)
    with partial.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(folder / name)


def _sync(folder: Path) -> None:
    """A rename is on the disk; where folders cannot be opened (Windows), the file system sees to it."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def store(folder: Path, entry: Entry, older: Sequence[Entry]) -> None:
    """Make an entry wait, whose bytes are there, in the place of older versions: in one instant."""
    if not older:
        write(folder, entry.stem + ENTRY, entries.encoded(entry))
        _sync(folder)
        return
    journal = {"entry": entries.encoded(entry).decode(), "older": [other.stem for other in older]}
    write(folder, _JOURNAL, json.dumps(journal).encode())
    _sync(folder)
    carry_out(folder)


def carry_out(folder: Path) -> None:
    """What the journal says, if there is one: the newer entry waits, older ones are moved to `replaced/`."""
    path = folder / _JOURNAL
    if not path.exists():
        return
    journal = json.loads(path.read_bytes())
    entry = entries.decoded(journal["entry"].encode())
    write(folder, entry.stem + ENTRY, entries.encoded(entry))
    _sync(folder)
    for stem in journal["older"]:
        older = entries.load(folder, stem)
        if entries.digest(stem) == entry.digest:  # the same content, which lacked its parameters
            for remnant in sorted(folder.glob(f"{stem}.*")):
                remnant.unlink()
        elif older is not None:
            move(folder, older, REPLACED)
    path.unlink()


def move(folder: Path, entry: Entry, place: str) -> Path:
    """Move an entry from the folder to `refused/` or `replaced/`; its bytes first. Where they are then."""
    aside = folder / place
    aside.mkdir(exist_ok=True)
    body = folder / entry.body
    if body.exists():
        body.replace(aside / entry.body)
    (folder / (entry.stem + ENTRY)).replace(aside / (entry.stem + ENTRY))
    _sync(aside)
    return aside / entry.body


def remove(place: Path, entry: Entry) -> None:
    """Delete an entry of the folder, of `refused/` or of `replaced/`; its bytes first."""
    for name in (entry.body, entry.stem + ENTRY, entry.stem + OLD_PARAMETERS, entry.stem + PROBLEM):
        (place / name).unlink(missing_ok=True)


def mend(folder: Path, url: str | None, clutch_id: str | None) -> None:
    """Finish what a killed process began, and give the entries of an earlier release an `.entry` of their own."""
    for partial in sorted(folder.glob(f"*{PARTIAL}")):
        partial.unlink()
    for entry in entries.read(folder):
        if not (folder / entry.body).exists():
            _follow(folder, entry)
        elif entry.whole and entry.clutch_id is None:
            owned = replace(entry, url=url, clutch_id=clutch_id)
            write(folder, entry.stem + ENTRY, entries.encoded(owned))
    for body in sorted(folder.glob(f"*{BODY}")):
        if not body.with_suffix(ENTRY).exists():
            body.unlink()
    for parameters in sorted(folder.glob(f"*{OLD_PARAMETERS}")):
        if not parameters.with_suffix(OLD_BODIES[1]).exists():
            parameters.unlink()


def _follow(folder: Path, entry: Entry) -> None:
    """Move an entry to where its bytes are; it is done where they are nowhere."""
    for place in (REFUSED, REPLACED):
        if (folder / place / entry.body).exists():
            move(folder, entry, place)
            return
    remove(folder, entry)
