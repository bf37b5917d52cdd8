"""`make blind`: hide effects, let the diagnosis find them, print what it found as Markdown.

SEED=  another seed, other campaigns          SIZE=   small, full, or a share of the full table
ONLY=  rows whose names begin with these (lives: remaining life)    PROCESSES= how many at once (2)
ARGS=--write puts the table into docs/diagnosis.md, ARGS=--failures lists what went wrong with the line that repeats it
"""

import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from tests.blind import lives, table
from tests.blind.rows import trials
from tests.blind.trials import Outcome, judge

Job = TypeVar("Job")
Result = TypeVar("Result")

SIZES = {"small": 0.1, "full": 1.0}
DOCUMENT = Path(__file__).parents[2] / "docs" / "diagnosis.md"
BEGIN, END = "<!-- blind tests: begin -->", "<!-- blind tests: end -->"


def run(work: Callable[[Job], Result], chosen: Sequence[Job], processes: int) -> list[Result]:
    """All of it, in as many processes, in its order; a word on the way to whoever waits."""
    results, reported = [], time.monotonic()
    with multiprocessing.get_context("spawn").Pool(processes, initializer=os.nice, initargs=(10,)) as pool:
        for done, result in enumerate(pool.imap(work, chosen), start=1):
            results.append(result)
            if time.monotonic() - reported > 20:
                reported = time.monotonic()
                print(f"{done} of {len(chosen)} {work.__name__}", file=sys.stderr, flush=True)
    return results


def document(outcomes: Sequence[Outcome], lived: Sequence[lives.Lived], command: str) -> list[str]:
    """All tables, with the command that makes them; what could not be made is stated and counts nowhere."""
    made = [one for one in outcomes if one.made]
    parts = [
        [f"`{command}`"],
        table.unmade(outcomes),
        table.summary(made),
        ["One effect, λ = 20, 6 states:"],
        table.by_effect(made),
        table.outside(made),
        table.reliability(made),
        table.of_gains(),
        table.gains(made),
        lives.meaning(lived),
        lives.table(lived),
        table.speed(made),
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
    seed, chosen_size = int(os.environ.get("SEED") or 1), os.environ.get("SIZE") or "small"
    only = tuple((os.environ.get("ONLY") or "").split(","))
    size = SIZES[chosen_size] if chosen_size in SIZES else float(chosen_size)
    chosen = [trial for trial in trials(seed, size) if trial.row.startswith(only)]
    processes = int(os.environ.get("PROCESSES") or 2)
    outcomes = run(judge, chosen, processes)
    lived = run(lives.lived, lives.jobs(seed, size) if "lives".startswith(only) else [], processes)
    lines = document(outcomes, lived, f"make blind SEED={seed} SIZE={chosen_size}")
    print("\n".join(lines))
    if "--failures" in sys.argv:
        print("\n".join(table.failures(outcomes)))
    if "--write" in sys.argv:
        write(lines)


if __name__ == "__main__":
    main()
