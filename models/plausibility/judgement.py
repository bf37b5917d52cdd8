"""Which runs of a clutch slipped: one question over all of them.

A belief says of every run whether it is as it was sent, outlying, or slipped, and from which tests on COF has a new level.
Its log probability is the sum of

    log p(COF of the tests that are as sent | course, outlying ones, new levels)      `course`
    log P(cycles), log P(dates)                                                       `pace`
    log density of pressures, speeds and oil temperature
    of each slipped run: log Σ over slips  P(slip) L(the run without it | the others)
    the prior of outlying runs and of new levels

From the belief that all runs are as sent the search takes the best single change until none helps. A run's probability of
a slip is summed over the beliefs that it met, and those that differ from the last in one run: where two runs agree, that
both slipped is far less probable than that neither did. The judgement is a function of the runs alone: neither the order of
their arrival nor what was held before plays a part.
"""

import bisect
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.gaussian_evidence import log_normal
from models.plausibility import criteria, pace
from models.plausibility.course import CourseFit, Predicted, Tests, log_physics, missed
from models.plausibility.slips import OF_CLUTCH, OTHER_CLUTCH, OTHER_CYCLES, Run, RunReading, Slip, slips_of

#: No slip is proved by a number that underflows.
_LEAST = math.log(1e-250)
#: A change of belief that gains less is none.
_WORTH = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """A hypothesis on all runs: indices of the runs that slipped, of outlying tests, and of tests from which on COF has
    a new level."""

    slipped: frozenset[int] = frozenset()
    outlying: frozenset[int] = frozenset()
    levels: frozenset[int] = frozenset()

    def turned(self, run: int) -> "Belief":
        """The belief with one run's slip reversed; a run that slipped is neither outlying nor the beginning of a
        level."""
        return Belief(slipped=self.slipped ^ {run}, outlying=self.outlying - {run}, levels=self.levels - {run})


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipVerdict:
    """The verdict on a run that probably slipped: the most probable slip, the COF interval expected from the others
    [-, -] at the cycles as sent (None: the run shows none), and whether its date is out of order with theirs."""

    slip: Slip
    expected: tuple[float, float] | None
    expected_then: tuple[float, float] | None
    against_time: bool
    usual_gap: float | None
    before: float | None
    latest: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class JointJudgement:
    """Verdicts on the runs that are to be held, by index; the tests at which a new level of COF can be judged, and
    those at which one begins."""

    held: Mapping[int, SlipVerdict]
    tests: frozenset[int]
    levels: frozenset[int]


def judge(runs: Sequence[Run], about: Collection[int] = ()) -> JointJudgement:
    """The runs that are to be held, and new levels among the others.

    `runs` in the order of the history. Of more than can be looked at, those nearest to the runs `about` which somebody asks
    and to the latest one are looked at; of fewer the answer depends on the runs alone.
    """
    clutch = _Clutch(runs=tuple(runs), about=frozenset(about))
    best, weighed = _searched(clutch)
    held_runs = _verdicts_on_slips(clutch, best, weighed)
    levels = best.belief.levels & clutch.followed
    return JointJudgement(held=held_runs, tests=clutch.followed, levels=levels - held_runs.keys())


def log_probability_of(runs: Sequence[Run]) -> float:
    """Log probability of all the runs' numbers, in the order of their history, summed over the beliefs visited by the
    search."""
    met = _searched(_Clutch(runs=tuple(runs), about=frozenset()))[1]
    return float(np.logaddexp.reduce(list(met.values())))


def log_cycles_of(runs: Sequence[Run]) -> float:
    """Log probability of the cycles and dates of runs alone, in the order of their history."""
    clutch = _Clutch(runs=tuple(runs), about=frozenset())
    return float(clutch.log_cycles(clutch.cycles[None, clutch.near])[0])


