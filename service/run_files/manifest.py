"""Runs as files: JSON files that hold what is posted, records that a manifest lists, and `clutch.json` for the clutch.

The manifest, `runs.json`, says of each record file (CSV, TDMS, MDF4, Parquet) what its channels do not:

    [{"file": "a.csv", "kind": "stationary_stribeck", "cycles": 0, "run_id": "a", "origin": "measured",
      "started_at": "2026-11-02T08:00:00+01:00", "map": "torque_nm:Mz"}, ...]

of which `file`, `kind` and `cycles` are needed.
"""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

CLUTCH_FILE = "clutch.json"
MANIFEST = "runs.json"
#: What claims more cycles than this is no run.
MOST_CYCLES = 1e15
_NEEDED, _OPTIONAL = ("file", "kind", "cycles"), ("run_id", "origin", "started_at", "map")
_RECORDS = (".csv", ".txt", ".tdms", ".mf4", ".mdf", ".parquet")


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundRun:
    """A run's file; `asked` is what its manifest says beside a record, None for JSON and for what none lists."""

    path: Path
    asked: Mapping[str, str] | None = None


def write(path: Path, body: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> None:
    """One body into one file, whole or not at all."""
    partial = path.with_suffix(path.suffix + ".part")
    partial.write_text(json.dumps(body, allow_nan=False, separators=(",", ":")) + "\n", encoding="utf-8")
    partial.replace(path)


def find(paths: Iterable[Path]) -> list[FoundRun]:
    """The files named, and of folders the runs in them, each folder's by cycles where they are told.

    Raises FileNotFoundError for a path that is not there, ValueError for a manifest that is none.
    """
    found: list[FoundRun] = []
    for path in paths:
        if path.is_dir():
            listed = _listed(path)
            runs = [(float(asked["cycles"]), FoundRun(path=file, asked=asked)) for file, asked in listed.items()]
            bodies = [each for each in path.glob("*.json") if each.name not in (CLUTCH_FILE, MANIFEST)]
            runs += [(_cycles(each), FoundRun(path=each)) for each in bodies]
            found += [run for _, run in sorted(runs, key=lambda each: (each[0], each[1].path.name))]
        elif path.exists():
            found.append(FoundRun(path=path, asked=_listed(path.parent).get(path) if path.suffix != ".json" else None))
        else:
            raise FileNotFoundError(f"{path} is not there")
    return found


def unlisted(paths: Iterable[Path]) -> list[Path]:
    """The record files in the folders among `paths` that no manifest lists, so that nothing is known of them."""
    return [
        file
        for path in paths
        if path.is_dir()
        for file in sorted(path.iterdir())
        if _is_record(file) and file not in _listed(path)
    ]


def _is_record(path: Path) -> bool:
    name = path.name.lower().removesuffix(".gz")
    return not name.startswith(".") and name.endswith(_RECORDS)


def _listed(folder: Path) -> dict[Path, dict[str, str]]:
    """What the folder's manifest says by file, as the service is asked; nothing where there is none."""
    manifest = folder / MANIFEST
    if not manifest.is_file():
        return {}
    try:
        entries = json.loads(manifest.read_bytes())
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{manifest} must be JSON: {error}") from None
    if not isinstance(entries, list):
        raise ValueError(f"{manifest} must hold a list of runs")  # noqa: TRY004  (a wrong file, not a wrong call)
    return dict(_entry(manifest, index, entry) for index, entry in enumerate(entries))


def _entry(manifest: Path, index: int, entry: object) -> tuple[Path, dict[str, str]]:
    at = f"{manifest}[{index}]"
    if not isinstance(entry, dict) or not set(_NEEDED) <= entry.keys() <= {*_NEEDED, *_OPTIONAL}:
        rule = f"must hold {', '.join(_NEEDED)} and at most {', '.join(_OPTIONAL)}"
        raise ValueError(f"{at} {rule}, got {str(entry)[:80]}")
    cycles = entry["cycles"]
    if isinstance(cycles, bool) or not isinstance(cycles, int | float) or not 0 <= cycles < MOST_CYCLES:
        raise ValueError(f"{at}: cycles must be a number that is not negative, got {cycles!r}")
    for name in entry.keys() - {"cycles"}:
        if not isinstance(entry[name], str) or not entry[name]:
            raise ValueError(f"{at}: {name} must be a text, got {entry[name]!r}")
    file = manifest.parent / entry["file"]
    if not file.is_file():
        raise FileNotFoundError(f"{at}: {file} is not there")
    said = {name: entry[name] for name in ("kind", *_OPTIONAL) if name in entry}
    return file, said | {"cycles": repr(float(cycles)), "filename": file.name}


def _cycles(path: Path) -> float:
    """The cycles that a run file tells, for ordering alone; what is no run comes last and is refused by the service."""
    try:
        body = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return math.inf
    cycles = body.get("cycles") if isinstance(body, dict) else None
    return float(cycles) if isinstance(cycles, int | float) and abs(cycles) < MOST_CYCLES else math.inf
