"""What a waiting run states of itself: enough to show it, and to tell whether another is a newer version of it."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

#: Fields of a JSON body that describe the run; all others are what was measured or done.
_DESCRIBING = ("run_id", "kind", "cycles", "started_at", "origin")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunHead:
    """A run's name, kind, cycles and start as stated (None where not), and a hash of everything else where a start is."""

    run_id: str | None = None
    kind: str | None = None
    cycles: float | None = None
    started_at: str | None = None
    measurements: str = ""


def head_of_body(body: bytes) -> RunHead:
    """The head of a JSON body; an empty one where it is not a run: the service will say so."""
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
    try:
        cycles: float | None = float(run.get("cycles", "none"))
    except (TypeError, ValueError, OverflowError):
        cycles = None
    if cycles is not None and not math.isfinite(cycles):
        cycles = None
    run_id, kind, started_at = (_text(run.get(name)) for name in ("run_id", "kind", "started_at"))
    return RunHead(run_id=run_id, kind=kind, cycles=cycles, started_at=started_at)


def _text(value: object) -> str | None:
    return value if isinstance(value, str) and value else None


def same_run(older: RunHead, newer: RunHead, *, same_file: bool) -> bool:
    """Whether two contents are versions of one run: by name where both state one, else by the file that they come from.

    A recorder may write every run into the same file: where both state a start, and starts and measurements differ, they are
    two runs.
    """
    if older.run_id is not None and newer.run_id is not None:
        return older.run_id == newer.run_id
    if older.started_at is not None and newer.started_at is not None and _instant(older) != _instant(newer):
        return same_file and older.measurements == newer.measurements
    return same_file


def _instant(head: RunHead) -> datetime | str | None:
    """The start, the same in every time zone; as stated where it is no time with one: the service will say so."""
    try:
        return datetime.fromisoformat(head.started_at or "").astimezone(UTC)
    except (ValueError, OverflowError):
        return head.started_at
