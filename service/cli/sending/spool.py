"""Runs and inspections that are still to be sent, kept on disk until the service has stored them.

A run is copied into the spool before it is sent and removed when the service has answered that it is stored (now or
earlier), so a crash or a power cut on the sender's side loses nothing. A run that the service refuses is moved to
`refused/`, with the answer beside it; a run of which a newer version came is moved to `replaced/` and never sent.

What is there always means one thing. Bytes (`.body`) without an `.entry` were not kept yet. An `.entry` without bytes
follows them to the folder where they are, or is done. That a newer version replaces older ones is decided by one rename,
that of `replacing.journal`, and carried out by whoever locks the folder next, with a lock that ends with its holder.
"""

import errno
import hashlib
import json
import os
import sys
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from service.cli.sending import run_head
from service.cli.sending.run_head import RunHead, same_run

#: What is known of a run; its bytes; the answer to a refused run.
ENTRY, BODY, PROBLEM = ".entry", ".body", ".problem"
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
    #: Whether it can be sent: the file of what is known of it may be damaged.
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
    entries = [load(folder, path.stem) for path in folder.glob(f"[0-9]*-*{ENTRY}")]
    return sorted((entry for entry in entries if entry is not None), key=lambda entry: (number(entry.stem), entry.stem))


def encoded(entry: Entry) -> bytes:
    """The content of its `.entry` file."""
    return json.dumps(asdict(entry), indent=1, ensure_ascii=False).encode()


def load(folder: Path, stem: str) -> Entry | None:
    """The entry of that name; None where there is none."""
    path = folder / (stem + ENTRY)
    try:
        content, since = path.read_bytes(), stamp(path.stat().st_mtime)
    except FileNotFoundError:
        return None
    try:
        return decoded(content)
    except (ValueError, TypeError, KeyError):
        return Entry(stem=stem, body=stem + BODY, since=since, whole=False)


def decoded(content: bytes) -> Entry:
    """The entry whose file holds this; raises ValueError, TypeError or KeyError where it holds none."""
    record: dict[str, Any] = json.loads(content)
    values = {name: record[name] for name in _NAMES & record.keys()}
    return Entry(**values | {"head": RunHead(**record["head"]), "sources": tuple(record["sources"])})


#: A later release's fields are passed over.
_NAMES = {item.name for item in fields(Entry)}


#: Seconds between two looks at a lock that another process holds. Chosen: short beside a request.
_LOOK = 0.05
_HELD = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)


class HeldError(Exception):
    """Another process holds the lock."""


@contextmanager
def locked(path: Path, *, patience: float | None = None) -> Iterator[None]:
    """Hold the lock of the file at `path`, which is made; HeldError where another holds it for longer than `patience` [s].

    Without a patience it is waited for. Raises OSError where the file system keeps no locks.
    """
    deadline = None if patience is None else time.monotonic() + patience
    with path.open("ab") as file:
        while not _taken(file.fileno(), path):
            if deadline is not None and time.monotonic() + _LOOK > deadline:
                raise HeldError(str(path))
            time.sleep(_LOOK)
        yield


