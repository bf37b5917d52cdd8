"""`make blind SUBSET=name`: verdicts on a fixed set of campaigns, stored by name, so that two ways to decide compare.

SUBSET=  the name under which results are stored (`.blind/NAME`); a run goes on where it ended, some 25 minutes of one core
SEED=    other campaigns (1)                         ONLY=    rows whose names begin with these
ARGS="--against OTHER": the rows of both beside each other, campaign by campaign the same ones
"""

import math
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

from tests.lab.blind.rig.makers import CATALOGUED, OUTSIDE
from tests.lab.blind.rows import LOOPS, RECORDS, drawn_pairs
from tests.lab.blind.trials import Outcome, Trial, file_of, stored, trial
from tests.lab.measuring import Asked
from tests.lab.measuring import table as markdown


def trials(seed: int) -> list[Trial]:
    """The campaigns, in an order in which any part of them is a fair sample."""
    made: list[Trial] = []

    def add(row: str, number: int, *slugs: str, **wanted: Any) -> None:
        made.append(trial(row, seed, number, *slugs, **wanted))

    for k in range(3):
        for j in range(5):
            add("none", 5 * k + j)
        for j in range(2):
            add("none/plateaus", 2 * k + j, loops=False)
        if k == 0:
            add("raw/none", k, raw=True, loops=False)
        for slug in CATALOGUED:
            if k != 1:
                add(f"fifty/{slug}", k, slug, lam=50.0)
            if k == 0 and slug not in LOOPS | RECORDS:
                add(f"plateaus/{slug}", k, slug, lam=80.0, loops=False)
            if k == 1:
                add(f"twenty/{slug}", k, slug, lam=20.0)
                add(f"loud/{slug}", k, slug, lam=300.0)
            if k == 0:
                add(f"left/{slug}", k, slug, lam=50.0, left=True)
            if k == 2:
                add(f"left/{slug}", k, slug, lam=50.0, left=True, loops=slug in LOOPS | RECORDS)
        for slug in OUTSIDE:
            if k < 2:
                add(f"outside/{slug}", k, slug, lam=50.0)
        for j, pair in enumerate(drawn_pairs(seed + k, 4)):
            add("two", 4 * k + j, *pair, lam=50.0)
        for lam in (50.0, 200.0):
            add(f"blindfold/{lam:.0f}", k, "oil_temperature", lam=lam, oil=False, moments=True)
    return made


#: What is counted: title, beginnings of the rows, what counts, whether more is better.
Row = tuple[str, tuple[str, ...], Callable[[Outcome], bool], bool]
ROWS: tuple[Row, ...] = (
    ("nothing hidden: adequate", ("none", "raw/none"), lambda o: o.verdict == "model_adequate", True),
    ("one effect, λ = 50, loops: named right", ("fifty/",), lambda o: o.right, True),
    ("… in the set", ("fifty/",), lambda o: o.in_set, True),
    ("… named wrong", ("fifty/",), lambda o: o.wrong, False),
    ("one, λ = 80, no loops: named right", ("plateaus/",), lambda o: o.right, True),
    ("… in the set", ("plateaus/",), lambda o: o.in_set, True),
    ("… named wrong", ("plateaus/",), lambda o: o.wrong, False),
    ("one, λ = 20: detected", ("twenty/",), lambda o: o.verdict != "model_adequate", True),
    ("… in the set", ("twenty/",), lambda o: o.in_set, True),
    ("… named wrong", ("twenty/",), lambda o: o.wrong, False),
    ("one, λ = 300: named right", ("loud/",), lambda o: o.right, True),
    ("… in the set", ("loud/",), lambda o: o.in_set, True),
    ("… named wrong", ("loud/",), lambda o: o.wrong, False),
    ("its own cause left out: named wrong", ("left/",), lambda o: o.wrong, False),
    ("… unexplained or ambiguous", ("left/",), lambda o: not o.named and o.verdict != "model_adequate", True),
    ("outside the catalogue: unexplained", ("outside/",), lambda o: o.verdict == "unexplained_structure", True),
    ("… named", ("outside/",), lambda o: o.named, False),
    ("two effects: the exact pair", ("two",), lambda o: o.right, True),
    ("… in the set", ("two",), lambda o: o.in_set, True),
    ("… named wrong", ("two",), lambda o: o.wrong, False),
    ("no oil temperature: named wrong", ("blindfold/",), lambda o: o.wrong, False),
    ("crashed", ("",), lambda o: o.verdict == "crashed", False),
)


def table(first: Sequence[Outcome], second: Sequence[Outcome], labels: tuple[str, str]) -> list[str]:
    """Both beside each other on the campaigns that both have; worse where the difference of the pairs is beyond two of its
    standard errors."""
    theirs = {one.trial.seed: one for one in second}
    both = [(one, theirs[one.trial.seed]) for one in first if one.trial.seed in theirs]
    lines: list[tuple[object, ...]] = []
    for title, rows, counts, more in ROWS:
        pairs = [(counts(a), counts(b)) for a, b in both if a.trial.row.startswith(rows)]
        lost, won = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
        worse = (lost - won if more else won - lost) > 2 * math.sqrt(max(lost + won, 1))
        counted = (sum(a for a, _ in pairs), sum(b for _, b in pairs), f"{lost} / {won}", "worse" if worse else "")
        lines.append((title, len(pairs), *counted))
    seconds = [sum(pair[k].seconds for pair in both) / max(len(both), 1) for k in (0, 1)]
    lines.append(("seconds a campaign", len(both), *(f"{mean:.2f}" for mean in seconds), "", ""))
    return markdown(("on the same campaigns", "n", *labels, "only {} / only {}".format(*labels), ""), lines)


def main(arguments: Sequence[str]) -> None:
    """Judge, and print the rows."""
    label, asked = os.environ["SUBSET"], Asked.here()
    chosen = [each for each in trials(asked.seed) if each.row.startswith(asked.only)]
    mine = [one for each in chosen if (one := stored(each, label)).made]
    other, against = mine, label
    if "--against" in arguments:
        against = arguments[arguments.index("--against") + 1]
        there = [each for each in chosen if file_of(each, against).exists()]
        other = [one for each in there if (one := stored(each, against)).made]
    print("\n".join(table(other, mine, (against, label))))


if __name__ == "__main__":
    main(sys.argv)
