"""Runs and inspections that are still to be sent, kept on disk until the service has stored them.

A run is copied into the spool before it is sent and removed when the service has answered that it is stored (now or
earlier), so a crash or a power cut on the sender's side loses nothing. Of a run that the service refuses the answer is kept
beside it; a run of which a newer version came is marked as replaced and never sent.

The bytes of each are a file of the folder; an SQLite database beside them says whose they are, in which state, and what came
of the tries. Bytes are on the disk before their entry is, and are deleted before it: without an entry they were not kept
yet, and an entry without bytes is done. That a newer version replaces older ones is one transaction.
"""

import hashlib
import json
import math
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from service.client.clutchlife.answers import JsonObject

#: What is known of all; the bytes of one; a file that is being written.
DATABASE, BODY, PARTIAL = "spool.sqlite", ".body", ".part"
#: What is sent to, below the clutch's address.
RUNS, INSPECTIONS = "runs", "inspections"
WAITING, REFUSED, REPLACED = "waiting", "refused", "replaced"
#: [s] How long a change waits for those of other processes. Chosen: a file of a gigabyte is copied in much less.
_PATIENCE = 600.0
#: Bytes that are copied at once.
_CHUNK = 1 << 20
#: Hexadecimal digits of the name of a lock and of a content.
_LOCK_DIGITS, _CONTENT_DIGITS = 16, 24
_TABLE = """CREATE TABLE IF NOT EXISTS entry (number INTEGER PRIMARY KEY, url TEXT NOT NULL, clutch_id TEXT NOT NULL,
    state TEXT NOT NULL, digest TEXT NOT NULL, known TEXT NOT NULL)"""
#: A commit is on the disk, and so is that its journal is gone.
_DURABLE = "PRAGMA synchronous = EXTRA"
_OF_STATE = "SELECT * FROM entry WHERE url = ? AND clutch_id = ? AND state = ? ORDER BY number"
#: An entry that waits, by its number, and what was set aside of its content.
_COPIES = """SELECT number FROM entry
    WHERE url = ? AND clutch_id = ? AND digest = ? AND (state <> 'waiting' OR number = ?) ORDER BY number"""
_THERE = "SELECT * FROM entry WHERE number = ? AND digest = ? AND state = 'waiting'"


#: Fields of a JSON body that describe the run; all others are what was measured or done.
_DESCRIBING = ("run_id", "kind", "cycles", "started_at", "origin")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunHead:
    """A run's name, kind, cycles and start as stated (None if not), and a hash of everything else if a start is stated."""

    run_id: str | None = None
    kind: str | None = None
    cycles: float | None = None
    started_at: str | None = None
    measurements: str = ""


def head_of_body(body: bytes) -> RunHead:
    """The head of a JSON body; empty if it is not a run, which the service will report."""
    try:
        run = json.loads(body, parse_int=float)  # 7000 is 7000.0
    except (ValueError, RecursionError):
        return RunHead()
    if not isinstance(run, dict):
        return RunHead()
    head = _stated(run)
    if head.started_at is None:
        return head
    measured = {name: value for name, value in run.items() if name not in _DESCRIBING}
    return replace(head, measurements=hashlib.sha256(json.dumps(measured, sort_keys=True).encode()).hexdigest())


def head_of_file(parameters: Mapping[str, str], measurements: str) -> RunHead:
    """The head of a record file: its request's parameters, and the hash of its bytes."""
    return replace(_stated(parameters), measurements=measurements)


def _stated(run: Mapping[str, Any]) -> RunHead:
    """The head of a run as its file states it; None for each field that is missing or unusable."""
    try:
        cycles: float | None = float(run.get("cycles", "none"))
    except (TypeError, ValueError, OverflowError):
        cycles = None
    if cycles is not None and not math.isfinite(cycles):
        cycles = None
    run_id, kind, started_at = (_filled(run.get(name)) for name in ("run_id", "kind", "started_at"))
    return RunHead(run_id=run_id, kind=kind, cycles=cycles, started_at=started_at)


def _filled(value: object) -> str | None:
    """A text; None for anything else and for an empty one."""
    return value if isinstance(value, str) and value else None


