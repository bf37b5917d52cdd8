"""`make plausibility`: what is held of campaigns with one slip each and of honest runs, as Markdown; fails below the demand.

Plausibility was developed on the simulated rig with other seeds; the blind rig and the measurements are new to it.
"""

import argparse
import itertools
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from tests.blind.rows import wilson
from tests.measuring import APPENDIX, Lines, fill, table
from tests.plausibility import slips, trials
from tests.plausibility.ablation import WITHOUT
from tests.plausibility.bench import Answer
from tests.plausibility.honest_lives import KINDS
from tests.plausibility.trials import Outcome

#: The demand: of runs with a slip so many are held at least, of honest ones so many at most.
LEAST_HELD, MOST_FALSE = 0.95, 0.005
#: Of the runs of honest lives that are no eq. 6 so many are held in the end at most; of slips so many are out of the track
#: after ten further runs at least.
MOST_IN_THE_END, LEAST_AFTER = 0.01, 0.93


def percent(hits: int, count: int) -> str:
    """A share with its 95 % interval."""
    if count == 0:
        return "-"
    low, high = wilson(hits, count)
    return f"{100 * hits / count:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def by_slip(outcomes: Sequence[Outcome]) -> list[str]:
    """A row a kind of slip: how many of how many are held, on each rig."""
    rows = []
    names = [*slips.CYCLES, *slips.UNITS, *slips.CLUTCHES, *slips.UNPLUGGED, *slips.OTHERS, *slips.ALIKE]
    for name in names:
        mine = [one for one in outcomes if one.slip == name]
        cells = []
        for rig in trials.RIGS:
            here = [one for one in mine if one.source == rig]
            cells.append(f"{sum(one.held for one in here)} of {len(here)}" if here else "")
        codes = sorted({code for one in mine for code in one.answer.codes})
        if mine:
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
    rows = [("nothing", sum(one.held for one in wrong), sum(one.held for one in judged), end)]
    rows += [
        (
            name,
            sum(one.answer.without[name] for one in wrong),
            sum(one.answer.without[name] for one in judged),
            sum(one[name] for one in lives),
        )
        for name in WITHOUT
    ]
    counts = (len(wrong), len(judged), runs)
    cells = ((name, *(f"{held} of {of}" for held, of in zip(found, counts, strict=True))) for name, *found in rows)
    return table(("left out or changed", "slips held", "honest held", "honest lives, in the end"), cells)


def by_life(lives: Mapping[str, Sequence[Mapping[str, int]]]) -> list[str]:
    """A row a kind of honest lives that are no eq. 6."""
    names = ("runs", "held", "end")
    rows = [(kind, *(sum(one[name] for one in mine) for name in names)) for kind, mine in lives.items()]
    runs, arrived, end = (sum(one[name] for mine in lives.values() for one in mine) for name in names)
    rows.append(("**all** (demand: ≤ 1 % in the end)", runs, percent(arrived, runs), percent(end, runs)))
    return table(("honest lives", "runs", "held when they came in", "held in the end"), rows)


class Store(Lines):
    """Outcomes as lines of what was computed."""

    def outcome(self, name: str, make: Callable[[], Outcome]) -> Outcome:
        """The same of an outcome."""
        return _outcome(self.get(name, lambda: asdict(make())))

    def outcomes(self, name: str, make: Callable[[], Sequence[Outcome]]) -> list[Outcome]:
        """The same of several."""
        return [_outcome(one) for one in self.get(name, lambda: [asdict(outcome) for outcome in make()])]


def _honest(store: Store, seed: int, source: str, count: int) -> list[Outcome]:
    """So many honest runs of a source, or all that there are."""
    sent: list[Outcome] = []
    for number in itertools.count():
        own = store.outcomes(f"honest {seed} {source} {number}", partial(trials.honest, seed, source, number))
        sent += own
        if not own or len(sent) >= count:
            return sent[:count]
    return sent


def _outcome(known: Mapping[str, Any]) -> Outcome:
    answer = dict(known["answer"])
    return Outcome(**{**known, "answer": Answer(**{**answer, "codes": tuple(answer["codes"])})})


def _counted(title: str, outcomes: Sequence[Outcome], *demand: str) -> tuple[object, ...]:
    held = sum(one.held for one in outcomes)
    return title, len(outcomes), held, percent(held, len(outcomes)), *demand


