"""How well a run goes with what is known of its clutch: one log likelihood, of the run as sent or as a slip would have it.

    log L = log P(cycles) + log P(order in time) + log p(COF | cycles) + log p(pressure, speed) + log p(oil)

with the pace, the course of mean COF and the protocol of the life to which those cycles belong.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from models.tracking.measurement import Measurement
from service.lives.assumptions import Assumptions
from service.lives.criteria import OTHER_OIL
from service.lives.history import Event, Life, lives_of, pooled_value
from service.lives.plausibility import criteria
from service.lives.plausibility.course import Course, Predicted, course_of
from service.lives.plausibility.pace import Pace, normal, pace_of
from service.lives.plausibility.reading import Reading, log_or_none

#: The least density that counts: no slip is proved by a number that underflows.
_LEAST = 1e-250


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """What is known of a clutch without the run in question."""

    events: tuple[Event, ...]
    newest: Event
    pace: Pace
    lives: tuple[Life, ...]
    courses: tuple[Course, ...]
    corrected: bool
    dated: tuple[tuple[float, float], ...]
    disorder: float
    protocol: tuple[float | None, float | None]
    _predicted: dict[tuple[int, float], tuple[Predicted, int]] = field(default_factory=dict)
    _of_cycles: dict[float, float] = field(default_factory=dict)

    def log_likelihood(self, reading: Reading) -> float:
        """log L of a reading as the honest reading of this clutch."""
        return self.of_cycles(reading) + self.of_cof(reading) + self.of_protocol(reading)

    def of_cycles(self, reading: Reading) -> float:
        """The part of cycles: their pace, and their order in time where runs are dated."""
        cycles = reading.cycles
        if cycles not in self._of_cycles:
            self._of_cycles[cycles] = self.pace.log_probability(cycles) + self.of_time(cycles)
        return self._of_cycles[cycles]

    def of_time(self, cycles: float) -> float:
        """log P that the run was started when it says, at those cycles."""
        return math.log(self.disorder if self.out_of_order(cycles) else 1.0 - self.disorder)

    def out_of_order(self, cycles: float) -> bool:
        """Whether a dated run was made earlier with more cycles, or later with fewer."""
        return self.newest.dated and _contradicts(self._start(cycles), self.newest.moment, self.dated)

    def of_cof(self, reading: Reading) -> float:
        """The part of COF, by the course of the life to which those cycles belong; 0 for a run that shows none."""
        if reading.cof is None:
            return 0.0
        best = -math.inf
        for index in self._lives_at(reading.cycles):
            compared = self.comparable(reading, index)
            if compared is None:
                return math.log(_LEAST)
            predicted, column = self.predicted(reading.cycles, index)
            best = max(best, predicted.log_density(column, *compared))
        return max(best, math.log(_LEAST))

    def comparable(self, reading: Reading, life: int) -> tuple[float, float] | None:
        """log COF of a reading as the tests of a life show it, and its deviation; None where COF is not positive."""
        spread = math.hypot(reading.spread, criteria.STEP_SD if self.corrected else 0.0)
        first = next((event for event in self.lives[life].events if event.cofs), None) if self.lives else None
        if first is not None and first.oil_temperature is not None and reading.oil is not None:
            beyond = max(abs(reading.oil - first.oil_temperature) - OTHER_OIL, 0.0)
            spread = math.hypot(spread, criteria.OTHER_OIL_SD * beyond)
        pooled = pooled_value(first.cofs, reading.mean_cof) if reading.mean_cof and first is not None else None
        if pooled is not None and pooled[0] > 0:
            return math.log(pooled[0]), math.hypot(spread, pooled[1] / pooled[0])
        if reading.mean_cof:
            cof = math.fsum(cof for cof, _ in reading.mean_cof.values()) / len(reading.mean_cof)
        else:
            cof, spread = reading.cof or 0.0, math.hypot(spread, criteria.ROWS_SD)
        if first is not None and reading.pressure is not None:
            apart = math.log(reading.pressure / max(first.cofs))
            spread = math.hypot(spread, criteria.OTHER_PRESSURE_SD * apart)
        log_cof = log_or_none(cof)
        return None if log_cof is None else (log_cof, spread)

    def of_protocol(self, reading: Reading) -> float:
        """The part of pressures, speeds and oil temperature."""
        pressure, speed = self.protocol
        total = _log_protocol(reading.pressure, pressure, (criteria.PRESSURE, criteria.LOG_PRESSURE_SD))
        total += _log_protocol(reading.speed, reading.declared_speed or speed, (criteria.SPEED, criteria.LOG_SPEED_SD))
        if reading.oil is not None:
            total += _log_normal(reading.oil, criteria.OIL, criteria.OIL_SD)
        return total

    def predicted(self, cycles: float, life: int | None = None) -> tuple[Predicted, int]:
        """log COF at cycles since new, of the life to which they belong, and the column of the prediction."""
        index = self._lives_at(cycles)[0] if life is None else life
        if (index, cycles) not in self._predicted:
            self.predict([cycles])
        return self._predicted[index, cycles]

    def predict(self, cycles: Sequence[float]) -> None:
        """Predict at all of these cycles at once; what follows asks for it."""
        by_life: dict[int, list[float]] = {}
        for wanted in dict.fromkeys(cycles):
            for index in self._lives_at(wanted):
                by_life.setdefault(index, []).append(wanted)
        for index, wanted_here in by_life.items():
            origin, shifts = 0.0, np.zeros(0)
            if self.lives:
                life = self.lives[index]
                origin, shifts = life.origin, np.array([event.cycles for event in life.events if event.shift])
            at = np.array(wanted_here)
            epoch = (shifts <= at[:, None]).sum(axis=1).astype(np.float64)
            made = self.courses[index].predict(np.maximum(at - origin, 0.0), epoch)
            self._predicted.update({(index, value): (made, column) for column, value in enumerate(wanted_here)})

    def _lives_at(self, cycles: float) -> list[int]:
        """The life to which cycles belong, the later one first where a rebuild was made at them."""
        if not self.lives:
            return [0]
        begun = [index for index, life in enumerate(self.lives) if life.origin <= cycles] or [0]
        return begun[::-1][:2] if self.lives[begun[-1]].origin == cycles and len(begun) > 1 else [begun[-1]]

    def _start(self, cycles: float) -> float:
        """The cycles at which the run was started: those at which its block began."""
        return cycles - (0.0 if self.newest.duty is None else self.newest.duty.cycles)


def history_of(events: Sequence[Event], newest: Event, *, corrected: bool) -> History:
    """The history before a run; `corrected`: a model in force corrects the mean COFs of tests."""
    lives = tuple(lives_of(events)) if events else ()
    courses: list[Course] = []
    level, level_sd, before = math.log(criteria.COF), criteria.LOG_COF_SD, None
    for life in lives:
        measurements = _log_cofs(life)
        courses.append(course_of(measurements, level=level, level_sd=level_sd, before=before))
        if measurements:
            level, level_sd = measurements[0].value, criteria.REBUILT_SD
            before = np.array([(m.progress, m.value - level) for m in measurements]).T
    if not lives:
        courses.append(course_of([], level=level, level_sd=level_sd))
    dated = tuple(sorted(_dated_start(event) for event in events if event.dated))
    return History(
        events=tuple(events),
        newest=newest,
        pace=pace_of(events, newest),
        lives=lives,
        courses=tuple(courses),
        corrected=corrected,
        dated=dated,
        disorder=_disorder(dated),
        protocol=_protocol(lives),
    )


def _log_cofs(life: Life) -> list[Measurement]:
    """log COF of the tests of a life, over the pressures of its first."""
    return [
        replace(m, value=math.log(m.value), variance=m.variance / m.value**2)
        for m in life.pooled(Assumptions()).measurements
        if m.value > 0
    ]


def _protocol(lives: Sequence[Life]) -> tuple[float | None, float | None]:
    """The highest pressure [Pa] and speed [rad/s] of the last life's reference test, None where there was none."""
    for life in reversed(lives):
        if life.speed_range is not None:
            return max(life.reference, default=None), life.speed_range[1]
    return None, None


