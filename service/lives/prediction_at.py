"""A prediction that is not stored: by any filter, at one pressure or over all, as it would have been made earlier."""

from collections.abc import Sequence
from typing import Any

from models.prognosis.back_cast import BackCast
from service.columns import PASCALS_PER_BAR, bar
from service.errors import NotFoundError
from service.lives.assumptions import ALL_PRESSURES, Assumptions
from service.lives.history import Event, Life, lives_of, nearest_pressure
from service.lives.payloads import ended, insufficient
from service.lives.tracks import Tracked, advance, predict


def predict_at(
    clutch_id: str,
    events: Sequence[Event],
    assumptions: Assumptions,
    fraction: float,
    *,
    method: str,
    pressure_bar: float | None = None,
    at_cycles: float | None = None,
    back_cast: BackCast | None = None,
    carried: Tracked | None = None,
) -> dict[str, Any]:
    """The prediction at one pressure of the reference test, or over all, as it would have been made at `at_cycles`.

    A `back_cast` that is known is not made again: of the exact filter it takes most of the time. A filter that was `carried`
    through the first of the measurements is carried on. Raises NotFoundError where
    the reference test did not measure that pressure.
    """
    lives = lives_of(events)
    level = ALL_PRESSURES if pressure_bar is None else _level(lives[-1] if lives else None, pressure_bar)
    happened = [event for event in events if at_cycles is None or event.cycles <= at_cycles]
    if not happened:
        return insufficient(assumptions, None, level, fraction)
    life = lives_of(happened)[-1]
    cycles = happened[-1].cycles
    series = life.pooled(assumptions) if pressure_bar is None else life.at(assumptions, level)
    if not series.measurements:
        return ended(insufficient(assumptions, cycles, level, fraction), life.end)
    tracked = advance(clutch_id, method, series, assumptions, carried, len(series.measurements), back_cast=back_cast)
    return ended(predict(clutch_id, method, series, assumptions, tracked, cycles, fraction), life.end)


def _level(life: Life | None, pressure_bar: float) -> float:
    levels = [] if life is None else sorted(life.reference)
    level = nearest_pressure(pressure_bar * PASCALS_PER_BAR, levels)
    if level is None:
        measured = ", ".join(f"{bar(level):g}" for level in levels) or "none"
        raise NotFoundError(f"no track at {pressure_bar:g} bar; the pressures of the first stationary test: {measured}")
    return level
