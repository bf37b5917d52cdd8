"""A record read by the service's readers, beside the library of its format alone: time by the clock, time of the processor,
which others at work do not lengthen as much, and memory beyond the library's.

Each is measured in a process of its own, which reads once before:
`python -m tests.lab.benchmarks.formats FORMAT own|ours FILE`.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

from tests.lab.benchmarks.memory import added, family_seconds
from tests.lab.benchmarks.records import write_records
from tests.lab.measuring import show

#: Readings of which the fastest counts, in turns.
_TIMES, _TURNS = 5, 3
#: What is wanted: times as long as the library, and bytes beyond it.
WANTED = {"CSV": 2.0, "TDMS": 3.0, "MDF4": 3.0}
WANTED_MB = 60


def formats() -> None:
    """Print a row for each format: the fastest of both in turns, and by how much each grew at most."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        paths = write_records(Path(folder))
        for name, wanted in WANTED.items():
            found: dict[str, list[dict[str, float]]] = {"own": [], "ours": []}
            for _ in range(_TURNS):
                for who, held in found.items():
                    held.append(_measured(name, who, paths[name]))
            own, ours = (min(one["seconds"] for one in found[who]) for who in ("own", "ours"))
            worked = [min(one["worked"] for one in found[who]) for who in ("ours", "own")]
            more = min(one["bytes"] for one in found["ours"]) - min(one["bytes"] for one in found["own"])
            rows.append(
                {
                    "file": name,
                    "its library, s": f"{own:.3f}",
                    "ours, s": f"{ours:.3f}",
                    "times": f"{ours / own:.1f}",
                    "times of the processor": f"{worked[0] / worked[1]:.1f}",
                    "wanted": f"≤ {wanted:g}",
                    "memory beyond it, MiB": f"{more / 2**20:.0f}",
                    "wanted, MiB": f"≤ {WANTED_MB}",
                }
            )
    show("## The same record from a file to arrays, beside the library of its format", rows)


def _measured(name: str, who: str, path: Path) -> dict[str, float]:
    command = [sys.executable, "-W", "ignore", "-m", "tests.lab.benchmarks.formats", name, who, str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return dict(json.loads(done.stdout))


def _reader(name: str, who: str, path: Path) -> Callable[[], object]:
    """What reads the file whole."""
    if who == "ours":
        from service.readers.read_file import read_file

        return lambda: read_file(path, filename=path.name)
    if name == "CSV":
        import pandas as pd  # type: ignore[import-untyped]

        return lambda: pd.read_csv(path, engine="c")
    if name == "TDMS":
        from nptdms import TdmsFile  # type: ignore[import-untyped]

        return lambda: [channel[:] for group in TdmsFile.read(path).groups() for channel in group.channels()]
    from asammdf import MDF

    return lambda: [signal.samples for signal in MDF(path).iter_channels()]


def main() -> None:
    """Measure one reader."""
    warnings.simplefilter("ignore")
    name, who, path = sys.argv[1:]
    read = _reader(name, who, Path(path))
    read()
    grown = added(os.getpid(), read)
    seconds, before = [], family_seconds(os.getpid())
    for _ in range(_TIMES):
        begun = time.perf_counter()
        read()
        seconds.append(time.perf_counter() - begun)
    worked = (family_seconds(os.getpid()) - before) / _TIMES
    print(json.dumps({"seconds": min(seconds), "worked": worked, "bytes": grown}))


if __name__ == "__main__":
    main()