def _verdicts_on_slips(clutch: "_Clutch", best: "_Weighed", weighed: dict[Belief, float]) -> dict[int, SlipVerdict]:
    """Verdict on each run whose odds of a slip are at least HELD, by its index. The odds are those of all beliefs that
    the search has `weighed`, to which the nearest alternatives to the best one are added."""
    weighed |= {other: _Weighed(clutch=clutch, belief=other).log_probability for other in best.instead()}
    doubts = any(log_odds >= math.log(criteria.HELD) for log_odds in best.log_odds.values())
    if not (best.belief.slipped or doubts or len(weighed) > 1):
        return {}
    for index, log_odds in best.log_odds.items():
        if index not in best.belief.outlying | best.belief.levels:  # else other tests lean on it
            sign = -1.0 if index in best.belief.slipped else 1.0
            weighed.setdefault(best.belief.turned(index), best.log_probability + sign * log_odds)
    total = np.logaddexp.reduce(list(weighed.values()))
    verdicts = {}
    for index in sorted(set().union(*(belief.slipped for belief in weighed))):
        with_it = [value for belief, value in weighed.items() if index in belief.slipped]
        log_share = min(float(np.logaddexp.reduce(with_it) - total), -1e-12)
        log_odds = log_share - math.log(-math.expm1(log_share))
        if log_odds >= math.log(criteria.HELD) and not clutch.runs[index].fixed:
            verdicts[index] = best.verdict(index)
    return verdicts


def _searched(clutch: "_Clutch") -> tuple["_Weighed", dict[Belief, float]]:
    """The local optimum of the greedy search, from the belief that all runs are as sent, and the log probability of
    every belief visited."""
    now = _Weighed(clutch=clutch, belief=Belief())
    met = {now.belief: now.log_probability}
    for _ in range(16):  # changes at most
        moves = [(moved, gain) for moved, gain in now.moves() if gain > _WORTH and moved not in met]
        moves.sort(key=lambda move: -move[1])
        then = [_Weighed(clutch=clutch, belief=moved) for moved, _ in moves[:3]]
        met |= {weighed.belief: weighed.log_probability for weighed in then}
        best = max(then, key=lambda weighed: weighed.log_probability, default=now)
        if best.log_probability <= now.log_probability + _WORTH:
            break
        now = best
    return now, met


