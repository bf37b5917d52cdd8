"""Runs as files: one JSON file a run, holding what is posted, and `clutch.json` beside them for the clutch's record."""

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

CLUTCH_FILE = "clutch.json"
#: What claims more cycles than this is no run.
MOST_CYCLES = 1e15


def write(path: Path, body: dict[str, Any]) -> None:
    """One body into one file, whole or not at all."""
    partial = path.with_suffix(path.suffix + ".part")
    partial.write_text(json.dumps(body, allow_nan=False, separators=(",", ":")) + "\n", encoding="utf-8")
    partial.replace(path)


def find(paths: Iterable[Path]) -> list[Path]:
    """The files named, and of folders the `.json` files in them, each folder's by cycles where the file tells them.

    Raises FileNotFoundError for a path that is not there.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = [each for each in path.glob("*.json") if each.name != CLUTCH_FILE]
            found += sorted(inside, key=lambda each: (_cycles(each), each.name))
        elif path.exists():
            found.append(path)
        else:
            raise FileNotFoundError(f"{path} is not there")
    return found


def _cycles(path: Path) -> float:
    """The cycles that a run file tells, for ordering alone; what is no run comes last and is refused by the service."""
    try:
        body = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return math.inf
    cycles = body.get("cycles") if isinstance(body, dict) else None
    return float(cycles) if isinstance(cycles, int | float) and abs(cycles) < MOST_CYCLES else math.inf
