"""Answers that few ask for, worked out from the stored fits when they are asked for, and remembered by revision.

Each of a clutch's predictions at a single pressure, and eq. 6 for every Stribeck parameter, would cost a run's post more
than the rest of it together. Their inputs are stored, their random numbers depend on clutch, series and step alone, so
they are the same whenever they are asked for.
"""

import threading
from collections import OrderedDict
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

from models.stribeck import PARAMETER_NAMES
from service.errors import NotFoundError
from service.formats.units import PASCALS_PER_BAR
from service.workflows.analysis import LevelFit, Value
from service.workflows.foretold import unknown
from service.workflows.history import ALL_PRESSURES, Event, Life, Series, lives, nearest
from service.workflows.receipts import bar
from service.workflows.tracks import advance, predict
from service.workflows.trajectories import item


class Remembered:
    """The last answers, by what they depend on; safe to share between threads, the least lately asked for goes first."""

    def __init__(self, most: int = 256) -> None:
        self._most = most
        self._answers: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = threading.Lock()

    def find(self, key: Hashable) -> Any | None:
        """The answer for `key`, or None where it is not remembered."""
        with self._lock:
            if key in self._answers:
                self._answers.move_to_end(key)
            return self._answers.get(key)

    def keep(self, key: Hashable, answer: Any) -> None:
        """Remember an answer."""
        with self._lock:
            self._answers[key] = answer
            while len(self._answers) > self._most:
                self._answers.popitem(last=False)


def foretell(
    clutch_id: str,
    events: Sequence[Event],
    fraction: float,
    *,
    method: str,
    pressure_bar: float | None,
    at_cycles: float | None,
) -> dict[str, Any]:
    """What is said at one pressure of the reference test, or over all; NotFoundError where it did not measure that one."""
    found = lives(events)
    level = ALL_PRESSURES if pressure_bar is None else _level(found[-1] if found else None, pressure_bar)
    happened = [event for event in events if at_cycles is None or event.cycles <= at_cycles]
    if not happened:
        return unknown(None, level, fraction)
    life = lives(happened)[-1]
    cycles = happened[-1].cycles
    series = life.pooled() if pressure_bar is None else life.at(level)
    if not series.measurements:
        return unknown(cycles, level, fraction)
    tracked = advance(clutch_id, method, series, None, len(series.measurements))
    return predict(clutch_id, method, series, tracked, life.origin, cycles, fraction)


def _level(life: Life | None, pressure_bar: float) -> float:
    levels = [] if life is None else sorted(life.reference)
    asked = pressure_bar * PASCALS_PER_BAR
    near = nearest(asked, {level: (level, 0.0) for level in levels})
    if near is None:
        measured = ", ".join(f"{bar(level):g}" for level in levels) or "none"
        raise NotFoundError(f"no track at {pressure_bar:g} bar; the pressures of the first stationary test: {measured}")
    return near[0]


def degradation(
    clutch_id: str, events: Sequence[Event], fits: Mapping[str, Sequence[LevelFit]]
) -> list[dict[str, Any]]:
    """Eq. 6 for mean COF and the four Stribeck parameters, together and at every reference pressure, in the present life.

    `fits` are the levels of each test by run_id.
    """
    found = lives(events)
    if not found or not found[-1].reference:
        return []
    life = found[-1]
    tests = tests_of(life, fits)
    series = [life.pooled(), *(life.at(level) for level in life.reference)]
    for name in PARAMETER_NAMES:
        series += parameter_series(life, tests, name)
    return [item(clutch_id, each, life.origin) for each in series if each.measurements]


def tests_of(life: Life, fits: Mapping[str, Sequence[LevelFit]]) -> list[Sequence[LevelFit]]:
    """The levels of each of a life's events, none where it is no test."""
    return [fits.get(event.run_id, ()) for event in life.events]


def parameter_series(life: Life, tests: Sequence[Sequence[LevelFit]], name: str) -> list[Series]:
    """One Stribeck parameter at every reference pressure, by the fits that determine it."""
    column = PARAMETER_NAMES.index(name)
    values = [_parameter(levels, name, column) for levels in tests]
    return [life.series(name, level, [nearest(level, each) for each in values]) for level in life.reference]


def _parameter(levels: Sequence[LevelFit], name: str, column: int) -> dict[float, Value]:
    return {
        each.fit.pressure: (
            float(each.fit.parameters.as_array()[column]),
            float(each.fit.covariance[column, column] ** 0.5),
        )
        for each in levels
        if name not in each.fit.undetermined
    }
