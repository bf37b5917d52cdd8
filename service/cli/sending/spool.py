"""Runs that are still to be sent, kept on disk until the service has stored them.

A run is copied into the spool before it is sent and removed when the service has answered that it is stored (now or
earlier), so a crash or a power cut on the sender's side loses nothing. A run that the service refuses is moved to
`refused/`, with the answer beside it.
"""

import hashlib
import io
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

#: Beside a record file: the parameters of its request, as JSON.
_PARAMETERS = ".asked"


def default_folder() -> Path:
    """$XDG_STATE_HOME/clutchlife/spool, or ~/.local/state/clutchlife/spool."""
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "clutchlife" / "spool"


@dataclass(frozen=True, slots=True, kw_only=True)
class Spool:
    """The spool of one service and one clutch, below `folder`."""

    folder: Path

    @classmethod
    def of(cls, folder: Path, url: str, clutch_id: str) -> "Spool":
        """The spool for a clutch at a service."""
        name = hashlib.sha256(f"{url.rstrip('/')}\n{clutch_id}".encode()).hexdigest()[:16]
        spool = cls(folder=folder / name)
        spool.folder.mkdir(parents=True, exist_ok=True)
        return spool

    def add(self, body: bytes) -> Path:
        """Keep a JSON body; the same body is kept once. Entries keep the order in which they came."""
        return self._keep(hashlib.sha256(body).hexdigest()[:24], ".json", io.BytesIO(body))

    def add_file(self, path: Path, parameters: Mapping[str, str]) -> Path:
        """Keep a run's file and the parameters of its request."""
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256")
            digest.update(json.dumps(dict(parameters), sort_keys=True).encode())
            file.seek(0)
            kept = self._keep(digest.hexdigest()[:24], ".run", file)
        beside = kept.with_suffix(_PARAMETERS)
        if not beside.exists():
            beside.write_text(json.dumps(dict(parameters)), encoding="utf-8")
        return kept

    def parameters(self, path: Path) -> dict[str, str] | None:
        """The parameters of a file's request; None for a JSON body."""
        if path.suffix == ".json":
            return None
        parameters: dict[str, str] = json.loads(path.with_suffix(_PARAMETERS).read_text(encoding="utf-8"))
        return parameters

    def _keep(self, digest: str, suffix: str, source: BinaryIO) -> Path:
        present = next(self.folder.glob(f"*-{digest}{suffix}"), None)
        if present is not None:
            return present
        last = max((int(path.name.partition("-")[0]) for path in self._entries()), default=0)
        path = self.folder / f"{last + 1:08d}-{digest}{suffix}"
        partial = path.with_suffix(".part")
        with partial.open("wb") as file:
            shutil.copyfileobj(source, file)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
        return path

    def waiting(self) -> Iterator[Path]:
        """The entries, oldest first."""
        yield from sorted(self._entries())

    def _entries(self) -> list[Path]:
        return [path for path in self.folder.glob("[0-9]*-*") if path.suffix in (".json", ".run")]

    def done(self, path: Path) -> None:
        """Remove an entry that the service has stored."""
        path.unlink(missing_ok=True)
        path.with_suffix(_PARAMETERS).unlink(missing_ok=True)

    def refused(self, path: Path, problem: dict[str, Any]) -> Path:
        """Move an entry that the service refuses to `refused/`, with the answer beside it."""
        aside = self.folder / "refused"
        aside.mkdir(exist_ok=True)
        answer = aside / f"{path.stem}.problem"
        answer.write_text(json.dumps(problem, indent=1, ensure_ascii=False), encoding="utf-8")
        beside = path.with_suffix(_PARAMETERS)
        if beside.exists():
            beside.replace(aside / beside.name)
        return path.replace(aside / path.name)