def _taken(handle: int, path: Path) -> bool:
    try:
        if sys.platform == "win32":
            import msvcrt  # only there

            os.lseek(handle, 0, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl  # not on Windows

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _HELD:
            return False
        raise OSError(error.errno, f"{path} cannot be locked ({error.strerror}): choose a local folder") from error
    return True


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
        write(folder, entry.stem + ENTRY, encoded(entry))
        _sync(folder)
        return
    journal = {"entry": encoded(entry).decode(), "older": [other.stem for other in older]}
    write(folder, _JOURNAL, json.dumps(journal).encode())
    _sync(folder)
    carry_out(folder)


def carry_out(folder: Path) -> None:
    """What the journal says, if there is one: the newer entry waits, older ones are moved to `replaced/`."""
    path = folder / _JOURNAL
    if not path.exists():
        return
    journal = json.loads(path.read_bytes())
    entry = decoded(journal["entry"].encode())
    write(folder, entry.stem + ENTRY, encoded(entry))
    _sync(folder)
    for stem in journal["older"]:
        older = load(folder, stem)
        if digest(stem) == entry.digest:  # the same content, of which was no longer known what it is
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
    for name in (entry.body, entry.stem + ENTRY, entry.stem + PROBLEM):
        (place / name).unlink(missing_ok=True)


def mend(folder: Path) -> None:
    """Finish what a killed process began."""
    for partial in sorted(folder.glob(f"*{PARTIAL}")):
        partial.unlink()
    for entry in read(folder):
        if not (folder / entry.body).exists():
            _follow(folder, entry)
    for body in sorted(folder.glob(f"*{BODY}")):
        if not body.with_suffix(ENTRY).exists():
            body.unlink()


def _follow(folder: Path, entry: Entry) -> None:
    """Move an entry to where its bytes are; it is done where they are nowhere."""
    for place in (REFUSED, REPLACED):
        if (folder / place / entry.body).exists():
            move(folder, entry, place)
            return
    remove(folder, entry)


#: Bytes that are copied at once.
_CHUNK = 1 << 20
#: Hexadecimal digits of a folder's and of a content's name.
_FOLDER_DIGITS, _CONTENT_DIGITS = 16, 24

RunFiles = Sequence[tuple[Path, Mapping[str, str] | None]]


def default_folder() -> Path:
    """$XDG_STATE_HOME/clutchlife/spool, or ~/.local/state/clutchlife/spool."""
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "clutchlife" / "spool"


@dataclass(frozen=True, slots=True, kw_only=True)
class Spool:
    """The spool of one service and one clutch; `url` and `clutch_id` are None where nothing in the folder states them."""

    folder: Path
    url: str | None = None
    clutch_id: str | None = None

    @classmethod
    def of(cls, folder: Path, url: str, clutch_id: str) -> "Spool":
        """The spool for a clutch at a service, below the folder of all."""
        url = url.rstrip("/")
        name = hashlib.sha256(f"{url}\n{clutch_id}".encode()).hexdigest()[:_FOLDER_DIGITS]
        return cls(folder=folder / name, url=url, clutch_id=clutch_id)

    @classmethod
    def every(cls, folder: Path) -> list["Spool"]:
        """All spools below a folder; whose one is, its entries say."""
        paths = sorted(path for path in folder.glob("[0-9a-f]*") if path.is_dir() and len(path.name) == _FOLDER_DIGITS)
        return [cls._owned(path) for path in paths]

    @classmethod
    def _owned(cls, path: Path) -> "Spool":
        for place in (path, path / REFUSED, path / REPLACED):
            for entry in read(place):
                if entry.clutch_id is not None:
                    return cls(folder=path, url=entry.url, clutch_id=entry.clutch_id)
        return cls(folder=path)

    def waiting(self) -> list[Entry]:
        """What is to be sent, in the order in which it came; what failed inside the service comes last."""
        whole = [entry for entry in self._entries(self.folder) if entry.whole]
        return sorted(whole, key=lambda entry: entry.failures)

    def broken(self) -> list[Entry]:
        """What cannot be sent as it is: a process was killed while it kept it. Its file is to be pushed again."""
        return [entry for entry in self._entries(self.folder) if not entry.whole]

    def refused(self) -> list[Entry]:
        """What the service refused."""
        return self._entries(self.folder / REFUSED)

    def replaced(self) -> list[Entry]:
        """What was not sent because a newer version came."""
        return self._entries(self.folder / REPLACED)

    @staticmethod
    def _entries(place: Path) -> list[Entry]:
        return [entry for entry in read(place) if (place / entry.body).exists()]

    def problem(self, entry: Entry) -> dict[str, Any]:
        """Why a run was refused."""
        try:
            problem = json.loads((self.folder / REFUSED / (entry.stem + PROBLEM)).read_bytes())
        except (OSError, ValueError):
            return {}
        return problem if isinstance(problem, dict) else {}

    def body(self, entry: Entry) -> Path:
        """The file that is sent."""
        return self.folder / entry.body

    def awaits(self, entry: Entry) -> bool:
        """Whether an entry is still to be sent: it was not sent by another process, and no newer version came."""
        with self._changing():
            return self._there(entry)

    def _there(self, entry: Entry) -> bool:
        return (self.folder / (entry.stem + ENTRY)).exists()

    def begin(self) -> None:
        """Finish what a killed process began; to be called before the first run is sent."""
        with self._changing():
            mend(self.folder)

    def add(self, files: RunFiles, resource: str = RUNS) -> tuple[set[str], list[Entry]]:
        """Keep runs: JSON bodies (no parameters), or files with the parameters of their requests; or inspections' bodies.

        The same content is kept once. An older version that waits is replaced in the same instant in which the newer one is
        kept; files of one call do not replace each other. Returns the digests of what was added, and what was replaced.
        """
        digests = [_digest(path, parameters) for path, parameters in files]
        batch = set(digests)
        replaced: list[Entry] = []
        with self._changing():
            mend(self.folder)
            waiting = self._entries(self.folder)
            for (path, parameters), digest in zip(files, digests, strict=True):
                present = next((other for other in waiting if other.whole and other.digest == digest), None)
                entry = present or self._kept(_next(waiting), path, parameters, resource)
                source = str(path.resolve())
                older = [other for other in waiting if _older(other, entry, source, batch)]
                self._wait(entry, older, source)
                gone = {entry.stem, *(other.stem for other in older)}
                waiting = [*(other for other in waiting if other.stem not in gone), entry]
                replaced += [other for other in older if other.whole]
                batch.add(entry.digest)
        return batch, replaced

    def _wait(self, entry: Entry, older: Sequence[Entry], source: str) -> None:
        """Make an entry wait that comes from this file, in the place of older versions."""
        if older or source not in entry.sources:
            sources = (*(other for other in entry.sources if other != source), source)
            store(self.folder, replace(entry, sources=sources), older)

    def _kept(self, number: int, path: Path, parameters: Mapping[str, str] | None, resource: str) -> Entry:
        """The bytes of a run copied into the spool; its entry is still to be stored."""
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
            head = run_head.of_body(partial.read_bytes())
        else:
            head = run_head.of_file(parameters, measurements)
            sha256.update(_text(parameters))
        stem = f"{number:08d}-{sha256.hexdigest()[:_CONTENT_DIGITS]}"
        partial.replace(self.folder / (stem + BODY))
        return Entry(
            stem=stem,
            body=stem + BODY,
            since=stamp(),
            url=self.url,
            clutch_id=self.clutch_id,
            resource=resource,
            parameters=None if parameters is None else dict(parameters),
            head=head,
        )

    def note(self, entry: Entry, **changes: Any) -> None:
        """Change what is known of an entry, if it still waits. A full disk must not keep runs from being sent."""
        with suppress(OSError), self._changing():
            current = load(self.folder, entry.stem)
            if current is not None and current.whole:
                write(self.folder, entry.stem + ENTRY, encoded(replace(current, **changes)))

    def done(self, entry: Entry) -> bool:
        """Remove an entry that the service has stored, and its copies refused or replaced; whether it still waited."""
        with self._changing():
            waited = self._there(entry)
            for place in (REFUSED, REPLACED):
                for path in sorted((self.folder / place).glob(f"*-{entry.digest}.*")):
                    path.unlink()
            if waited:
                remove(self.folder, entry)
            return waited

    def refuse(self, entry: Entry, problem: dict[str, Any]) -> Path | None:
        """Move an entry that the service refuses to `refused/`, with the answer beside it; None where it waits no more."""
        with self._changing():
            if not self._there(entry):
                return None
            (self.folder / REFUSED).mkdir(exist_ok=True)
            answer = json.dumps(problem, indent=1, ensure_ascii=False).encode()
            write(self.folder, f"{REFUSED}/{entry.stem}{PROBLEM}", answer)
            return move(self.folder, entry, REFUSED)

    def discard(self, place: str, entry: Entry) -> None:
        """Delete an entry for good: from the folder (""), from `refused` or from `replaced`."""
        with self._changing():
            remove(self.folder / place, entry)

    @contextmanager
    def sending(self, patience: float) -> Iterator[None]:
        """Be the only process that sends from this spool; HeldError where another is for longer than `patience` [s]."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with locked(self.folder / "sending.lock", patience=patience):
            yield

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Be the only process that changes this spool."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with locked(self.folder / "changing.lock"):
            carry_out(self.folder)
            yield


def _next(waiting: Sequence[Entry]) -> int:
    return 1 + max((number(entry.stem) for entry in waiting), default=0)


def _older(other: Entry, entry: Entry, source: str, batch: Collection[str]) -> bool:
    """Whether `entry`, which comes from the file `source`, takes the place of `other`.

    It does where `other` is an older version of its run, or the same content whose entry is damaged.
    """
    if not other.whole:
        return other.digest == entry.digest
    new = other.digest != entry.digest and other.digest not in batch
    return new and same_run(other.head, entry.head, same_file=source in other.sources)


def _digest(path: Path, parameters: Mapping[str, str] | None) -> str:
    """What tells a run's content from others': a hash of its bytes, and of the parameters that are sent with them."""
    with path.open("rb") as file:
        sha256 = hashlib.file_digest(file, "sha256")
    if parameters is not None:
        sha256.update(_text(parameters))
    return sha256.hexdigest()[:_CONTENT_DIGITS]


def _text(parameters: Mapping[str, str]) -> bytes:
    return json.dumps(dict(parameters), sort_keys=True).encode()