def same_run(older: RunHead, newer: RunHead, *, same_file: bool) -> bool:
    """Whether two contents are versions of one run: by name if both state one, else by their source file.

    A recorder may write every run into the same file: if both state a start, and starts and measurements differ, they
    are two runs.
    """
    if older.run_id is not None and newer.run_id is not None:
        return older.run_id == newer.run_id
    if older.started_at is not None and newer.started_at is not None and _instant(older) != _instant(newer):
        return same_file and older.measurements == newer.measurements
    return same_file


def _instant(head: RunHead) -> datetime | str | None:
    """The start in UTC; unchanged if it is no time with a time zone, which the service will report."""
    try:
        return datetime.fromisoformat(head.started_at or "").astimezone(UTC)
    except (ValueError, OverflowError):
        return head.started_at


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A waiting run or inspection: its number in order of arrival, and its content's digest.

    `failures`: tries that the present service did not accept; `perhaps_stored`: a try may have succeeded without an
    answer; `problem`: the reason of its refusal.
    """

    number: int
    url: str
    clutch_id: str
    state: str = WAITING
    digest: str
    since: str
    resource: str = RUNS
    parameters: dict[str, str] | None = None
    head: RunHead = field(default_factory=RunHead)
    sources: tuple[str, ...] = ()
    tries: int = 0
    failures: int = 0
    last_try: str | None = None
    last_answer: str | None = None
    perhaps_stored: bool = False
    problem: JsonObject = field(default_factory=dict)

    @property
    def body(self) -> str:
        return _body(self.number, self.digest)

    @property
    def label(self) -> str:
        """The entry's name for messages."""
        files = ", ".join(Path(source).name for source in self.sources)
        return self.head.run_id or files or self.body


#: Columns of the table; the other fields are JSON in its last one, of which a later release's are passed over.
_COLUMNS = ("number", "url", "clutch_id", "state", "digest")
_KNOWN = {item.name for item in fields(Entry)} - set(_COLUMNS)


def _body(number: int, digest: str) -> str:
    """The name of the file that holds an entry's body."""
    return f"{number:08d}-{digest}{BODY}"


def _put(database: sqlite3.Connection, entry: Entry) -> None:
    """Store an entry, replacing the one with its number."""
    values = asdict(entry)
    columns = [values.pop(name) for name in _COLUMNS]
    known = json.dumps(values, ensure_ascii=False)
    database.execute("INSERT OR REPLACE INTO entry VALUES (?, ?, ?, ?, ?, ?)", (*columns, known))


def _entry(row: Sequence[Any]) -> Entry:
    """The entry of a row of the spool's database."""
    known = json.loads(row[len(_COLUMNS)])
    values = dict(zip(_COLUMNS, row, strict=False)) | {name: known[name] for name in _KNOWN & known.keys()}
    return Entry(**values | {"head": RunHead(**known["head"]), "sources": tuple(known["sources"])})


def stamp() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


class HeldError(Exception):
    """Another process holds the lock."""


@contextmanager
def _opened(path: Path, patience: float) -> Iterator[sqlite3.Connection]:
    """The open database of a file, created if needed; HeldError if another process holds it for longer than `patience`
    [s].

    Its other errors become OSError: the disk is full, the file is damaged, or the file system has no locks.
    """
    try:
        with closing(sqlite3.connect(path, timeout=patience, isolation_level=None)) as database:
            yield database
    except sqlite3.Error as error:
        if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY:
            raise HeldError(str(path)) from error
        raise OSError(f"{path} cannot be used ({error}): a spool is a local folder that can be written") from error


def _if_waiting(database: sqlite3.Connection, entry: Entry) -> Entry | None:
    """The present state of an entry; None if it no longer waits."""
    row = database.execute(_THERE, (entry.number, entry.digest)).fetchone()
    return None if row is None else _entry(row)


def _read(folder: Path, query: str, *values: str) -> list[tuple[Any, ...]]:
    """Rows of a folder's database; empty if there is none."""
    path = folder / DATABASE
    if not path.is_file() or path.stat().st_size == 0:
        return []
    with _opened(path, _PATIENCE) as database:
        return database.execute(query, values).fetchall()


