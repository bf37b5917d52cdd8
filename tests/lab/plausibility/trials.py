"""Campaigns with one slip each, and honest runs: what of them is held, and how many of each there are."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from service.clutch.analysis import Analysis
from tests.lab.plausibility import blind, honest_lives, simulated, slips
from tests.lab.plausibility.ablation import WITHOUT, without
from tests.lab.plausibility.bench import REFUSED, Answer, Bench, Body
from tests.lab.plausibility.simulated import Campaign

Draw = Callable[[np.random.Generator], Campaign]


#: Another clutch's test is tried once a clutch has a course: after so many tests.
TESTS_BEFORE = 3
#: After so many further runs it is looked whether a slip is still out of the track.
FURTHER = 10
#: Of an honest campaign so many runs are sent, and judged without each mechanism every so many.
LONGEST, EVERY = 40, 5


@dataclass(frozen=True)
class Outcome:
    """A run that was sent: whence, which slip ("" for an honest run), its kind, stationary tests before it, the answer, and
    whether it was out of the track after FURTHER more honest runs (None: so many did not follow)."""

    source: str
    slip: str
    kind: str
    cycles: float
    before: int
    answer: Answer
    out_after: bool | None = None

    @property
    def held(self) -> bool:
        """Not in the track: held, or refused."""
        return bool(self.answer.codes)


def of_blind(rng: np.random.Generator) -> Campaign:
    """Half of the campaigns hide an effect; some end with an advised test."""
    slug = str(rng.choice(blind.SLUGS)) if rng.random() < 0.5 else ""
    return blind.campaign(rng, slug, advised=bool(rng.random() < 0.15))


RIGS: dict[str, Draw] = {"simulated rig": simulated.campaign, "blind rig": of_blind}


def slipped(seed: int, rig: str, number: int, *, ablated: bool = False) -> list[Outcome]:
    """A campaign of a rig with one slip; the groups of slips take turns."""
    rng = np.random.default_rng([seed, 1, list(RIGS).index(rig), number])
    return [one_slip(rng, RIGS[rig], rig, slips.GROUPS[number % len(slips.GROUPS)], ablated=ablated)]


def aside(seed: int, rig: str, number: int) -> list[Outcome]:
    """A slip beyond the demand, or one that cannot be told."""
    rng = np.random.default_rng([seed, 2, list(RIGS).index(rig), number])
    names = (*slips.OTHERS, *slips.ALIKE)
    return [one_slip(rng, RIGS[rig], rig, names[number % len(names)])]


def one_slip(rng: np.random.Generator, draw: Draw, source: str, group: str, *, ablated: bool = False) -> Outcome:
    """A campaign is sent as it was made until one of its runs slips. The first run is honest."""
    while True:
        made = draw(rng)
        name, slip = _slip_of(rng, group, made, draw)
        first = _after_tests(made, TESTS_BEFORE) if name in slips.CLUTCHES else 1
        for k in (first + rng.permutation(max(len(made.runs) - first, 0))).tolist():
            wrong = slip(rng, made.runs[k])
            if wrong is not None and wrong != made.runs[k]:
                return _sent(made, k, wrong, source, name, ablated=ablated)


def _after_tests(made: Campaign, count: int) -> int:
    """The first run after so many stationary tests."""
    tests = [k for k, run in enumerate(made.runs) if run["kind"] == "stationary_stribeck"]
    return tests[count - 1] + 1 if len(tests) >= count else len(made.runs)


def _slip_of(rng: np.random.Generator, group: str, made: Campaign, draw: Draw) -> tuple[str, slips.Slip]:
    groups = {"wrong unit": slips.UNITS, "sensor unplugged": slips.UNPLUGGED, "wrong clutch": slips.CLUTCHES}
    name = str(rng.choice(list(groups[group]))) if group in groups else group
    swaps = slips.CLUTCHES | slips.ALIKE
    if name in swaps:
        other = draw(rng)
        return name, lambda rng, run: swaps[name](rng, run, made, other)
    return name, (slips.CYCLES | slips.UNITS | slips.UNPLUGGED | slips.OTHERS)[name]


def _sent(made: Campaign, k: int, wrong: Body, source: str, name: str, *, ablated: bool) -> Outcome:
    bench = Bench(made.record)
    for run in made.runs[:k]:
        bench.accept(run)
    before = sum(1 for event in bench.events if event.cofs)
    answer = bench.answer(wrong, ablated=ablated)
    further = made.runs[k + 1 : k + 1 + FURTHER]
    out_after = None
    if len(further) == FURTHER and not ablated:
        for run in further:
            bench.answer(run)
        refused = REFUSED in answer.codes
        out_after = refused or any(event.run_id == wrong["run_id"] for event in bench.held)
    return Outcome(source, name, str(wrong["kind"]), float(wrong["cycles"]), before, answer, out_after)


def honest(seed: int, source: str, number: int, *, ablated: bool = False) -> list[Outcome]:
    """The runs of one honest campaign of a rig, two of five shuffled or with one late, or of one that was measured; [] where
    there is none of that number."""
    if source in RIGS:
        rng = np.random.default_rng([seed, 3, list(RIGS).index(source), number])
        made = RIGS[source](rng)
        if rng.random() < 0.4:
            made = simulated.shuffled(rng, made)
        return list(everything(made, ablated=ablated))
    measured = list(blind.real())
    if number >= len(measured):
        return []
    order = [0, *(1 + np.random.default_rng([seed, 4]).permutation(len(measured) - 1)).tolist()]
    return list(everything(measured[order[number]], ablated=ablated))


def honest_life(seed: int, kind: str, number: int) -> dict[str, int]:
    """An honest life that is no eq. 6: how many runs it has, how many were held when they came in, how many in the end."""
    life = honest_lives.life(seed, kind, number)
    bench = Bench({})
    arrived = sum(bool(bench.answer(run).codes) for run in life)
    return {"runs": len(life), "held": arrived, "end": len(bench.held)}


def honest_life_without(seed: int, kind: str, number: int) -> dict[str, int]:
    """How many of its runs are held in the end without each mechanism."""
    life, ends, known = honest_lives.life(seed, kind, number), dict[str, int](), dict[str, Analysis]()
    for name in WITHOUT:
        bench = Bench({}, analyses=known)
        with without(name):
            for run in life:
                bench.answer(run)
        ends[name] = len(bench.held)
    return ends


def everything(made: Campaign, *, ablated: bool = False) -> Iterator[Outcome]:
    """The first runs of an honest campaign; one that is held is confirmed."""
    bench = Bench(made.record)
    for k, run in enumerate(made.runs[:LONGEST]):
        before = sum(1 for event in bench.events if event.cofs)
        answer = bench.answer(run, ablated=ablated and k % EVERY == EVERY - 1)
        yield Outcome(made.source, "", str(run["kind"]), float(run["cycles"]), before, answer)
        if answer.codes and REFUSED not in answer.codes:
            bench.accept(run)
