"""`make files`: the files of a draw, as they are read, suggested, asked for, or wrong (SEED= SIZE= ARGS=--each)."""

import argparse
import tempfile
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

from tests.lab.files.draw import Verdict, judged
from tests.lab.files.writers import drawn
from tests.lab.measuring import show

_VERDICTS = [verdict.value for verdict in Verdict]


def main() -> None:
    """Print a row for each program, and with --each a line for each file that is neither read nor suggested rightly."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=63)
    parser.add_argument("--size", type=int, default=100)
    parser.add_argument("--each", action="store_true", help="say what is wrong with each file")
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for number in range(asked.size):
        with tempfile.TemporaryDirectory() as folder:
            file = drawn(Path(folder), rng)
            verdict, said = judged(file)
        for name in (file.writer, "all"):
            counts[name][verdict.value] += 1
        if asked.each and verdict not in (Verdict.READ, Verdict.SUGGESTED):
            print(f"{number} {file.writer}, {file.language}, {file.kind}: {verdict.value}: {said}")
    counts["all"] = counts.pop("all")
    rows = [
        {"file": name, "files": str(found.total())} | {verdict: str(found[verdict]) for verdict in _VERDICTS}
        for name, found in counts.items()
    ]
    show(f"## {asked.size} files, seed {asked.seed}", rows)


main()
