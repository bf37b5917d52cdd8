"""`make score`: how good the prognosis is, on simulated lives whose end is known; the tables of docs/appendix/prognosis.md.

SIZE= scales the number of lives (1: at least 1,000 for coverage)    SEED= other lives (4100)    PARTS= named ones only
PROCESSES= parts at once (in this one), or ARGS="--scheduler WHERE" as in `make blind`
ARGS=--write puts the tables into docs/appendix/prognosis.md
"""

import os
import time
from collections.abc import Callable
from functools import partial

from tests.lab.measuring import Asked, each, publish, where
from tests.lab.score import alarms, belief, filters, fleets, off_prior, paper, starts


def main() -> None:
    asked = Asked.here("full", 4100)
    seed, size = asked.seed, asked.size

    def lives(count: int) -> int:
        return max(8, round(count * size))

    parts: dict[str, Callable[[], str]] = {
        "belief": partial(belief.belief, lives(600), seed + 7),
        "knees": partial(belief.knees, lives(200), seed + 13),
        "calibration": partial(filters.calibration, lives(1_000), seed),
        "exact": partial(filters.beside_exact, lives(100), seed + 1),
        "outlying": partial(filters.calibration, lives(1_000), seed + 2, outlying=0.1),
        "laws": partial(off_prior.laws, lives(100), seed + 3),
        "starts": partial(starts.starts, lives(400), seed + 15),
        "never": partial(off_prior.never, lives(1_000), seed + 4),
        "events": partial(off_prior.after_event, lives(100), seed + 5),
        "fleets": partial(fleets.fleets, lives(40), seed + 6),
        "ended": partial(fleets.ended, max(2, round(10 * size)), seed + 14),
        "slopes": partial(paper.slopes, lives(200), seed + 9),
        "shudder": partial(paper.shudder, lives(500), seed + 10),
        "lag": partial(paper.lag, lives(200), seed + 11),
        "severity": partial(paper.severity, lives(80), seed + 12),
        "after": partial(filters.after_end, lives(100), seed + 8),
        "alarms": partial(alarms.bounds, lives(1_000), seed + 15),
    }
    names = (os.environ.get("PARTS") or "").split() or list(parts)
    for name, (table, seconds) in zip(names, each(timed, (parts[name] for name in names), where(0)), strict=True):
        print(f"\n### {name} ({seconds:.0f} s)\n")
        command = f"`make score PARTS={name} SIZE={size:g} SEED={seed}`"
        publish("prognosis.md", f"score {name}", [f"{command}: {table}"])


def timed(part: Callable[[], str]) -> tuple[str, float]:
    """A part's table, and how long it took [s]."""
    start = time.monotonic()
    return part(), time.monotonic() - start


if __name__ == "__main__":
    main()
