"""Runs and inspections that are still to be sent, kept on disk until the service has stored them.

A run is copied into the spool before it is sent and removed when the service has answered that it is stored (now or
earlier), so a crash or a power cut on the sender's side loses nothing. A run that the service refuses is moved to
`refused/`, with the answer beside it; a run of which a newer version came is moved to `replaced/` and never sent.
"""

import hashlib
import json
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from service.cli.sending import entry as entries
from service.cli.sending import run_head, spool_files
from service.cli.sending.entry import BODY, ENTRY, PARTIAL, PROBLEM, RUNS, Entry
from service.cli.sending.folder_lock import locked
from service.cli.sending.run_head import same_run
from service.cli.sending.spool_files import REFUSED, REPLACED

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
        """All spools below a folder; what an earlier release kept does not state whose it is."""
        paths = sorted(path for path in folder.glob("[0-9a-f]*") if path.is_dir() and len(path.name) == _FOLDER_DIGITS)
        return [cls._owned(path) for path in paths]

    @classmethod
    def _owned(cls, path: Path) -> "Spool":
        for place in (path, path / REFUSED, path / REPLACED):
            for entry in entries.read(place):
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
        return [entry for entry in entries.read(place) if (place / entry.body).exists()]

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
            spool_files.mend(self.folder, self.url, self.clutch_id)

    def add(self, files: RunFiles, resource: str = RUNS) -> tuple[set[str], list[Entry]]:
        """Keep runs: JSON bodies (no parameters), or files with the parameters of their requests; or inspections' bodies.

        The same content is kept once. An older version that waits is replaced in the same instant in which the newer one is
        kept; files of one call do not replace each other. Returns the digests of what was added, and what was replaced.
        """
        digests = [_digest(path, parameters) for path, parameters in files]
        batch = set(digests)
        replaced: list[Entry] = []
        with self._changing():
            spool_files.mend(self.folder, self.url, self.clutch_id)
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
            spool_files.store(self.folder, replace(entry, sources=sources), older)

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
            since=entries.stamp(),
            url=self.url,
            clutch_id=self.clutch_id,
            resource=resource,
            parameters=None if parameters is None else dict(parameters),
            head=head,
        )

    def note(self, entry: Entry, **changes: Any) -> None:
        """Change what is known of an entry, if it still waits. A full disk must not keep runs from being sent."""
        with suppress(OSError), self._changing():
            current = entries.load(self.folder, entry.stem)
            if current is not None and current.whole:
                spool_files.write(self.folder, entry.stem + ENTRY, entries.encoded(replace(current, **changes)))

    def done(self, entry: Entry) -> bool:
        """Remove an entry that the service has stored, and its copies refused or replaced; whether it still waited."""
        with self._changing():
            waited = self._there(entry)
            for place in (REFUSED, REPLACED):
                for path in sorted((self.folder / place).glob(f"*-{entry.digest}.*")):
                    path.unlink()
            if waited:
                spool_files.remove(self.folder, entry)
            return waited

    def refuse(self, entry: Entry, problem: dict[str, Any]) -> Path | None:
        """Move an entry that the service refuses to `refused/`, with the answer beside it; None where it waits no more."""
        with self._changing():
            if not self._there(entry):
                return None
            (self.folder / REFUSED).mkdir(exist_ok=True)
            answer = json.dumps(problem, indent=1, ensure_ascii=False).encode()
            spool_files.write(self.folder, f"{REFUSED}/{entry.stem}{PROBLEM}", answer)
            return spool_files.move(self.folder, entry, REFUSED)

    def discard(self, place: str, entry: Entry) -> None:
        """Delete an entry for good: from the folder (""), from `refused` or from `replaced`."""
        with self._changing():
            spool_files.remove(self.folder / place, entry)

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
            spool_files.carry_out(self.folder)
            yield


def _next(waiting: Sequence[Entry]) -> int:
    return 1 + max((entries.number(entry.stem) for entry in waiting), default=0)


def _older(other: Entry, entry: Entry, source: str, batch: Collection[str]) -> bool:
    """Whether `entry`, which comes from the file `source`, takes the place of `other`.

    It does where `other` is an older version of its run, or the same content that a killed process left without parameters.
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
