"""`make plausibility`: what is held of campaigns with one slip each and of honest runs, as Markdown; fails below the demand.

SEED= (1)   CAMPAIGNS= with one slip each, half of them a rig (200)   HONEST= honest runs (2000)
CAUSES= dated lives with each cause of many runs, and three times as many without (40)
LIVES= honest lives that are no eq. 6, of each kind (20)   ABLATED= campaigns a rig judged without each mechanism (60)
STORE= a file of what was computed, to go on where a run was ended
ARGS=--failures lists what was missed and what was held wrongly, ARGS=--write writes docs/appendix/plausibility.md

Plausibility was developed on the simulated rig with other seeds; the blind rig and the measurements are new to it.
"""

import itertools
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from tests.lab.measuring import Asked, Lines, number, publish, table, wilson
from tests.lab.plausibility import counters, slips, trials
from tests.lab.plausibility.ablation import WITHOUT
from tests.lab.plausibility.bench import Answer
from tests.lab.plausibility.honest_lives import KINDS
from tests.lab.plausibility.trials import Outcome

#: The demand: of runs with a slip so many are held at least, of honest ones so many at most.
LEAST_HELD, MOST_FALSE = 0.95, 0.005
#: Of causes of many runs so many are found whole at least; of honest runs of dated lives so many are held at most.
LEAST_FOUND, MOST_ASKED = 0.95, 0.01
#: Of the runs of honest lives that are no eq. 6 so many are held in the end at most; of slips so many are out of the track
#: after ten further runs at least.
MOST_IN_THE_END, LEAST_AFTER = 0.01, 0.93


def percent(hits: int, count: int) -> str:
    """A share with its 95 % interval."""
    if count == 0:
        return "-"
    low, high = wilson(hits, count)
    return f"{100 * hits / count:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def held_of(outcomes: Sequence[Outcome]) -> int:
    return sum(one.held for one in outcomes)


def by_slip(outcomes: Sequence[Outcome]) -> list[str]:
    """A row a kind of slip: how many of how many are held, on each rig."""
    rows = []
    for name in (*slips.CYCLES, *slips.UNITS, *slips.CLUTCHES, *slips.UNPLUGGED, *slips.OTHERS, *slips.ALIKE):
        mine = [one for one in outcomes if one.slip == name]
        by_rig = [[one for one in mine if one.source == rig] for rig in trials.RIGS]
        codes = sorted({code for one in mine for code in one.answer.codes})
        if mine:
            cells = (f"{held_of(here)} of {len(here)}" if here else "" for here in by_rig)
            rows.append((name, *cells, ", ".join(f"`{code}`" for code in codes)))
    return table(("slip", *trials.RIGS, "codes"), rows)


#: Sources of honest runs, by what their names begin with.
SOURCES = {
    "simulated rig": "simulated rig",
    "blind rig, nothing hidden": "blind rig, nothing hidden",
    "blind rig, hidden": "blind rig, an effect hidden",
    "blind rig, with": "blind rig, with an advised test",
    "real": "real",
}


def by_source(outcomes: Sequence[Outcome]) -> list[str]:
    """A row a source of honest runs: how many are held."""
    groups = {name: [one for one in outcomes if one.source.startswith(begin)] for begin, name in SOURCES.items()}
    return table(("honest runs of", "runs", "held", "share"), (_counted(name, mine) for name, mine in groups.items()))


def by_mechanism(
    wrong: Sequence[Outcome], honest: Sequence[Outcome], lives: Sequence[Mapping[str, int]], runs: int, end: int
) -> list[str]:
    """A row a mechanism that is left out: what is then held; of honest lives in the end, `end` of `runs` with all."""
    judged = [one for one in honest if one.answer.without]
    rows = [("nothing", held_of(wrong), held_of(judged), end)]
    rows += [
        (
            name,
            *(sum(one.answer.without[name] for one in sent) for sent in (wrong, judged)),
            sum(one[name] for one in lives),
        )
        for name in WITHOUT
    ]
    counts = (len(wrong), len(judged), runs)
    cells = ((name, *(f"{held} of {of}" for held, of in zip(found, counts, strict=True))) for name, *found in rows)
    return table(("left out or changed", "slips held", "honest held", "honest lives, in the end"), cells)


def by_life(lives: Mapping[str, Sequence[Mapping[str, int]]]) -> list[str]:
    """A row a kind of honest lives that are no eq. 6."""
    counts = {
        kind: [sum(one[name] for one in mine) for name in ("runs", "held", "end")] for kind, mine in lives.items()
    }
    runs, arrived, end = map(sum, zip(*counts.values(), strict=True))
    rows = [(kind, *found) for kind, found in counts.items()]
    rows.append(("**all** (demand: ≤ 1 % in the end)", runs, percent(arrived, runs), percent(end, runs)))
    return table(("honest lives", "runs", "held when they came in", "held in the end"), rows)


def by_cause(found: Mapping[str, Sequence[Mapping[str, Any]]]) -> tuple[list[str], bool]:
    """A row a cause of many runs, and whether the demand is met."""
    rows, whole, lives, held, runs = [], 0, 0, 0, 0
    for cause, mine in found.items():
        own = sum(one["found"] == one["wrong"] for one in mine)
        aside, honest = (sum(one[name] for one in mine) for name in ("honest held", "runs"))
        honest -= sum(one["wrong"] for one in mine)
        cells = f"{own} of {len(mine)}" if cause else ""
        codes = sorted({code for one in mine for code in one["codes"]})
        rows.append((cause or "none", cells, f"{aside} of {honest}", ", ".join(f"`{code}`" for code in codes)))
        held, runs = held + aside, runs + honest
        if cause:
            whole, lives = whole + own, lives + len(mine)
    rows.append(("**all** (demand: ≥ 95 %, ≤ 1 %)", percent(whole, lives), percent(held, runs), ""))
    met = whole >= LEAST_FOUND * lives and held <= MOST_ASKED * runs
    return table(("cause", "lives in which all of its runs are held", "other runs held in the end", "codes"), rows), met