@dataclass(frozen=True)
class _Clutch:
    """All runs of a clutch, with the quantities that are the same under every belief."""

    runs: tuple[Run, ...]
    about: frozenset[int]
    fits: dict[tuple[Any, ...], CourseFit] = field(default_factory=dict)
    _weighed_slips: dict[int, list[Slip]] = field(default_factory=dict)

    def slips(self, index: int, expected: float) -> list[Slip]:
        """All slips that a run may have suffered; if its cycles are mistaken altogether, they were most likely
        `expected`."""
        run = self.runs[index]
        if index not in self._weighed_slips:
            self._weighed_slips[index] = list(slips_of(run, expected))
        return [
            replace(slip, likely=replace(run.sent, cycles=expected)) if slip.name == OTHER_CYCLES else slip
            for slip in self._weighed_slips[index]
        ]

    @cached_property
    def place(self) -> dict[int, int]:
        """Index of each run within `near`."""
        return {i: k for k, i in enumerate(self.near)}

    @cached_property
    def cycles(self) -> FloatArray:
        """Cycles [n] of the runs as sent."""
        return np.array([run.cycles for run in self.runs])

    @cached_property
    def centres(self) -> FloatArray:
        """Cycles around which runs are judged: those of the runs asked about, and the latest."""
        return np.append(self.cycles[sorted(self.about)], self.cycles.max(initial=0.0))

    @cached_property
    def near(self) -> list[int]:
        """The runs whose cycles are judged, the 80 nearest to the centres, in the order of the history."""
        return self._nearest(range(len(self.runs)), 80)

    @cached_property
    def all_tests(self) -> list[int]:
        """Indices of the tests."""
        return [i for i, run in enumerate(self.runs) if run.tests]

    @cached_property
    def tests(self) -> list[int]:
        """The tests whose COF is judged, the 40 nearest to the centres."""
        return self._nearest(self.all_tests, 40)

    @cached_property
    def rebuilds(self) -> list[int]:
        """Indices of the runs that begin a life."""
        return [i for i, run in enumerate(self.runs) if run.rebuild]

    @cached_property
    def shifts(self) -> list[int]:
        """Indices of the events that may have shifted the level of COF."""
        return [i for i, run in enumerate(self.runs) if run.shift]

    @cached_property
    def followed(self) -> frozenset[int]:
        """The judged tests of which the five tests right before are judged too, so that a new level can be seen."""
        tests, known_tests = self.all_tests, set(self.tests)
        places = (bisect.bisect_left(tests, i) for i in self.tests)
        return frozenset(tests[k] for k in places if known_tests.issuperset(tests[max(k - 5, 0) : k + 1]))

    @cached_property
    def compared(self) -> frozenset[int]:
        """The runs nearer to the centres than every test left out: beyond these the course is only a guess."""
        left_out = sorted(set(self.all_tests).difference(self.tests))
        reach = self._apart(left_out).min(initial=math.inf)
        return frozenset(np.flatnonzero(self._apart(range(len(self.runs))) < reach).tolist())

    @cached_property
    def doubtable(self) -> list[int]:
        """The runs that may have slipped: all but tests too far away to be judged, which are as sent in every belief
        and add the same to each."""
        far = set(self.all_tests).difference(self.compared, self.tests, self.about)
        return sorted(set(range(len(self.runs))) - far)

    def _nearest(self, indices: Sequence[int], most: int) -> list[int]:
        """So many of the runs' indices, those nearest to the runs asked about and to the latest one, ascending."""
        if len(indices) <= most:
            return list(indices)
        nearest = np.argsort(self._apart(indices), kind="stable")
        return sorted(indices[k] for k in nearest[:most].tolist())

    def _apart(self, indices: Sequence[int]) -> FloatArray:
        """Distance [k] in cycles of runs from the nearest centre."""
        return np.asarray(np.abs(self.cycles[list(indices), None] - self.centres).min(axis=1))

    @cached_property
    def rank(self) -> NDArray[np.intp]:
        """Order [k] at equal cycles of each nearby run, by its kind."""
        return np.array([pace.rank_of(self.runs[i].kind) for i in self.near], dtype=np.intp)

    @cached_property
    def block(self) -> FloatArray:
        """Cycles [k] of each nearby run that is a block of duty; NaN for other runs."""
        return np.array([math.nan if (block_of_run := self.runs[i].block) is None else block_of_run for i in self.near])

    @cached_property
    def dated(self) -> list[int]:
        """Indices within `near` of the runs with a date."""
        return [k for k, i in enumerate(self.near) if self.runs[i].moment is not None]

    @cached_property
    def moments(self) -> FloatArray:
        """Dates [d] s of the nearby runs that have one."""
        return np.array([self.runs[self.near[k]].moment for k in self.dated], dtype=np.float64)

    def surprise(self, cycles: FloatArray) -> FloatArray:
        """Log probability [n] of the cycles and dates of each run of `near` given the others."""
        total = pace.log_given_others(cycles, self.rank, self.block)
        if self.dated:
            start = cycles[self.dated] - np.nan_to_num(self.block[self.dated])
            without = np.tile(start, (1 + start.size, 1))
            without[1:][np.diag_indices(start.size)] = math.inf
            log_orders = pace.log_order(without, self.moments)
            total[self.dated] += log_orders[0] - log_orders[1:]
        return total

    def log_cycles(self, sets: FloatArray) -> FloatArray:
        """Log probability [h] of the cycles and dates of `near`, for sets of cycles [h, n]."""
        total = pace.log_probability(sets, self.rank, self.block)
        if self.dated:
            start = sets[:, self.dated] - np.nan_to_num(self.block[self.dated])
            total = total + pace.log_order(start, self.moments)
        return total


