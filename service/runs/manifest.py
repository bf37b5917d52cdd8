"""A folder of runs: JSON files that are posted as they are, record files listed in a manifest, `clutch.json` for the clutch,
and in a folder `inspections` the JSON bodies of inspections.

The manifest, `runs.json`, holds for each record file (CSV, TDMS, MDF4, Parquet) what its channels do not:

    [{"file": "a.csv", "kind": "stationary_stribeck", "cycles": 0, "run_id": "a", "origin": "measured",
      "started_at": "2026-11-02T08:00:00+01:00", "map": "torque_nm:Mz"}, ...]

where `file`, `kind` and `cycles` are needed; `decimal`, `missing` and `good` may stand too.
Nothing outside the folder is read for it: a manifest that came with recordings
must not name other files of the machine, neither by a path nor by a link.
"""

import itertools
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

CLUTCH_FILE = "clutch.json"
MANIFEST = "runs.json"
#: The folder of inspections in one of runs.
INSPECTIONS = "inspections"
#: What was hidden in a simulated campaign: for who rehearses a diagnosis, and no run.
ANSWER = "answer.json"
#: Cycles from which a file is not taken for a run. Chosen: far beyond what the service accepts (`api.base`).
_MAX_CYCLES = 1e15
_NEEDED, _OPTIONAL = ("file", "kind", "cycles"), ("run_id", "origin", "started_at", "map", "decimal", "missing", "good")
_RECORDS = (
    ".csv", ".txt", ".tsv", ".asc", ".dat", ".lvm", ".tdms", ".mf4", ".mdf", ".parquet", ".xlsx", ".xls", ".ods", ".mat",
    ".h5", ".hdf5", ".zip",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFile:
    """A file to send, with its parameters from the manifest; None for JSON and for a file that is not listed."""

    path: Path
    parameters: Mapping[str, str] | None = None

    @property
    def is_inspection(self) -> bool:
        """Whether the file is an inspection: JSON in a folder of inspections."""
        return self.path.suffix == ".json" and self.path.absolute().parent.name == INSPECTIONS


def write(path: Path, body: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> None:
    """Write a body into a file atomically: the file is complete or absent."""
    partial = path.with_suffix(path.suffix + ".part")
    partial.write_text(json.dumps(body, allow_nan=False, separators=(",", ":")) + "\n", encoding="utf-8")
    partial.replace(path)


def find(paths: Iterable[Path]) -> list[RunFile]:
    """The files at `paths`, and the runs and inspections in the folders among them, those of a folder sorted by cycles.

    Raises FileNotFoundError for a path that does not exist, ValueError for a manifest that is wrong and for a file of a
    folder that lies outside it.
    """
    runs: list[RunFile] = []
    for path in paths:
        if path.is_dir():
            runs += _in_folder(path)
        elif path.exists():
            listed = {} if path.suffix == ".json" else _listed(path.parent)
            runs.append(RunFile(path=path, parameters=listed.get(path)))
        else:
            raise FileNotFoundError(f"{path} does not exist")
    return runs


def _in_folder(folder: Path) -> list[RunFile]:
    """The runs and inspections of a folder by cycles, then by name."""
    runs = [
        (float(parameters["cycles"]), RunFile(path=path, parameters=parameters))
        for path, parameters in _listed(folder).items()
    ]
    bodies = [path for path in folder.glob("*.json") if path.name not in (CLUTCH_FILE, MANIFEST, ANSWER)]
    bodies += (folder / INSPECTIONS).glob("*.json")
    for path in (*bodies, folder / CLUTCH_FILE, folder / MANIFEST):
        _require_within(folder, path, str(path))
    runs += [(_cycles(path), RunFile(path=path)) for path in bodies]
    return [run for _, run in sorted(runs, key=lambda pair: (pair[0], pair[1].path.name))]


def unlisted(paths: Iterable[Path]) -> list[Path]:
    """The record files in the folders among `paths` that no manifest lists: their kind and cycles are unknown.

    Those of a folder come by the numbers in their names, so that run-2000.csv is before run-10000.csv."""
    return [
        file
        for path in paths
        if path.is_dir()
        for file in sorted(path.iterdir(), key=_by_numbers)
        if _is_record(file) and file not in _listed(path)
    ]


def _by_numbers(path: Path) -> list[tuple[str, int]]:
    parts = re.split(r"(\d+)", path.name)
    return [(text, int(digits or 0)) for text, digits in itertools.zip_longest(parts[::2], parts[1::2])]


def _is_record(path: Path) -> bool:
    name = path.name.lower().removesuffix(".gz")
    return not name.startswith(".") and name.endswith(_RECORDS)


def _listed(folder: Path) -> dict[Path, dict[str, str]]:
    """The folder's manifest: the parameters of the request by file; empty where there is no manifest."""
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
    """The file of a manifest's entry, and the parameters to send it with. Raises ValueError, FileNotFoundError."""
    at = f"{manifest}[{index}]"
    if not isinstance(entry, dict) or not set(_NEEDED) <= entry.keys() <= {*_NEEDED, *_OPTIONAL}:
        rule = f"must have the fields {', '.join(_NEEDED)}, and may have {', '.join(_OPTIONAL)}"
        raise ValueError(f"{at} {rule}, got {str(entry)[:80]}")
    cycles = entry["cycles"]
    if isinstance(cycles, bool) or not isinstance(cycles, int | float) or not 0 <= cycles < _MAX_CYCLES:
        raise ValueError(f"{at}: cycles must be a number of 0 or more, got {cycles!r}")
    for name in entry.keys() - {"cycles"}:
        if not isinstance(entry[name], str) or not entry[name]:
            raise ValueError(f"{at}: {name} must be a text, got {entry[name]!r}")
    file = manifest.parent / entry["file"]
    _require_within(manifest.parent, file, at)
    if not file.is_file():
        raise FileNotFoundError(f"{at}: the file {file} does not exist")
    parameters = {name: entry[name] for name in ("kind", *_OPTIONAL) if name in entry}
    return file, parameters | {"cycles": repr(float(cycles)), "filename": file.name}


def _require_within(folder: Path, file: Path, at: str) -> None:
    """Raise ValueError if a file, with links followed, is not below the folder."""
    if not file.resolve().is_relative_to(folder.resolve()):
        raise ValueError(f"{at}: {file} lies outside the folder {folder} and is not sent")


def _cycles(path: Path) -> float:
    """The cycles in a JSON run, for sorting only; a file that is no run comes last, and the service will refuse it."""
    try:
        body = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return math.inf
    cycles = body.get("cycles") if isinstance(body, dict) else None
    return float(cycles) if isinstance(cycles, int | float) and abs(cycles) < _MAX_CYCLES else math.inf