def _counted(title: str, outcomes: Sequence[Outcome], *demand: str) -> tuple[object, ...]:
    held = held_of(outcomes)
    return title, len(outcomes), held, percent(held, len(outcomes)), *demand


def main() -> int:
    """Print the tables; 1 where the demand is not met."""
    seed, store = Asked.here().seed, Lines(os.environ.get("STORE"))
    sizes = {"CAMPAIGNS": 200, "HONEST": 2000, "LIVES": 20, "ABLATED": 60, "CAUSES": 40}
    campaigns, runs, count, ablated, of_each = (number(name, size) for name, size in sizes.items())

    def known(label: str, make: Callable[..., Any], name: str, n: int, **how: bool) -> Any:
        """What comes of a trial, from the store or made."""
        return store.get(f"{label} {seed} {name} {n}", partial(make, seed, name, n, **how))

    def sent(label: str, make: Callable[..., list[Outcome]], name: str, n: int, **how: bool) -> list[Outcome]:
        return [Outcome(**(one | {"answer": Answer(**one["answer"])})) for one in known(label, make, name, n, **how)]

    def many(
        label: str, make: Callable[..., list[Outcome]], names: Iterable[str], each: int, **how: bool
    ) -> list[Outcome]:
        """What comes of so many trials of each name."""
        jobs = itertools.product(range(each), names)
        return [one for n, name in jobs for one in sent(label, make, name, n, **how)]

    def honest_runs(source: str, share: int) -> list[Outcome]:
        """So many honest runs of a source, or all that there are."""
        found: list[Outcome] = []
        for n in itertools.count():
            own = sent("honest", trials.honest, source, n)
            found += own
            if not own or len(found) >= share:
                return found[:share]
        return found

    causes = {
        cause: [known("cause", counters.trial, cause, n) for n in range(of_each if cause else 3 * of_each)]
        for cause in (*counters.CAUSES, "")
    }
    lines, found = by_cause(causes)
    publish("plausibility.md", "counters", [f"`make plausibility SEED={seed} CAUSES={of_each}`:", "", *lines])
    if not campaigns:
        return 0 if found else 1
    rigs = {rig: many("slip", trials.slipped, [rig], campaigns // 2) for rig in trials.RIGS}
    wrong = [*itertools.chain(*rigs.values())]
    aside = many("aside", trials.aside, trials.RIGS, campaigns // 5)
    lives = {kind: [known("life", trials.honest_life, kind, n) for n in range(count)] for kind in KINDS}
    shares = {"simulated rig": 2 * runs // 5, "blind rig": 2 * runs // 5, "real": runs // 5}
    honest = [one for source, share in shares.items() for one in honest_runs(source, share)]
    slips_without = many("slip without", trials.slipped, trials.RIGS, ablated, ablated=True)
    honest_without = many("honest without", trials.honest, shares, ablated // 10, ablated=True)
    judged = [(kind, n) for n in range(min(ablated // 10, count)) for kind in KINDS]
    lives_without = [known("life without", trials.honest_life_without, kind, n) for kind, n in judged]
    of_judged = (sum(lives[kind][n][name] for kind, n in judged) for name in ("runs", "end"))

    followed = [one for one in wrong if one.out_after is not None]
    out = sum(bool(one.out_after) for one in followed)
    every = [one for mine in lives.values() for one in mine]
    in_the_end, of_lives = (sum(one[name] for one in every) for name in ("end", "runs"))
    times = sorted(one.answer.seconds for one in honest if one.kind == "stationary_stribeck")
    demanded = (
        *(_counted(f"one slip, {rig}", mine, "") for rig, mine in rigs.items()),
        _counted("**one slip**", wrong, "≥ 95 %"),
        _counted("**honest**", honest, "≤ 0.5 %"),
        ("**out after ten further runs**", len(followed), out, percent(out, len(followed)), "≥ 93 %"),
        ("**honest lives, in the end**", of_lives, in_the_end, percent(in_the_end, of_lives), "≤ 1 %"),
    )
    lines = [
        f"`make plausibility SEED={seed} CAMPAIGNS={campaigns} HONEST={runs} LIVES={count} ABLATED={ablated}`:",
        "",
        *table(("", "runs", "held", "share", "demand"), demanded),
        "",
        *by_slip([*wrong, *aside]),
        "",
        *by_source(honest),
        "",
        *by_life(lives),
        "",
        *by_mechanism(slips_without, honest_without, lives_without, *of_judged),
        "",
        f"A stationary test's doubts took {1e3 * times[len(times) // 2]:.1f} ms of a core in the median, "
        f"{1e3 * times[int(0.99 * len(times))]:.1f} ms in 99 % of runs.",
    ]
    publish("plausibility.md", "plausibility", lines)
    if "--failures" in sys.argv:
        for one in (*[o for o in wrong if not o.held], *[o for o in honest if o.held]):
            said = (one.kind, one.cycles, one.before, one.answer.codes, one.answer.message)
            print("\n", one.slip or "honest", one.source, *said)
    met = found and held_of(wrong) >= LEAST_HELD * len(wrong) and held_of(honest) <= MOST_FALSE * len(honest)
    met = met and in_the_end <= MOST_IN_THE_END * of_lives and out >= LEAST_AFTER * len(followed)
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
