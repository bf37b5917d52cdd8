"""`make score`: how good the prognosis is, on simulated lives whose end is known; the tables of docs/prognosis.md.

SIZE scales the number of lives (1: at least 1,000 for coverage), SEED changes them; parts may be named. With --write the
tables take their place in docs/prognosis.md.
"""

import argparse
import time
from collections.abc import Callable

from tests.score import off_prior, on_prior, paper
from tests.score.after_end import after_end
from tests.score.belief import belief
from tests.score.fleets import fleets
from tests.score.severity import severity
from tests.score.table import written


def main() -> None:
    parser = argparse.ArgumentParser(prog="make score")
    parser.add_argument("parts", nargs="*")
    parser.add_argument("--size", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=4100)
    parser.add_argument("--write", action="store_true")
    chosen = parser.parse_args()

    def lives(count: int) -> int:
        return max(8, round(count * chosen.size))

    seed = chosen.seed
    parts: dict[str, Callable[[], str]] = {
        "belief": lambda: belief(lives(600), seed + 7),
        "calibration": lambda: on_prior.calibration(lives(1_000), seed),
        "exact": lambda: on_prior.beside_exact(lives(100), seed + 1),
        "outlying": lambda: on_prior.calibration(lives(1_000), seed + 2, outlying=0.1),
        "laws": lambda: off_prior.laws(lives(100), seed + 3),
        "never": lambda: off_prior.never(lives(1_000), seed + 4),
        "events": lambda: off_prior.after_event(lives(100), seed + 5),
        "fleets": lambda: fleets(lives(40), seed + 6),
        "slopes": lambda: paper.slopes(lives(200), seed + 9),
        "shudder": lambda: paper.shudder(lives(500), seed + 10),
        "lag": lambda: paper.lag(lives(200), seed + 11),
        "severity": lambda: severity(lives(80), seed + 12),
        "after": lambda: after_end(lives(100), seed + 8),
    }
    for name in chosen.parts or parts:
        start = time.monotonic()
        table = parts[name]()
        print(f"\n### {name} ({time.monotonic() - start:.0f} s)\n\n{table}", flush=True)
        if chosen.write:
            written(name, f"make score PARTS={name} SIZE={chosen.size:g} SEED={seed}", table)


if __name__ == "__main__":
    main()
