"""What is still to be sent, kept on disk until the service has it for good.

A run is copied into the spool before it is sent and taken out when the service has answered that it is stored (or that
it has it already), so a crash or a power cut on the sender's side loses nothing. What the service refuses is put aside
under `refused/` with its answer.
"""

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any


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
        """Keep a body; the same body is kept once. Entries keep the order in which they came."""
        digest = hashlib.sha256(body).hexdigest()[:24]
        known = next(self.folder.glob(f"*-{digest}.json"), None)
        if known is not None:
            return known
        last = max((int(path.name.partition("-")[0]) for path in self._entries()), default=0)
        path = self.folder / f"{last + 1:08d}-{digest}.json"
        partial = path.with_suffix(".part")
        with partial.open("wb") as file:
            file.write(body)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
        return path

    def waiting(self) -> Iterator[Path]:
        """The entries, oldest first."""
        yield from sorted(self._entries())

    def _entries(self) -> list[Path]:
        return list(self.folder.glob("[0-9]*-*.json"))

    def done(self, path: Path) -> None:
        """The service has it."""
        path.unlink()

    def refused(self, path: Path, problem: dict[str, Any]) -> Path:
        """The service will not have it: aside, with its answer beside it."""
        aside = self.folder / "refused"
        aside.mkdir(exist_ok=True)
        answer = aside / f"{path.stem}.problem"
        answer.write_text(json.dumps(problem, indent=1, ensure_ascii=False), encoding="utf-8")
        return path.replace(aside / path.name)