@dataclass(frozen=True)
class _Weighed:
    """A belief with its log probability and the gains of its single changes."""

    clutch: _Clutch
    belief: Belief
    _weighed_slips: dict[int, tuple[float, float, Slip] | None] = field(default_factory=dict)

    @cached_property
    def kept(self) -> list[int]:
        """The runs that are as sent."""
        return [i for i in range(len(self.clutch.runs)) if i not in self.belief.slipped]

    @cached_property
    def origins(self) -> list[float]:
        """The cycles at which lives begin."""
        return [0.0, *(self.clutch.runs[i].cycles for i in self._rebuilds)]

    @cached_property
    def _rebuilds(self) -> list[int]:
        """Indices of the rebuilds that did not slip."""
        return [i for i in self.clutch.rebuilds if i not in self.belief.slipped]

    def life_of(self, index: int) -> int:
        """The index of the life to which a run belongs, by the run's index in the history."""
        return bisect.bisect_right(self._rebuilds, index)

    @cached_property
    def fits(self) -> list[tuple[CourseFit, list[int]]]:
        """The course of every life, and the indices of its tests."""
        fits: list[tuple[CourseFit, list[int]]] = []
        level, level_sd = math.log(criteria.COF), criteria.LOG_COF_SD
        for life in range(len(self.origins)):
            tests_of_life = [i for i in self.clutch.tests if self.life_of(i) == life and i not in self.belief.slipped]
            fit = self._fit(tests_of_life, life, level, level_sd)
            fits.append((fit, tests_of_life))
            if tests_of_life:
                # of a rebuilt clutch from the life before
                level, level_sd = float(fit.tests.log_cof[np.argmin(fit.tests.cycles)]), 0.3
        return fits

    def _fit(self, own: Sequence[int], life: int, level: float, level_sd: float) -> CourseFit:
        """The course of a life fitted to the tests `own`."""
        origin, belief = self.origins[life], self.belief
        shifts = self._shifts(life)
        outlying, levels = (tuple(i for i in own if i in chosen) for chosen in (belief.outlying, belief.levels))
        key = (tuple(own), outlying, levels, shifts.tobytes(), origin, level, level_sd)
        if key not in self.clutch.fits:
            sent = [self.clutch.runs[i].sent for i in own]
            cycles = np.array([max(reading.cycles - origin, 0.0) for reading in sent])
            further = np.array([criteria.OUTLYING_SD**2 if i in outlying else 0.0 for i in own])
            tests = Tests(
                cycles=cycles,
                log_cof=np.array([reading.log_cof for reading in sent], dtype=np.float64),
                variance=np.array([reading.spread**2 for reading in sent]) + further,
                epoch=_epoch(shifts, cycles + origin),
                levels=np.array([c for i, c in zip(own, cycles.tolist(), strict=True) if i in levels]),
                level=level,
                level_sd=level_sd,
            )
            self.clutch.fits[key] = CourseFit(tests)
        return self.clutch.fits[key]

    def _without(self, index: int, life: int) -> CourseFit:
        """The course of a life fitted without one of its tests."""
        fit, fitted_tests = self.fits[life]
        if index not in fitted_tests:
            return fit
        return self._fit([i for i in fitted_tests if i != index], life, fit.tests.level, fit.tests.level_sd)

    def _shifts(self, life: int) -> FloatArray:
        """The cycles of the events of a life that may have shifted its level."""
        shifts = [i for i in self.clutch.shifts if i not in self.belief.slipped and self.life_of(i) == life]
        return self.clutch.cycles[shifts]

    @cached_property
    def log_probability(self) -> float:
        """Log probability of the belief with all runs, up to a constant of the runs."""
        total = self.base
        for i in self.clutch.doubtable:
            run = self.clutch.runs[i]
            if i in self.belief.slipped:
                continue
            total += run.sent.log_protocol
            if run.sent.log_cof is not None:
                total += float(log_physics(np.array(run.sent.log_cof))) if run.tests else self.log_cof(i, [run.sent])[0]
        return total + sum(slips[1] for i in self.belief.slipped if (slips := self.weigh(i)) is not None)

    @cached_property
    def base(self) -> float:
        """Log probability of the tests under their course, of cycles and dates, and of the belief a priori; slips
        excluded."""
        total = sum(fit.log_evidence for fit, fitted_tests in self.fits if fitted_tests)
        total += len(self.belief.outlying) * _log_odds(criteria.OUTLYING_SHARE)
        total += sum(self._log_level(i) for i in self.belief.levels)
        return total + float(self.clutch.log_cycles(self._sets([]))[0])

    def _sets(self, changes: Sequence[Mapping[int, float]]) -> FloatArray:
        """Sets of cycles [1 + h, n] of `near`: as the belief has them, and with each of the changes; infinite for a run
        that is left out."""
        place = self.clutch.place
        now = self.clutch.cycles[self.clutch.near].copy()
        now[[k for i, k in place.items() if i in self.belief.slipped]] = math.inf
        sets = np.tile(now, (1 + len(changes), 1))
        for row, change in zip(sets[1:], changes, strict=True):
            for i, cycles in change.items():
                row[place[i]] = cycles
        return sets

    def _log_level(self, test: int) -> float:
        """Log prior probability that a new level begins with a test."""
        return math.log(self._new_level_probability(self.life_of(test), self.clutch.runs[test].sent.cycles))

    def _new_level_probability(self, life: int, cycles: float) -> float:
        """Prior probability that a new level begins with a test of a life at these cycles; larger where maintenance lies
        between it and the test before, or at the cycles of either: which came first is not known then."""
        runs, shifts = self.clutch.runs, self._shifts(life)
        _, fitted_tests = self.fits[life]
        earlier = (runs[i].sent.cycles for i in fitted_tests)
        before = max((at for at in earlier if at < cycles), default=0.0)  # tests at the same cycles step together
        declared = ((shifts >= before) & (shifts <= cycles)).any()
        return criteria.LEVEL_AFTER_EVENT if declared else criteria.LEVEL_UNDECLARED

    def _new_level(self, index: int, life: int, cycles: float) -> float:
        """Prior probability of a new level from this test on, if the test is later than all others of its life; 0
        otherwise, for later tests would have the level too."""
        runs = self.clutch.runs
        other_cycles = [runs[i].sent.cycles for i in self.fits[life][1] if i != index]
        return self._new_level_probability(life, cycles) if other_cycles and max(other_cycles) < cycles else 0.0

    def log_cof(self, index: int, readings: Sequence[RunReading]) -> list[float]:
        """Log density of the COF of a run's readings under the course of the other tests; 0 for a reading without
        COF."""
        run, life = self.clutch.runs[index], self.life_of(index)
        shown = [reading for reading in readings if reading.log_cof is not None]
        if not shown:
            return [0.0] * len(readings)
        by_life: dict[int, list[RunReading]] = {}
        for reading in shown:
            at = life if reading.cycles == run.sent.cycles else self._life_at(reading.cycles)
            by_life.setdefault(at, []).append(reading)
        values: dict[int, float] = {}
        for at, of_life in by_life.items():
            cycles, of = np.unique([reading.cycles for reading in of_life], return_inverse=True)
            predicted = self._predicted(index, at, cycles).at(of)
            log_cof = np.array([reading.log_cof for reading in of_life], dtype=np.float64)
            spread = np.array([reading.spread for reading in of_life])
            new_level = np.array([self._new_level(index, at, value) for value in cycles.tolist()])[of]
            density = predicted.log_density(log_cof, spread, new_level) + log_physics(log_cof)
            values |= zip(map(id, of_life), np.maximum(density, _LEAST).tolist(), strict=True)
        return [values.get(id(reading), 0.0) for reading in readings]

    def _predicted(self, index: int, life: int, cycles: FloatArray) -> Predicted:
        """Predictive distribution of log COF at cycles [m] of a life, from its tests without that run."""
        epoch = _epoch(self._shifts(life), cycles)
        return self._without(index, life).predict(np.maximum(cycles - self.origins[life], 0.0), epoch)

    def _life_at(self, cycles: float) -> int:
        """Index of the life to which these cycles belong."""
        return max((life for life, origin in enumerate(self.origins) if origin <= cycles), default=0)

    def expected(self, index: int) -> float:
        """The most likely true cycles of a run whose cycles are mistaken: one gap after the latest run, the last gap of
        its kind, or the latest run plus its block."""
        run = self.clutch.runs[index]
        near = [i for i in self.clutch.near if i not in self.belief.slipped and i != index]
        latest = max((self.clutch.runs[i].sent.cycles for i in near), default=0.0)
        if run.block is not None:
            return latest + run.block
        gaps = np.diff(self._of_kind(index))
        return latest + (float(gaps[-1]) if gaps.size else 0.0)

    def _of_kind(self, index: int) -> FloatArray:
        """Distinct cycles of the other runs nearby that are of this run's kind and did not slip, ascending."""
        kind, near = self.clutch.runs[index].kind, [i for i in self.clutch.near if i not in self.belief.slipped]
        same_kind = [i for i in near if i != index and self.clutch.runs[i].kind == kind]
        return np.unique(self.clutch.cycles[same_kind]) if same_kind else np.zeros(0)

    def weigh(self, index: int) -> tuple[float, float, Slip] | None:
        """Log weights of a run as sent, log L, and with its slip undone, log Σ P(slip) L, and its most probable slip;
        None if it can have no slip."""
        if index not in self._weighed_slips:
            self._weighed_slips[index] = self._slip_of(index)
        return self._weighed_slips[index]

    def _slip_of(self, index: int) -> tuple[float, float, Slip] | None:
        """Log probability [nats] of a run as sent, that of all its possible slips together, and the likeliest slip;
        None without a possible slip."""
        run = self.clutch.runs[index]
        slips = self.clutch.slips(index, self.expected(index))
        if all(fitted_tests in ([], [index]) for _, fitted_tests in self.fits):
            slips = [slip for slip in slips if slip.name not in OF_CLUTCH]
        if not slips:
            return None
        readings = [run.sent, *(slip.likely for slip in slips)]
        of_cof = self.log_cof(index, readings)
        of_cycles = self._log_cycles(index, [reading.cycles for reading in readings])
        as_sent = of_cof[0] + of_cycles[0] + run.sent.log_protocol
        weights = []
        for slip, cof, cycles in zip(slips, of_cof[1:], of_cycles[1:], strict=True):
            cof = 0.0 if slip.name in OF_CLUTCH else cof
            cycles = 0.0 if slip.name in (OTHER_CYCLES, OTHER_CLUTCH) else cycles
            weights.append(slip.log_prior + cof + cycles + slip.likely.log_protocol)
        confirmed = math.log(criteria.CONFIRMED) if run.fixed else 0.0
        return as_sent, float(np.logaddexp.reduce(weights)) + confirmed, slips[int(np.argmax(weights))]

    def _log_cycles(self, index: int, cycles: Sequence[float]) -> list[float]:
        """Log probability of a run's cycles, for each of several values, given the other runs."""
        if index not in self.clutch.place:
            return [0.0] * len(cycles)
        values, of = np.unique(cycles, return_inverse=True)
        sets = self._sets([{index: math.inf}, *({index: value} for value in values.tolist())])
        log_cycles = self.clutch.log_cycles(sets[1:])
        return [float(value) for value in (log_cycles[1:] - log_cycles[0])[of]]

    @cached_property
    def suspects(self) -> frozenset[int]:
        """The at most four runs of largest surprise, if a slip might explain them better: surprise is lost log density
        of COF given the others, plus that of cycles, pressures, speeds and oil beside the others of their kind. A run
        without others of its kind is always a suspect."""
        runs = self.clutch.runs
        of_cycles = dict(zip(self.clutch.near, self.clutch.surprise(self._sets([])[0]).tolist(), strict=True))
        kept = (i for i in self.clutch.near if i not in self.belief.slipped)
        compared_runs = [i for i in kept if i in self.clutch.compared]
        surprise: dict[int, float] = {}
        for kind in {runs[i].kind for i in compared_runs}:
            of_kind = [i for i in compared_runs if runs[i].kind == kind]
            protocol = _greatest_of_others([runs[i].sent.log_protocol for i in of_kind], alone=math.inf)
            cycles = _greatest_of_others([of_cycles[i] for i in of_kind], alone=0.0)
            for i, at_protocol, at_cycles in zip(of_kind, protocol, cycles, strict=True):
                surprise[i] = at_protocol - runs[i].sent.log_protocol
                surprise[i] += at_cycles - of_cycles[i]
        for life, (fit, fitted_tests) in enumerate(self.fits):
            shows = [
                i
                for i in compared_runs
                if i not in fitted_tests and self.life_of(i) == life and runs[i].sent.log_cof is not None
            ]
            of_tests = dict(zip(fitted_tests, (fit.misses() if fitted_tests else np.zeros(0)).tolist(), strict=True))
            of_others = dict(zip(shows, self._misses(shows, life, fit).tolist(), strict=True))
            for i in surprise.keys() & (of_tests | of_others):
                surprise[i] += (of_tests | of_others)[i]
        least = math.log(criteria.HELD / criteria.DIGIT_SLIP)  # by less no slip is as probable as that
        odd = sorted((i for i in compared_runs if surprise[i] > least), key=lambda i: (-surprise[i], i))
        return frozenset(odd[:4])

    def _misses(self, shows: Sequence[int], life: int, fit: CourseFit) -> FloatArray:
        """Log density [k] that the COF of runs which are no tests loses against the middle of the course's
        prediction."""
        sent = [self.clutch.runs[i].sent for i in shows]
        cycles = np.array([reading.cycles for reading in sent])
        predicted = fit.predict(np.maximum(cycles - self.origins[life], 0.0), _epoch(self._shifts(life), cycles))
        spread = np.array([reading.spread for reading in sent])
        off = np.array([reading.log_cof for reading in sent], dtype=np.float64) - predicted.mean
        return missed(off, predicted.variance + spread**2, predicted.log_weight[:, None])

    @cached_property
    def log_odds(self) -> dict[int, float]:
        """Log odds of a slip for every suspect and every run believed to have slipped, all else as the belief has
        it."""
        questioned = sorted(self.suspects | self.belief.slipped)
        return {i: slips[1] - slips[0] for i in questioned if (slips := self.weigh(i)) is not None}

    def moves(self) -> Iterator[tuple[Belief, float]]:
        """Beliefs that differ from this one by one run (slipped, outlying, or at a new level), each with the approximate
        gain in log probability [nats]."""
        belief = self.belief
        for i, log_odds in self.log_odds.items():
            yield belief.turned(i), -log_odds if i in belief.slipped else log_odds
        for fit, fitted_tests in self.fits:
            if not fitted_tests:
                continue
            for i, gain in zip(fitted_tests, self._outlier_gains(fit, fitted_tests), strict=True):
                if gain > _WORTH:
                    yield replace(belief, outlying=belief.outlying ^ {i}), gain
            gains = fit.log_step_gains()
            for k in np.flatnonzero(gains > _WORTH).tolist():
                i = fitted_tests[k]
                if i not in belief.levels and fit.tests.cycles[k] > fit.tests.cycles.min():
                    yield replace(belief, levels=belief.levels | {i}), float(gains[k]) + self._log_level(i)

    def _outlier_gains(self, fit: CourseFit, fitted_tests: Sequence[int]) -> list[float]:
        """Gain in log probability [nats] by each of a life's tests if it becomes outlying, or sound where it is outlying
        now."""
        mean, variance, log_weight = fit.without
        off = fit.tests.log_cof - mean
        sign = np.array([-1.0 if i in self.belief.outlying else 1.0 for i in fitted_tests])
        now, then = (
            np.logaddexp.reduce(log_weight + log_normal(off, variance + more * criteria.OUTLYING_SD**2), axis=0)
            for more in (0.0, sign)
        )
        gains = then - now + sign * _log_odds(criteria.OUTLYING_SHARE)
        return [float(gain) for gain in gains]

    def instead(self) -> Iterator[Belief]:
        """Beliefs with a slip in place of an outlier or new level at the latest test of a life."""
        belief = self.belief
        for _, fitted_tests in self.fits:
            i = max(fitted_tests, key=lambda j: float(self.clutch.cycles[j]), default=-1)
            if i in belief.outlying | belief.levels:
                yield belief.turned(i)

    def verdict(self, index: int) -> SlipVerdict:
        """The verdict on a doubted run: its most probable slip, the COF expected at its cycles, and its place among
        runs of its kind."""
        sent = self.clutch.runs[index].sent
        weighed = self.weigh(index)
        slip = Slip(name=OTHER_CYCLES, log_prior=0.0, likely=sent) if weighed is None else weighed[2]
        other_cycles = self._of_kind(index)
        if other_cycles.size == 0:
            other_cycles = np.unique(self.clutch.cycles[[i for i in self.kept if i != index]])
        before = other_cycles[other_cycles < sent.cycles - 0.5]
        gaps = np.diff(other_cycles)
        return SlipVerdict(
            slip=slip,
            expected=self._interval(index, sent),
            expected_then=self._interval(index, slip.likely),
            against_time=self._against_time(index),
            usual_gap=float(np.median(gaps[-5:])) if gaps.size else None,
            before=float(before[-1]) if before.size else None,
            latest=float(other_cycles[-1]) if other_cycles.size else None,
        )

    def _interval(self, index: int, reading: RunReading) -> tuple[float, float] | None:
        """COF two standard deviations below and above the mean that the other tests of the life predict for a reading;
        None without other tests."""
        life = self._life_at(reading.cycles)
        if all(fitted_tests in ([], [index]) for _, fitted_tests in self.fits):
            return None
        return self._predicted(index, life, np.array([reading.cycles])).interval(0, reading.spread)

    def _against_time(self, index: int) -> bool:
        """Whether a run's date contradicts a run that is as sent: fewer cycles but later, or more cycles but
        earlier."""
        run = self.clutch.runs[index]
        if run.moment is None:
            return False
        for other in (self.clutch.runs[i] for i in self.kept if i != index):
            further = other.cycles - (other.block or 0.0) - (run.cycles - (run.block or 0.0))
            later = 0.0 if other.moment is None else other.moment - run.moment
            if (further < -0.5 and later > 1.0) or (further > 0.5 and later < -1.0):
                return True
        return False


def _greatest_of_others(log_density: Sequence[float], *, alone: float) -> list[float]:
    """The greatest log density among the others of each run; `alone` where there are none."""
    if len(log_density) < 2:
        return [alone] * len(log_density)
    second, first = sorted(log_density)[-2:]
    return [second if value == first else first for value in log_density]


def _log_odds(share: float) -> float:
    return math.log(share) - math.log1p(-share)


def _epoch(shifts: FloatArray, cycles: FloatArray) -> FloatArray:
    """Number [m] of events before cycles [m]."""
    return np.asarray((shifts[None, :] <= cycles[:, None]).sum(axis=1), dtype=np.float64)