def main() -> int:
    """Print the tables; 1 where the demand is not met."""
    parser = argparse.ArgumentParser(prog="python -m tests.plausibility", description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--campaigns", type=int, default=200, help="campaigns with one slip each, half of them a rig")
    parser.add_argument("--honest", type=int, default=2000, help="honest runs")
    parser.add_argument("--lives", type=int, default=20, help="honest lives that are no eq. 6, of each kind")
    parser.add_argument(
        "--ablated", type=int, default=60, help="campaigns a rig that are judged without each mechanism"
    )
    parser.add_argument("--store", type=Path, help="a file of what was computed, to go on where a run was ended")
    parser.add_argument("--failures", action="store_true", help="list what was missed and what was held wrongly")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/appendix/plausibility.md")
    chosen = parser.parse_args()
    store, seed = Store(chosen.store), chosen.seed
    rigs = {
        rig: [
            store.outcome(f"slip {seed} {rig} {n}", partial(trials.slipped, seed, rig, n))
            for n in range(chosen.campaigns // len(trials.RIGS))
        ]
        for rig in trials.RIGS
    }
    wrong = [one for outcomes in rigs.values() for one in outcomes]
    aside = [
        store.outcome(f"aside {seed} {rig} {n}", partial(trials.aside, seed, rig, n))
        for rig in trials.RIGS
        for n in range(chosen.campaigns // 5)
    ]
    lives = {
        kind: [
            store.get(f"life {seed} {kind} {n}", partial(trials.honest_life, seed, kind, n))
            for n in range(chosen.lives)
        ]
        for kind in KINDS
    }
    honest = [
        *_honest(store, seed, "simulated rig", 2 * chosen.honest // 5),
        *_honest(store, seed, "blind rig", 2 * chosen.honest // 5),
        *_honest(store, seed, "real", chosen.honest // 5),
    ]
    without = [
        store.outcome(f"slip without {seed} {rig} {n}", partial(trials.slipped, seed, rig, n, ablated=True))
        for n in range(chosen.ablated)
        for rig in trials.RIGS
    ]
    honest_without = [
        one
        for n in range(chosen.ablated // 10)
        for source in (*trials.RIGS, "real")
        for one in store.outcomes(
            f"honest without {seed} {source} {n}", partial(trials.honest, seed, source, n, ablated=True)
        )
    ]
    judged = [(kind, n) for n in range(min(chosen.ablated // 10, chosen.lives)) for kind in KINDS]
    left_out = [
        store.get(f"life without {seed} {kind} {n}", partial(trials.honest_life_without, seed, kind, n))
        for kind, n in judged
    ]
    held, false = sum(one.held for one in wrong), sum(one.held for one in honest)
    followed = [one for one in wrong if one.out_after is not None]
    out = sum(bool(one.out_after) for one in followed)
    every = [one for mine in lives.values() for one in mine]
    in_the_end, of_lives = sum(one["end"] for one in every), sum(one["runs"] for one in every)
    met = held >= LEAST_HELD * len(wrong) and false <= MOST_FALSE * len(honest)
    met = met and in_the_end <= MOST_IN_THE_END * of_lives and out >= LEAST_AFTER * len(followed)
    times = sorted(one.answer.seconds for one in honest if one.kind == "stationary_stribeck")
    lines = [
        f"`make plausibility SEED={seed} CAMPAIGNS={chosen.campaigns} HONEST={chosen.honest} LIVES={chosen.lives} "
        f'ARGS="--ablated {chosen.ablated}"`:',
        "",
        *table(
            ("", "runs", "held", "share", "demand"),
            (
                *(_counted(f"one slip, {rig}", outcomes, "") for rig, outcomes in rigs.items()),
                _counted("**one slip**", wrong, "≥ 95 %"),
                _counted("**honest**", honest, "≤ 0.5 %"),
                ("**out after ten further runs**", len(followed), out, percent(out, len(followed)), "≥ 93 %"),
                ("**honest lives, in the end**", of_lives, in_the_end, percent(in_the_end, of_lives), "≤ 1 %"),
            ),
        ),
        "",
        *by_slip([*wrong, *aside]),
        "",
        *by_source(honest),
        "",
        *by_life(lives),
        "",
        *by_mechanism(
            without,
            honest_without,
            left_out,
            sum(lives[kind][n]["runs"] for kind, n in judged),
            sum(lives[kind][n]["end"] for kind, n in judged),
        ),
        "",
        f"A stationary test's doubts took {1e3 * times[len(times) // 2]:.1f} ms of a core in the median, "
        f"{1e3 * times[int(0.99 * len(times))]:.1f} ms in 99 % of runs.",
    ]
    print("\n".join(lines))
    if chosen.failures:
        for one in (*[o for o in wrong if not o.held], *[o for o in honest if o.held]):
            print(
                "\n",
                one.slip or "honest",
                one.source,
                one.kind,
                one.cycles,
                one.before,
                one.answer.codes,
                one.answer.message,
            )
    if chosen.write:
        fill(APPENDIX / "plausibility.md", {"plausibility": "\n".join(lines)})
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