def _sync(folder: Path) -> None:
    """Write a rename in this folder to disk; does nothing where folders cannot be opened (Windows)."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def default_folder() -> Path:
    """$XDG_STATE_HOME/clutchlife/spool, or ~/.local/state/clutchlife/spool."""
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "clutchlife" / "spool"


@dataclass(frozen=True, slots=True, kw_only=True)
class Spool:
    """A folder's queue of runs to send, for one clutch at one service."""

    folder: Path
    url: str
    clutch_id: str

    @classmethod
    def of(cls, folder: Path, url: str, clutch_id: str) -> "Spool":
        return cls(folder=folder, url=url.rstrip("/"), clutch_id=clutch_id)

    @classmethod
    def every(cls, folder: Path) -> list["Spool"]:
        """All non-empty spools of a folder."""
        owners = _read(folder, "SELECT DISTINCT url, clutch_id FROM entry ORDER BY url, clutch_id")
        return [cls(folder=folder, url=url, clutch_id=clutch_id) for url, clutch_id in owners]

    def waiting(self) -> list[Entry]:
        """The entries to send, in order of arrival; entries that failed inside the service come last."""
        return sorted(self._in_state(WAITING), key=lambda entry: entry.failures)

    def refused(self) -> list[Entry]:
        return self._in_state(REFUSED)

    def replaced(self) -> list[Entry]:
        return self._in_state(REPLACED)

    def _in_state(self, state: str) -> list[Entry]:
        entries = map(_entry, _read(self.folder, _OF_STATE, self.url, self.clutch_id, state))
        return [entry for entry in entries if self.body(entry).exists()]

    def body(self, entry: Entry) -> Path:
        return self.folder / entry.body

    def awaits(self, entry: Entry) -> bool:
        """Whether an entry is still to be sent: no other process sent it, and no newer version replaced it."""
        with self._changing() as database:
            return _if_waiting(database, entry) is not None

    def begin(self) -> None:
        """Repair the spool after a killed process; call it before the first run is sent."""
        with self._changing() as database:
            numbers = {_body(*row): row[0] for row in database.execute("SELECT number, digest FROM entry")}
            names = {path.name for path in self.folder.iterdir() if path.suffix in (BODY, PARTIAL)}
            for name in sorted(names - numbers.keys()):
                (self.folder / name).unlink()
            self._remove(database, [(number, name) for name, number in numbers.items() if name not in names])

    def add(
        self, files: Sequence[tuple[Path, Mapping[str, str] | None]], resource: str = RUNS
    ) -> tuple[set[str], list[Entry]]:
        """Keep runs: JSON bodies (no parameters), or files with the parameters of their requests; or inspections' bodies.

        The same content is kept once. An older version that waits is replaced in the same instant in which the newer one is
        kept; files of one call do not replace each other. Returns the digests of what was added, and what was replaced.
        """
        digests = [_digest(path, parameters) for path, parameters in files]
        batch = set(digests)
        replaced: list[Entry] = []
        self.begin()
        for (path, parameters), digest in zip(files, digests, strict=True):
            source = str(path.resolve())
            with self._changing() as database:
                waiting = list(map(_entry, database.execute(_OF_STATE, (self.url, self.clutch_id, WAITING))))
                present = next((other for other in waiting if other.digest == digest), None)
                entry = present or self._copied(database, path, parameters, resource)
                older = [
                    other
                    for other in waiting
                    if other.digest not in batch | {entry.digest}
                    and same_run(other.head, entry.head, same_file=source in other.sources)
                ]
                if older or source not in entry.sources:
                    sources = (*(other for other in entry.sources if other != source), source)
                    _put(database, replace(entry, sources=sources))
                for other in older:
                    _put(database, replace(other, state=REPLACED))
            replaced += older
            batch.add(entry.digest)
        return batch, replaced

    def _copied(
        self, database: sqlite3.Connection, path: Path, parameters: Mapping[str, str] | None, resource: str
    ) -> Entry:
        """Copy a run's bytes into the spool; returns its entry, not yet stored."""
        (number,) = database.execute("SELECT coalesce(max(number), 0) + 1 FROM entry").fetchone()
        partial = self.folder / f"{number:08d}{PARTIAL}"
        sha256 = hashlib.sha256()
        with path.open("rb") as file, partial.open("wb") as copy:
            while chunk := file.read(_CHUNK):
                sha256.update(chunk)
                copy.write(chunk)
            copy.flush()
            os.fsync(copy.fileno())
        measurements = sha256.hexdigest()
        if parameters is None:
            head = head_of_body(partial.read_bytes())
        else:
            head = head_of_file(parameters, measurements)
            sha256.update(_sorted_json(parameters))
        entry = Entry(
            number=number,
            url=self.url,
            clutch_id=self.clutch_id,
            digest=sha256.hexdigest()[:_CONTENT_DIGITS],
            since=stamp(),
            resource=resource,
            parameters=None if parameters is None else dict(parameters),
            head=head,
        )
        partial.replace(self.body(entry))
        _sync(self.folder)
        return entry

    def note(self, entry: Entry, **changes: Any) -> None:
        """Update an entry's fields if it still waits. Errors are ignored, because a full disk must not prevent sending."""
        with suppress(OSError), self._changing() as database:
            current = _if_waiting(database, entry)
            if current is not None:
                _put(database, replace(current, **changes))

    def done(self, entry: Entry) -> bool:
        """Remove an entry stored by the service, with its refused or replaced copies; true if it still waited."""
        with self._changing() as database:
            waited = _if_waiting(database, entry) is not None
            numbers = database.execute(_COPIES, (self.url, self.clutch_id, entry.digest, entry.number)).fetchall()
            self._remove(database, [(number, _body(number, entry.digest)) for (number,) in numbers])
            return waited

    def refuse(self, entry: Entry, problem: JsonObject) -> Path | None:
        """Set a refused entry aside with the service's answer; returns its path, None if it no longer waits."""
        with self._changing() as database:
            current = _if_waiting(database, entry)
            if current is None:
                return None
            _put(database, replace(current, state=REFUSED, problem=problem))
            return self.body(current)

    def discard(self, entries: Iterable[Entry]) -> None:
        """Delete entries for good, in any state."""
        with self._changing() as database:
            self._remove(database, [(entry.number, entry.body) for entry in entries])

    def _remove(self, database: sqlite3.Connection, entries: Sequence[tuple[int, str]]) -> None:
        """Delete entries by number and file name; the files first, to make room on a full disk."""
        for _, name in entries:
            (self.folder / name).unlink(missing_ok=True)
        database.executemany("DELETE FROM entry WHERE number = ?", [(number,) for number, _ in entries])

    @contextmanager
    def sending(self, patience: float) -> Iterator[None]:
        """Context in which no other process sends from this spool; HeldError if another does for longer than `patience`
        [s]."""
        self.folder.mkdir(parents=True, exist_ok=True)
        name = hashlib.sha256(f"{self.url}\n{self.clutch_id}".encode()).hexdigest()[:_LOCK_DIGITS]
        with _opened(self.folder / f"{name}.lock", patience) as lock:
            lock.execute("BEGIN EXCLUSIVE")
            yield

    @contextmanager
    def _changing(self) -> Iterator[sqlite3.Connection]:
        """A transaction during which no other process changes the folder; it is on disk once it has ended."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with _opened(self.folder / DATABASE, _PATIENCE) as database:
            database.execute(_DURABLE)
            database.execute("BEGIN IMMEDIATE")
            database.execute(_TABLE)
            yield database
            database.execute("COMMIT")


def _digest(path: Path, parameters: Mapping[str, str] | None) -> str:
    """A run's content digest: a hash of its bytes and of the parameters sent with them."""
    with path.open("rb") as file:
        sha256 = hashlib.file_digest(file, "sha256")
    if parameters is not None:
        sha256.update(_sorted_json(parameters))
    return sha256.hexdigest()[:_CONTENT_DIGITS]


def _sorted_json(parameters: Mapping[str, str]) -> bytes:
    return json.dumps(dict(parameters), sort_keys=True).encode()
