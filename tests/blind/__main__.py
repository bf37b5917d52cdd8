"""`make blind`: hide effects, let the diagnosis find them, print what it found as Markdown.

SEED=  another seed, other campaigns          SIZE=   small, full, or a share of the full table
ONLY=  rows whose names begin with these      PROCESSES= how many at once (2)
ARGS=--write puts the table into docs/diagnosis.md, ARGS=--failures lists what went wrong with the line that repeats it
"""

import multiprocessing
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tests.blind import table
from tests.blind.rows import trials
from tests.blind.trials import Outcome, Trial, judge

SIZES = {"small": 0.1, "full": 1.0}
DOCUMENT = Path(__file__).parents[2] / "docs" / "diagnosis.md"
BEGIN, END = "<!-- blind tests: begin -->", "<!-- blind tests: end -->"


def run(chosen: Sequence[Trial], processes: int) -> list[Outcome]:
    """All trials, in as many processes, in their order; a word on the way to whoever waits."""
    outcomes, told = [], time.monotonic()
    with multiprocessing.get_context("spawn").Pool(processes, initializer=os.nice, initargs=(10,)) as pool:
        for done, outcome in enumerate(pool.imap(judge, chosen), start=1):
            outcomes.append(outcome)
            if time.monotonic() - told > 20:
                told = time.monotonic()
                print(f"{done} of {len(chosen)}: {outcome.trial.row}", file=sys.stderr, flush=True)
    return outcomes


def document(outcomes: Sequence[Outcome], command: str) -> list[str]:
    """All tables, with the command that makes them."""
    parts = [
        [f"`{command}`"],
        table.summary(outcomes),
        ["One effect, λ = 20, 6 states:"],
        table.by_effect(outcomes),
        table.outside(outcomes),
        table.reliability(outcomes),
        table.gains(outcomes),
        table.speed(outcomes),
    ]
    return [line for part in parts if len(part) != 2 or not part[0].startswith("|") for line in (*part, "")]


def write(lines: Sequence[str]) -> None:
    """Between the markers of docs/diagnosis.md."""
    text = DOCUMENT.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    DOCUMENT.write_text(f"{before}{BEGIN}\n\n" + "\n".join(lines) + f"\n{END}{after}", encoding="utf-8")


def main() -> None:
    """Print the table."""
    seed, asked = int(os.environ.get("SEED") or 1), os.environ.get("SIZE") or "small"
    only = tuple((os.environ.get("ONLY") or "").split(","))
    size = SIZES[asked] if asked in SIZES else float(asked)
    chosen = [trial for trial in trials(seed, size) if trial.row.startswith(only)]
    outcomes = run(chosen, int(os.environ.get("PROCESSES") or 2))
    lines = document(outcomes, f"make blind SEED={seed} SIZE={asked}")
    print("\n".join(lines))
    if "--failures" in sys.argv:
        print("\n".join(table.failures(outcomes)))
    if "--write" in sys.argv:
        write(lines)


if __name__ == "__main__":
    main()
