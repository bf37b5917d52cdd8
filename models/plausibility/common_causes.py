"""One cause of many runs: a counter that changes from some run on, or runs of two clutches under one name.

Judged one by one, two runs with the same cause agree with each other, and are believed against dates and course. Here a
hypothesis is about a cause of runs in the order of their dates, and costs its prior once, however many it explains:

- the counter restarts at zero:    ζ = sent + b, b the cycles that were reached by then
- it rolls over at M:              ζ = sent + M, 2 M after the next one, …; M is 2^16 or a power of ten
- another counter takes over:      ζ = sent + b with any b
- it counts in another unit:       ζ = f · sent
- it stands still:                 ζ by the dates or evenly, between the runs before and after or at the pace until then
- the runs are another clutch's:   they leave the history, and have a course of their own

Each is weighed against the runs as they were sent, slips of single ones among them, by the judgement's own probability of
course, cycles and dates (`judgement.log_probability_of`), and by the pace in time: of steps from run to run that are faster
than those before, by z deviations of the logarithm, a factor (1 + z²/ν)^-(ν + 1)/2. A rig may idle at any time, but it does
not suddenly make thirty times as many cycles a day. Of a counter that stands still course alone decides: the cycles that
were sent are the same.

Only runs that say when they were started are asked about. One that somebody confirmed is as it was sent, and so are those
that go with it.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.plausibility import criteria
from models.plausibility.dates import longest_rise
from models.plausibility.judgement import log_cycles_of, log_probability_of
from models.plausibility.pace import log_anywhere
from models.plausibility.slips import Run

#: What may have happened to a counter; the last one is no counter's doing.
RESTART, ROLL_OVER, OFFSET, UNIT, STUCK, TWO_CLUTCHES = (
    "restart",
    "roll_over",
    "offset",
    "unit",
    "stuck",
    "two_clutches",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CommonCause:
    """A common cause of many wrong runs, the log of its prior odds, and the indices of the runs that it concerns, by
    their dates, with the cycles that each was made at (of another clutch's those sent). `number` is the cause's
    parameter: b, M or f; `reached` the cycles of the runs before it; `log_odds` those against all runs as they were
    sent, slips of single ones among them."""

    name: str
    log_prior: float
    runs: tuple[int, ...]
    cycles: tuple[float, ...]
    number: float = 0.0
    reached: float = 0.0
    log_odds: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Dated:
    """A run by its date: its place in the history, when it was started [s], the cycles at its start and end, and whether it
    is a stationary test."""

    index: int
    moment: float
    start: float
    end: float
    is_test: bool


def common_cause_of(runs: Sequence[Run]) -> CommonCause | None:
    """The most probable cause of many runs, in the order of the history; None where the odds of all of them are below
    those from which a run is held."""
    dated = _by_date(runs)
    found = [cause for cause in _hypotheses(dated) if not any(runs[index].fixed for index in cause.runs)]
    if not found:
        return None
    near = _near(dated, found)
    as_sent = _log_probability([runs[index] for index in near])
    log_odds = [cause.log_prior + _log_given(runs, near, cause) - as_sent for cause in found]
    total, best = float(np.logaddexp.reduce(log_odds)), found[int(np.argmax(log_odds))]
    if total < math.log(criteria.HELD):
        return None
    if best.name == TWO_CLUTCHES:
        best = _parted(runs, near, dated, best)
    return replace(best, log_odds=total)


def _parted(runs: Sequence[Run], near: Sequence[int], dated: Sequence[_Dated], cause: CommonCause) -> CommonCause:
    """Runs of two clutches parted by their COF, too, where dates and cycles do not say whose a run is: two runs change
    places where the cycles of neither clutch fall then, and they are more probable so."""
    place, log_given = {run.index: run for run in dated}, _log_given(runs, near, cause)

    def rises(indices: set[int]) -> bool:
        starts = [run.start for run in dated if run.index in indices]
        return all(earlier <= later for earlier, later in itertools.pairwise(starts))

    while True:
        other, own = set(cause.runs), place.keys() - set(cause.runs)
        ways = [
            (other - {theirs} | {ours}, own - {ours} | {theirs})
            for theirs, ours in itertools.product(other & set(near), own & set(near))
            if not runs[ours].fixed
        ]
        parted = [
            replace(cause, runs=tuple(sorted(way)), cycles=tuple(runs[index].cycles for index in sorted(way)))
            for way, rest in ways
            if rises(way) and rises(rest)
        ]
        weighed = [_log_given(runs, near, each) for each in parted]
        if max(weighed, default=-math.inf) <= log_given:
            return cause
        log_given = max(weighed)
        cause = parted[weighed.index(log_given)]


def _by_date(runs: Sequence[Run]) -> list[_Dated]:
    """The dated runs, ascending by date."""
    dated = [
        _Dated(index=index, moment=run.moment, start=run.cycles - (run.block or 0.0), end=run.cycles, is_test=run.tests)
        for index, run in enumerate(runs)
        if run.moment is not None
    ]
    return sorted(dated, key=lambda run: (run.moment, run.start, run.index))


def _near(dated: Sequence[_Dated], found: Sequence[CommonCause]) -> list[int]:
    """The runs by which all hypotheses are weighed: runs dated about the first of each hypothesis, up to a limit."""
    place = {run.index: k for k, run in enumerate(dated)}
    firsts = [place[cause.runs[0]] for cause in found]
    low, high = max(min(firsts) - criteria.LOOKED_BACK, 0), max(firsts) + criteria.LOOKED_BACK
    return sorted(run.index for run in dated[low:high])


def _log_given(runs: Sequence[Run], near: Sequence[int], cause: CommonCause) -> float:
    """Log probability of the runs `near` under a hypothesis."""
    made_at = dict(zip(cause.runs, cause.cycles, strict=True))
    sent = [runs[index] for index in near]
    if cause.name == TWO_CLUTCHES:
        parts = ([index for index in near if (index in made_at) is other] for other in (False, True))
        return sum(_log_probability([runs[index] for index in part]) for part in parts if part)
    moved = [runs[index].at(made_at[index]) if index in made_at else runs[index] for index in near]
    if cause.name == OFFSET:  # with any b: the gap that it leaves is as it may be, and not this one
        before, first = [runs[index] for index in near if index not in made_at], runs[cause.runs[0]]
        of_gap = log_cycles_of(_ordered([*before, first.at(cause.cycles[0])])) - log_cycles_of(_ordered(before))
        return _log_probability(moved) - min(of_gap, 0.0)
    if cause.name == STUCK:
        moved = _ordered(moved)
        return log_probability_of(moved) - log_cycles_of(moved) + log_cycles_of(sent) + _log_pace(_by_date(sent))
    return _log_probability(moved)


def _log_probability(runs: Sequence[Run]) -> float:
    """Log probability of the runs: of their judgement in order of cycles, and of their pace in order of dates."""
    ordered = _ordered(runs)
    return log_probability_of(ordered) + _log_pace(_by_date(ordered))


def _ordered(runs: Sequence[Run]) -> list[Run]:
    """The runs by cycles, at equal cycles by date."""
    return sorted(runs, key=lambda run: (run.cycles, run.moment or 0.0))


def _steps(dated: Sequence[_Dated]) -> Iterator[tuple[int, float]]:
    """Index of each run made at more cycles than all runs before it by date, and the log rate [ln cycles/s] since the
    last such run."""
    furthest = 0
    for k in range(1, len(dated)):
        cycles, seconds = dated[k].start - dated[furthest].start, dated[k].moment - dated[furthest].moment
        if cycles > 0.5:
            if seconds > criteria.LEAST_SECONDS:
                yield k, math.log(cycles / seconds)
            furthest = k


def _excess(dated: Sequence[_Dated]) -> Iterator[tuple[int, float]]:
    """Index of each step of `_steps`, and its log rate's excess over the earlier steps' in standard deviations."""
    rates: list[float] = []
    for k, rate in _steps(dated):
        if len(rates) >= criteria.FEWEST_RATES:
            middle, usual = np.quantile(rates, [0.5, 0.75]).tolist()
            scatter = max(float(np.std([each for each in rates if each >= middle])), criteria.LEAST_RATE_SD)
            yield k, (rate - usual) / scatter
        rates = [*rates[1 - criteria.LOOKED_BACK :], rate]


def _log_pace(dated: Sequence[_Dated]) -> float:
    """Log probability, up to a constant, of how much faster than usual cycles pass between the dates (Student's t)."""
    freedom = criteria.RATE_FREEDOM
    return -0.5 * (freedom + 1.0) * sum(math.log1p(z * z / freedom) for _, z in _excess(dated) if z > 0.0)


def _usual_rate(dated: Sequence[_Dated]) -> float | None:
    """Median rate [cycles/s] from run to run; None where no two were made apart."""
    rates = [rate for _, rate in _steps(dated)]
    return math.exp(float(np.median(rates))) if rates else None


def _hypotheses(dated: Sequence[_Dated]) -> Iterator[CommonCause]:
    """Common causes that the order of the dated runs suggests: cycles off from a run on, a counter that stood still,
    runs of another clutch."""
    furthest, fast = 0.0, {k for k, z in _excess(dated) if z > criteria.FAST}
    asked = 0
    for k, run in enumerate(dated):
        fallen = k > 0 and run.start < furthest - 0.5
        if (fallen and dated[k - 1].start >= run.start + 0.5) or k in fast:
            asked += 1
            if asked <= criteria.MOST_ASKED:
                yield from _from_here_on(dated, k)
        furthest = max(furthest, run.start)
    yield from _standing(dated)
    yield from _other_clutch(dated)


def _from_here_on(dated: Sequence[_Dated], k: int) -> Iterator[CommonCause]:
    """Hypotheses of a counter that changes before the k-th run by date."""
    before, after = dated[:k], dated[k:]
    reached, first = max(run.end for run in before), after[0]
    rate = _usual_rate(before)
    seconds = first.moment - before[-1].moment
    due = reached + (0.0 if rate is None else rate * max(seconds, 0.0))
    due_offset = round(due - first.start)
    changes: list[tuple[str, float, float]] = []
    if first.start < reached:
        largest = [at for at in criteria.ROLLS_OVER_AT if at > reached]
        changes += [(ROLL_OVER, math.log(criteria.COUNTER_ROLLS_OVER), at) for at in largest]
        half = math.log(0.5 * criteria.COUNTER_RESTARTS)
        changes += [(RESTART, half, float(b)) for b in {round(reached), due_offset} if b > 0]
    if abs(due_offset) > 0.5:
        log_prior = math.log(criteria.COUNTER_CHANGED) + float(log_anywhere(abs(due_offset)))
        changes.append((OFFSET, log_prior, float(due_offset)))
    of_unit = math.log(criteria.COUNTER_CHANGED / len(criteria.UNITS_OF_CYCLES))
    changes += [(UNIT, of_unit, factor) for factor in criteria.UNITS_OF_CYCLES]
    known: set[tuple[float, ...]] = set()  # a restart where a counter rolls over is no other cause
    for name, log_prior, number in changes:
        cycles = tuple(_counted(name, number, after))
        start = cycles[0] - (first.end - first.start)
        if start >= dated[k - 1].start - 0.5 and min(cycles) >= 0.0 and cycles not in known:
            known.add(cycles)
            indices = tuple(run.index for run in after)
            yield CommonCause(
                name=name, log_prior=log_prior, runs=indices, cycles=cycles, number=number, reached=reached
            )


def _counted(name: str, number: float, after: Sequence[_Dated]) -> Iterator[float]:
    """True cycles of the runs after a change of the counter."""
    turns, before = 1, -math.inf
    for run in after:
        if name == UNIT:
            yield run.end * number
            continue
        turns += name == ROLL_OVER and run.start < before - 0.5
        before = run.start
        yield run.end + number * turns


def _standing(dated: Sequence[_Dated]) -> Iterator[CommonCause]:
    """Hypotheses of a counter that stands still between tests at the same cycles."""
    dated = [run for run in dated if run.is_test]
    for _, group in itertools.groupby(enumerate(dated), key=lambda placed: placed[1].end):
        alike = list(group)
        first, last = alike[0][0], alike[-1][0]
        if last < first + 2 or dated[last].moment - dated[first].moment <= criteria.LEAST_SECONDS:
            continue
        later = next((run for run in dated[last + 1 :] if run.start > dated[last].end + 0.5), None)
        rate = _usual_rate(dated[: first + 1])
        if later is not None:
            rate = (later.start - dated[first].end) / (later.moment - dated[first].moment)
        if rate is None or rate <= 0.0:
            continue
        at = dated[first]
        stood = [run for _, run in alike[1:]]
        seconds = [run.moment - at.moment for run in stood]
        until = later.moment - at.moment if later is not None else seconds[-1] * (1.0 + 1.0 / len(stood))
        evenly = [until * (n + 1) / (len(stood) + 1) for n in range(len(stood))]
        for spread in (seconds, evenly):  # a rig may idle between
            yield CommonCause(
                name=STUCK,
                log_prior=math.log(0.5 * criteria.COUNTER_STANDS),
                runs=tuple(run.index for run in stood),
                cycles=tuple(float(round(at.end + rate * each)) for each in spread),
                reached=at.end,
            )


def _other_clutch(dated: Sequence[_Dated]) -> Iterator[CommonCause]:
    """The hypothesis of another clutch among the runs: the fewest runs without which cycles do not fall from date to
    date."""
    if all(earlier.start <= later.start for earlier, later in itertools.pairwise(dated)):
        return
    own = longest_rise([run.start for run in dated])
    if 0 not in own:  # the clutch is the one whose runs came first
        own = set(range(len(dated))) - own
    other = [run for k, run in enumerate(dated) if k not in own]
    if 2 <= len(other) < len(dated) - 2:
        yield CommonCause(
            name=TWO_CLUTCHES,
            log_prior=math.log(criteria.TWO_CLUTCHES),
            runs=tuple(run.index for run in other),
            cycles=tuple(run.end for run in other),
            reached=max(run.end for k, run in enumerate(dated) if k in own),
        )
