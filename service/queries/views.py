"""Answers that few ask for, worked out from the stored fits when they are asked for, and remembered by revision.

Each of a clutch's predictions at a single pressure, and eq. 6 for every Stribeck parameter, would cost a run's post more
than the rest of it together. Their inputs are stored, their random numbers depend on clutch, series and step alone, so
they are the same whenever they are asked for.
"""

import threading
from collections import OrderedDict
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

from models.clutch import Geometry
from models.friction.stribeck import PARAMETER_NAMES
from service.errors import NotFoundError
from service.lives.assumptions import ALL_PRESSURES, Basis
from service.lives.history import Event, Life, Series, lives, nearest
from service.lives.prediction import unknown
from service.lives.receipt import bar
from service.lives.run_analysis import LevelFit, Value
from service.lives.tracks import advance, predict
from service.queries.rebuilt import Track, disagreements, rebuilt
from service.queries.trajectories import item, posterior_of
from service.readers.units import PASCALS_PER_BAR


class Remembered:
    """The last answers, by what they depend on; safe to share between threads, the least lately asked for goes first.

    `most` is how large they may be together, in whatever unit `keep` is told sizes.
    """

    def __init__(self, most: int = 256) -> None:
        self._most = most
        self._held = 0
        self._answers: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()
        self._lock = threading.Lock()

    def find(self, key: Hashable) -> Any | None:
        """The answer for `key`, or None where it is not remembered."""
        with self._lock:
            if key not in self._answers:
                return None
            self._answers.move_to_end(key)
            return self._answers[key][0]

    def keep(self, key: Hashable, answer: Any, size: int = 1) -> None:
        """Remember an answer of that size; one that is larger than all may be together is not."""
        if size > self._most:
            return
        with self._lock:
            self._held += size - self._answers.pop(key, (None, 0))[1]
            self._answers[key] = answer, size
            while self._held > self._most:
                self._held -= self._answers.popitem(last=False)[1][1]


def foretell(
    clutch_id: str,
    events: Sequence[Event],
    basis: Basis,
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
        return unknown(basis, None, level, fraction)
    life = lives(happened)[-1]
    cycles = happened[-1].cycles
    series = life.pooled(basis) if pressure_bar is None else life.at(basis, level)
    if not series.measurements:
        return unknown(basis, cycles, level, fraction)
    tracked = advance(clutch_id, method, series, basis, None, len(series.measurements))
    return predict(clutch_id, method, series, basis, tracked, cycles, fraction)


def _level(life: Life | None, pressure_bar: float) -> float:
    levels = [] if life is None else sorted(life.reference)
    asked = pressure_bar * PASCALS_PER_BAR
    near = nearest(asked, {level: (level, 0.0) for level in levels})
    if near is None:
        measured = ", ".join(f"{bar(level):g}" for level in levels) or "none"
        raise NotFoundError(f"no track at {pressure_bar:g} bar; the pressures of the first stationary test: {measured}")
    return near[0]


def degradation(
    clutch_id: str,
    events: Sequence[Event],
    basis: Basis,
    fits: Mapping[str, Sequence[LevelFit]],
    geometry: Geometry,
    fraction: float,
) -> dict[str, Any]:
    """Eq. 6 for mean COF and the four Stribeck parameters, together and at every reference pressure, in the present life;
    and mean COF rebuilt from the parameters.

    `fits` are the levels of each test by run_id.
    """
    found = lives(events)
    if not found or not found[-1].reference:
        return {"items": [], "rebuilt": None, "warnings": []}
    life = found[-1]
    tests = tests_of(life, fits)
    direct = [life.pooled(basis), *(life.at(basis, level) for level in life.reference)]
    tracked = [(each, posterior_of(clutch_id, each, basis)) for each in direct if each.measurements]
    parameters = parameter_tracks(clutch_id, life, basis, tests)
    again = rebuilt(
        clutch_id, life, basis, tests, parameters, {each[0].pressure: each for each in tracked}, geometry, fraction
    )
    return {
        "items": [item(series, posterior, basis) for series, posterior in (*tracked, *parameters.values())],
        "rebuilt": again,
        "warnings": [{"code": each.code, "message": each.message} for each in disagreements(again)],
    }


def parameter_tracks(
    clutch_id: str, life: Life, basis: Basis, tests: Sequence[Sequence[LevelFit]]
) -> dict[tuple[str, float], Track]:
    """Every Stribeck parameter's own eq. 6 at every reference pressure where it is known, by name and pressure [Pa]."""
    return {
        (name, series.pressure): (series, posterior_of(clutch_id, series, basis))
        for name in PARAMETER_NAMES
        for series in parameter_series(life, basis, tests, name)
        if series.measurements
    }


def tests_of(life: Life, fits: Mapping[str, Sequence[LevelFit]]) -> list[Sequence[LevelFit]]:
    """The levels of each of a life's events, none where it is no test."""
    return [fits.get(event.run_id, ()) for event in life.events]


def parameter_series(life: Life, basis: Basis, tests: Sequence[Sequence[LevelFit]], name: str) -> list[Series]:
    """One Stribeck parameter at every reference pressure, by the fits that determine it."""
    column = PARAMETER_NAMES.index(name)
    values = [_parameter(levels, name, column) for levels in tests]
    return [life.series(basis, name, level, [nearest(level, each) for each in values]) for level in life.reference]


def _parameter(levels: Sequence[LevelFit], name: str, column: int) -> dict[float, Value]:
    return {
        each.fit.pressure: (
            float(each.fit.parameters.as_array()[column]),
            float(each.fit.covariance[column, column] ** 0.5),
        )
        for each in levels
        if name not in each.fit.undetermined
    }
