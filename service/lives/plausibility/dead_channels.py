"""Channels that are dead: unplugged, railed, frozen. Said of a run by itself, whatever the history."""

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.records.criteria import UNLOADED
from service.columns import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS
from service.errors import Notice
from service.lives.history import DYNAMIC, STATIONARY
from service.lives.plausibility import criteria
from service.lives.plausibility.reading import Columns

DEAD = "dead_channel"


def dead_channels(kind: str, columns: Columns, geometry: Geometry) -> list[Notice]:
    """What is odd about the channels of a run."""
    doubts = list(_oil(columns.oil_temperature))
    pressed = columns.pressure >= UNLOADED
    if columns.torque.size < criteria.FEWEST_ROWS:
        return doubts
    if kind == DYNAMIC:
        doubts += _speed_stands(columns.speed)
    if not pressed.any():
        return doubts
    torque = columns.torque[pressed]
    rows = columns.loaded()
    if torque.size >= criteria.FEWEST_ROWS and _spread(torque) <= criteria.STILL * float(np.abs(np.median(torque))):
        level = float(np.median(torque))
        message = f"torque stands still at {level:.4g} Nm whatever pressure and speed do: is the sensor connected?"
        return [*doubts, Notice(code=DEAD, message=message)]
    if rows.torque.size < criteria.FEWEST_ROWS:
        return doubts
    cof = float(np.abs(rows.cof_by_speed(geometry)[0]).mean())
    if cof < criteria.NO_FRICTION and float(rows.torque.std()) > 0.5 * float(np.abs(rows.torque.mean())):
        message = (
            f"torque is noise about zero ({rows.torque.mean():.3g} ± {rows.torque.std():.3g} Nm) under pressure: is the "
            "sensor connected?"
        )
        return [*doubts, Notice(code=DEAD, message=message)]
    if kind in (STATIONARY, DYNAMIC):
        doubts += _not_following(rows, geometry)
    return doubts


def _not_following(rows: Columns, geometry: Geometry) -> list[Notice]:
    """Torque that does not go with pressure, or scatters at one pressure as if that had varied."""
    low, high = np.quantile(rows.pressure, [0.02, 0.98]).tolist()
    span = f"{low / PASCALS_PER_BAR:.3g} to {high / PASCALS_PER_BAR:.3g} bar"
    if high > criteria.PRESSURE_SPAN * low:
        exponent, error = _exponent(rows)
        if exponent + 3 * error < criteria.LEAST_EXPONENT:
            message = (
                f"torque does not follow pressure: it goes with pressure to the power of {exponent:.2f} from {span}, about "
                "1 is expected. Is a sensor disconnected, or does a column hold another channel?"
            )
            return [Notice(code=DEAD, message=message)]
        return []
    cofs, spreads = rows.cof_by_speed(geometry)
    scatter = float(np.median(spreads / np.maximum(np.abs(cofs), 1e-12)))
    if scatter > criteria.SINGLE_LEVEL_SPREAD:
        message = (
            f"pressure stands at {high / PASCALS_PER_BAR:.3g} bar and torque at one speed scatters by {100 * scatter:.0f} "
            "%, as if pressure had varied: is its sensor connected?"
        )
        return [Notice(code=DEAD, message=message)]
    return []


def _exponent(rows: Columns) -> tuple[float, float]:
    """The exponent of |torque| over pressure by least squares, and its standard error."""
    x, y = np.log(rows.pressure), np.log(np.maximum(np.abs(rows.torque), 1e-9))
    x, y = x - x.mean(), y - y.mean()
    square = float(x @ x)
    exponent = float(x @ y) / square
    left = y - exponent * x
    # neighbouring rows are alike: a sampled record has far fewer independent ones
    independent = min(x.size, 40)
    return exponent, float(np.sqrt(left @ left / x.size * x.size / (square * independent)))


def _speed_stands(speed: FloatArray) -> list[Notice]:
    fastest = float(np.abs(speed).max())
    if fastest > 1.0 and _spread(speed) > criteria.SPEED_STILL * fastest:
        return []
    rpm = float(np.median(speed)) / RADIANS_PER_SECOND_PER_RPM
    message = f"speed stands still at {rpm:.4g} rpm in a dynamic test: is its sensor connected?"
    return [Notice(code=DEAD, message=message)]


def _oil(temperature: FloatArray | None) -> list[Notice]:
    if temperature is None:
        return []
    median = float(np.median(temperature))
    still_at_zero = temperature.size >= criteria.FEWEST_ROWS and bool((np.abs(temperature - ZERO_CELSIUS) < 1e-6).all())
    if criteria.COLDEST <= median <= criteria.HOTTEST and not still_at_zero:
        return []
    message = f"oil temperature is {median - ZERO_CELSIUS:.4g} °C, which no oil has in a test: is the sensor connected?"
    return [Notice(code=DEAD, message=message)]


def _spread(values: FloatArray) -> float:
    low, high = np.quantile(values, [0.05, 0.95]).tolist()
    return float(high - low)
