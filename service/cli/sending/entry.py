"""A run or an inspection in the spool: the bytes that will be sent, and what is known of it, as JSON in `NAME.entry`.

Earlier releases wrote no `.entry`: `NAME.json` was a body, and `NAME.run` a record file with the parameters of its
request in `NAME.asked`. They are read as entries of which less is known.
"""

import json
from dataclasses import asdict, dataclass, field, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from service.cli.sending import run_head
from service.cli.sending.run_head import RunHead

#: What is known of a run; its bytes; the same two of earlier releases, and their parameters; the answer to a refused run.
ENTRY, BODY, OLD_BODIES, OLD_PARAMETERS, PROBLEM = ".entry", ".body", (".json", ".run"), ".asked", ".problem"
#: What is sent to, below the clutch's address.
RUNS, INSPECTIONS = "runs", "inspections"
#: A file that is being written.
PARTIAL = ".part"


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One run or inspection in a folder of the spool. `stem` is its number and its content's digest, the name of its files.

    `failures`: tries at which the service was there and did not take the run; `perhaps_stored`: a try may have been carried
    out without an answer.
    """

    stem: str
    body: str
    since: str
    url: str | None = None
    clutch_id: str | None = None
    resource: str = RUNS
    parameters: dict[str, str] | None = None
    head: RunHead = field(default_factory=RunHead)
    sources: tuple[str, ...] = ()
    tries: int = 0
    failures: int = 0
    last_try: str | None = None
    last_answer: str | None = None
    perhaps_stored: bool = False
    #: Whether it can be sent: a process that was killed may have left a record file without its parameters.
    whole: bool = True

    @property
    def digest(self) -> str:
        """What tells its content from others'."""
        return digest(self.stem)

    @property
    def label(self) -> str:
        """How a person would call the run."""
        files = ", ".join(Path(source).name for source in self.sources)
        return self.head.run_id or files or self.body


def digest(stem: str) -> str:
    """The part of a name that tells an entry's content from others'."""
    return stem.partition("-")[2]


def number(stem: str) -> int:
    """An entry's place in the order in which runs came."""
    digits = stem.partition("-")[0]
    return int(digits) if digits.isdecimal() else 0


def stamp(moment: float | None = None) -> str:
    """Now, or that time since the epoch [s], as text in UTC."""
    time = datetime.now(UTC) if moment is None else datetime.fromtimestamp(moment, UTC)
    return time.isoformat(timespec="seconds")


def read(folder: Path) -> list[Entry]:
    """All entries of a folder, oldest first, whoever changes it meanwhile."""
    names = {path.name for path in folder.glob("[0-9]*-*")}
    entries = [load(folder, name.removesuffix(ENTRY)) for name in names if name.endswith(ENTRY)]
    for name in names:
        stem, suffix = Path(name).stem, Path(name).suffix
        if suffix in OLD_BODIES and stem + ENTRY not in names:
            entries.append(_old(folder, stem, suffix))
    return sorted((entry for entry in entries if entry is not None), key=lambda entry: (number(entry.stem), entry.stem))


def encoded(entry: Entry) -> bytes:
    """The content of its `.entry` file."""
    return json.dumps(asdict(entry), indent=1, ensure_ascii=False).encode()


def load(folder: Path, stem: str) -> Entry | None:
    """The entry of that name; None where there is none."""
    path = folder / (stem + ENTRY)
    try:
        return decoded(path.read_bytes())
    except FileNotFoundError:
        return None
    except (ValueError, TypeError, KeyError):
        body = next((stem + suffix for suffix in (BODY, *OLD_BODIES) if (folder / (stem + suffix)).exists()), stem)
        return Entry(stem=stem, body=body, since=_written(path) or stamp(), whole=False)


def decoded(content: bytes) -> Entry:
    """The entry whose file holds this; raises ValueError, TypeError or KeyError where it holds none."""
    record: dict[str, Any] = json.loads(content)
    values = {name: record[name] for name in _NAMES & record.keys()}
    return Entry(**values | {"head": RunHead(**record["head"]), "sources": tuple(record["sources"])})


#: A later release's fields are passed over.
_NAMES = {item.name for item in fields(Entry)}


def _old(folder: Path, stem: str, suffix: str) -> Entry | None:
    """An entry that an earlier release wrote; None where it has just gone."""
    body = stem + suffix
    since = _written(folder / body)
    if since is None:
        return None
    parameters: dict[str, str] | None = None
    try:
        if suffix == ".json":
            head = run_head.of_body((folder / body).read_bytes())
        else:
            parameters = json.loads((folder / stem).with_suffix(OLD_PARAMETERS).read_bytes())
            head = run_head.of_file(parameters or {}, measurements=stem)
    except (OSError, ValueError):
        return Entry(stem=stem, body=body, since=since, whole=False)
    return Entry(stem=stem, body=body, since=since, parameters=parameters, head=head)


def _written(path: Path) -> str | None:
    try:
        return stamp(path.stat().st_mtime)
    except OSError:
        return None