def _disorder(dated: Sequence[tuple[float, float]]) -> float:
    """Probability that a run of this rig is out of order in time."""
    wrong = sum(
        1 for (before, earlier), (after, later) in itertools.pairwise(dated) if before < after - 0.5 and earlier > later
    )
    return (wrong + criteria.OUT_OF_ORDER) / (len(dated) + 1.0)


def _dated_start(event: Event) -> tuple[float, float]:
    return event.cycles - (0.0 if event.duty is None else event.duty.cycles), event.moment


def _contradicts(cycles: float, moment: float, others: Sequence[tuple[float, float]]) -> bool:
    return any(
        (start < cycles - 0.5 and began > moment + 1.0) or (start > cycles + 0.5 and began < moment - 1.0)
        for start, began in others
    )


def _log_protocol(value: float | None, reference: float | None, usual: tuple[float, float]) -> float:
    """log density of a test's highest pressure or speed: the reference test's, or another."""
    if value is None or value <= 0:
        return 0.0
    if reference is None or reference <= 0:
        return _log_normal(math.log(value), math.log(usual[0]), usual[1])
    off = math.log(value / reference)
    same = (1.0 - criteria.OTHER_PROTOCOL) * normal(off, 0.0, criteria.SAME_PROTOCOL_SD)
    return math.log(same + criteria.OTHER_PROTOCOL * normal(off, 0.0, criteria.OTHER_PROTOCOL_SD) + _LEAST)


def _log_normal(value: float, mean: float, deviation: float) -> float:
    return -0.5 * ((value - mean) / deviation) ** 2 - math.log(deviation * math.sqrt(2 * math.pi))
