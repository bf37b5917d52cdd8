"""`make blind`: hide effects, let the diagnosis find them, print what it found as Markdown.

SEED=  another seed, other campaigns          SIZE=   small, full, or a share of the full table
ONLY=  rows whose names begin with these (lives: remaining life)    PROCESSES= how many at once (2)
ARGS="--scheduler WHERE": local, processes[:N], or tcp://host:port of a Dask scheduler whose workers can import these tests
ARGS=--write puts the table into docs/appendix/diagnosis.md, ARGS=--failures lists what went wrong with its command

Outcomes are stored in .blind/table, a file each: the next run goes on where this one ended. After a change of code
remove them.
"""

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from service.work.executor import Executor, executor_of
from service.work.progress import progress
from tests.blind import lives, table
from tests.blind.rows import trials
from tests.blind.trials import Outcome, stored

Job = TypeVar("Job")
Result = TypeVar("Result")

SIZES = {"small": 0.1, "full": 1.0}
DOCUMENT = Path(__file__).parents[2] / "docs" / "appendix" / "diagnosis.md"
BEGIN, END = "<!-- blind tests: begin -->", "<!-- blind tests: end -->"


def run(work: Callable[[Job], Result], chosen: Sequence[Job], executor: Executor) -> list[Result]:
    """All of it, in its order."""
    results = []
    with progress(Console(stderr=True), work.__name__) as advance:
        advance(0, total=len(chosen))
        for outcome in executor.map(work, chosen):
            results.append(outcome.value())
            advance()
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
    """Between the markers of docs/appendix/diagnosis.md."""
    text = DOCUMENT.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    DOCUMENT.write_text(f"{before}{BEGIN}\n\n" + "\n".join(lines) + f"\n{END}{after}", encoding="utf-8")


def scheduler(arguments: Sequence[str]) -> str | None:
    """What follows `--scheduler`."""
    return arguments[arguments.index("--scheduler") + 1] if "--scheduler" in arguments else None


def main() -> None:
    """Print the table."""
    seed, chosen_size = int(os.environ.get("SEED") or 1), os.environ.get("SIZE") or "small"
    only = tuple((os.environ.get("ONLY") or "").split(","))
    size = SIZES[chosen_size] if chosen_size in SIZES else float(chosen_size)
    chosen = [trial for trial in trials(seed, size) if trial.row.startswith(only)]
    processes = os.environ.get("PROCESSES") or "2"
    with executor_of(scheduler(sys.argv) or f"processes:{processes}") as executor:
        outcomes = run(stored, chosen, executor)
        lived = run(lives.lived, lives.jobs(seed, size) if "lives".startswith(only) else [], executor)
    lines = document(outcomes, lived, f"make blind SEED={seed} SIZE={chosen_size}")
    print("\n".join(lines))
    if "--failures" in sys.argv:
        print("\n".join(table.failures(outcomes)))
    if "--write" in sys.argv:
        write(lines)


if __name__ == "__main__":
    main()
