"""`make score`: how good the prognosis is, on simulated lives whose end is known; the tables of docs/appendix/prognosis.md.

SIZE scales the number of lives (1: at least 1,000 for coverage), SEED changes them; parts may be named. With --write the
tables take their place in docs/appendix/prognosis.md. --scheduler: where the parts are computed: local, processes[:N], or
tcp://host:port of a Dask scheduler whose workers can import these tests.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial

from service.defaults import SCHEDULERS
from tests.measuring import APPENDIX, each, fill
from tests.score import off_prior, on_prior, paper
from tests.score.after_end import after_end
from tests.score.belief import belief, knees
from tests.score.ended import ended
from tests.score.fleets import fleets
from tests.score.severity import severity


def main() -> None:
    parser = argparse.ArgumentParser(prog="make score")
    parser.add_argument("parts", nargs="*")
    parser.add_argument("--size", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=4100)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--scheduler", default="local", help=SCHEDULERS)
    chosen = parser.parse_args()

    def lives(count: int) -> int:
        return max(8, round(count * chosen.size))

    seed = chosen.seed
    parts: dict[str, Callable[[], str]] = {
        "belief": partial(belief, lives(600), seed + 7),
        "knees": partial(knees, lives(200), seed + 13),
        "calibration": partial(on_prior.calibration, lives(1_000), seed),
        "exact": partial(on_prior.beside_exact, lives(100), seed + 1),
        "outlying": partial(on_prior.calibration, lives(1_000), seed + 2, outlying=0.1),
        "laws": partial(off_prior.laws, lives(100), seed + 3),
        "never": partial(off_prior.never, lives(1_000), seed + 4),
        "events": partial(off_prior.after_event, lives(100), seed + 5),
        "fleets": partial(fleets, lives(40), seed + 6),
        "ended": partial(ended, max(2, round(10 * chosen.size)), seed + 14),
        "slopes": partial(paper.slopes, lives(200), seed + 9),
        "shudder": partial(paper.shudder, lives(500), seed + 10),
        "lag": partial(paper.lag, lives(200), seed + 11),
        "severity": partial(severity, lives(80), seed + 12),
        "after": partial(after_end, lives(100), seed + 8),
    }
    names = chosen.parts or list(parts)
    for name, (table, seconds) in zip(
        names, each(timed, (parts[name] for name in names), chosen.scheduler), strict=True
    ):
        print(f"\n### {name} ({seconds:.0f} s)\n\n{table}", flush=True)
        if chosen.write:
            command = f"`make score PARTS={name} SIZE={chosen.size:g} SEED={seed}`"
            fill(APPENDIX / "prognosis.md", {f"score {name}": f"{command}: {table}"})


def timed(part: Callable[[], str]) -> tuple[str, float]:
    """A part's table, and how long it took [s]."""
    start = time.monotonic()
    return part(), time.monotonic() - start


if __name__ == "__main__":
    main()
