"""How the shaft comes to rest at the end of slip: ω(t) = b + Σ a_k g^k, g = max(0, t_end - t).

Fitted from half the speed on. b is what the sensor reads at standstill. The powers k go up to 2, or to 4 where the shaft
creeps to rest.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from models.arrays import FloatArray
from models.engagements import criteria
from models.engagements.local_fit import Estimate
from models.engagements.refusal import Refusal, SlipStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class Standstill:
    """The shaft's way to rest: the first fast row, the last one, and the first at which it stands; the end of slip, the
    speed that is read at standstill [rad/s], and when the shaft turns again [s]."""

    fast: int
    slowing: int
    rest: int
    end: Estimate
    zero: float
    again: float | None


def standstill_of(time: FloatArray, speed: FloatArray) -> Standstill | Refusal:
    """How a shaft of time [n] s and speed [n] rad/s comes to rest, the first time that it does; or why it does not."""
    from scipy.ndimage import median_filter  # start-up time: what answers cuts no record

    smooth = median_filter(speed, 5, mode="nearest")
    highest = float(smooth.max())
    if highest < criteria.LEAST_SPEED:
        rule = f"the shaft must slip, the highest speed is {highest:.3g} rad/s, below {criteria.LEAST_SPEED:g} rad/s"
        return Refusal(status=SlipStatus.NO_SLIP, message=rule)
    fast, slow = smooth >= 0.5 * highest, smooth <= criteria.SLOW * highest
    first = int(np.argmax(fast))
    rest = first + int(np.argmax(slow[first:]))
    if not slow[rest]:
        least = 100 * float(smooth[first:].min()) / highest
        return _never_ends(f"the lowest speed is {least:.3g} % of the highest")
    slowing = int(np.flatnonzero(fast[:rest])[-1])
    turning = np.flatnonzero(smooth[rest:] > 2 * criteria.SLOW * highest)
    leaves = rest + int(turning[0]) if turning.size else time.size
    window = slice(slowing, min(leaves, rest + 2 * (rest - slowing) + 5))
    latest = min(2 * rest - slowing + 2, leaves - 1)
    end, zero = _rest(time[window], speed[window], float(time[slowing]), float(time[latest]))
    if abs(zero) > criteria.LARGEST_ZERO * highest:
        return _never_ends(f"speed stays at {100 * zero / highest:.3g} % of the highest")
    again = None
    if turning.size:
        still = np.flatnonzero(speed[rest:leaves] - zero <= criteria.LARGEST_ZERO * highest)
        again = float(time[rest + (int(still[-1]) if still.size else 0)])
    return Standstill(fast=first, slowing=slowing, rest=rest, end=end, zero=zero, again=again)


def _never_ends(reason: str) -> Refusal:
    stands = 100 * criteria.LARGEST_ZERO
    rule = f"slip must end in the record: {reason}; a shaft stands within {stands:g} % of its highest speed"
    return Refusal(status=SlipStatus.SLIP_NEVER_ENDS, message=rule)


def _rest(time: FloatArray, speed: FloatArray, earliest: float, latest: float) -> tuple[Estimate, float]:
    """The end of slip and the speed at standstill; 0 where the record holds no standstill to show it.

    The power of g rises from 2 for as long as that explains more than chance would.
    """
    rest = _rest_of(2, time, speed, earliest, latest)
    # a shaft that its drive almost keeps turning creeps to rest, and a parabola places that 3 % too early
    for power in range(3, 4 + 1):
        better = _rest_of(power, time, speed, earliest, latest)
        if (
            better.freedom < criteria.FEWEST_SLIPPING
            or rest.misfit - better.misfit < 3.0**2 * better.misfit / better.freedom
        ):
            break
        rest = better
    return rest.end, rest.zero


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rest:
    """A fit of the shaft's way to rest: its sum of squares and degrees of freedom."""

    end: Estimate
    zero: float
    misfit: float
    freedom: int


def _rest_of(power: int, time: FloatArray, speed: FloatArray, earliest: float, latest: float) -> _Rest:
    span = latest - earliest

    def design(end: float) -> FloatArray:
        left = np.maximum(end - time, 0.0) / span
        columns = [left**exponent for exponent in range(1, power + 1)]
        return np.stack([np.ones_like(time), *columns] if np.count_nonzero(time > end) > 2 else columns, axis=1)

    def misfit(end: float) -> float:
        rows = design(end)
        return float(np.sum((speed - rows @ np.linalg.lstsq(rows, speed)[0]) ** 2))

    trials = np.linspace(earliest, latest, 42)[1:]
    best = int(np.argmin([misfit(end) for end in trials.tolist()]))
    low, high = trials[max(best - 1, 0)], trials[min(best + 1, trials.size - 1)]
    end = float(minimize_scalar(misfit, bounds=(low, high), method="bounded", options={"xatol": 1e-7}).x)
    rows = design(end)
    coefficients = np.linalg.lstsq(rows, speed)[0]
    polynomial = np.polynomial.Polynomial([0.0, *coefficients[-power:].tolist()]).deriv()
    slope = np.where(time < end, polynomial((end - time) / span) / span, 0.0)
    jacobian = np.column_stack([rows, slope])
    freedom = max(time.size - jacobian.shape[1], 1)
    variance = misfit(end) / freedom * float(np.linalg.pinv(jacobian.T @ jacobian)[-1, -1])
    return _Rest(
        end=Estimate(value=end, sd=math.sqrt(max(variance, 0.0))),
        zero=float(coefficients[0]) if rows.shape[1] > power else 0.0,
        misfit=misfit(end),
        freedom=freedom,
    )
