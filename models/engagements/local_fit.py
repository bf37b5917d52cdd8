"""The value of a noisy channel at a moment: a line or a parabola through the samples around it.

    y(t) = c_0 + c_1 (t - t_0) + c_2 (t - t_0)²,      value = c_0,      Var = s² f (XᵀX)⁻¹_00

The parabola's c_2 is kept where it is significant. s² is the residuals' variance and f = (1 + ρ)/(1 - ρ) the
factor by which first-order autoregressive noise makes a mean more uncertain, ρ the correlation of neighbouring samples.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.engagements.criteria import FEWEST_LOCAL

#: Windows into which a channel is cut to see how its noise is autocorrelated.
_WINDOWS = 8
#: Noise is taken for no more correlated than this. Chosen: a factor of 19, beyond which no window holds samples enough.
_MOST_CORRELATED = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A value with its standard error, in the value's unit."""

    value: float
    sd: float

    def over(self, other: "Estimate") -> "Estimate | None":
        """The ratio to another value, errors independent; None where that is not positive."""
        if other.value <= 0:
            return None
        ratio = self.value / other.value
        return Estimate(value=ratio, sd=math.hypot(self.sd, ratio * other.sd) / other.value)


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A channel over [low, high] s: time [n] s ascending, values [n]; `inflation` f >= 1 of its noise."""

    time: FloatArray
    values: FloatArray
    inflation: float

    @property
    def low(self) -> float:
        """The first time [s]."""
        return float(self.time[0])

    @property
    def high(self) -> float:
        """The last time [s]."""
        return float(self.time[-1])

    def at(self, moment: float, half_width: float) -> Estimate | None:
        """The value at a moment [s] within the channel, by the samples within `half_width` [s] or, at an end, within twice
        that. None where too few lie near."""
        centre = min(max(moment, self.low + half_width), self.high - half_width)
        distance = np.abs(self.time - centre)
        width = half_width
        if distance.size < FEWEST_LOCAL:
            return None
        width = max(width, float(np.partition(distance, FEWEST_LOCAL - 1)[FEWEST_LOCAL - 1]))
        if width > max(half_width, 0.25 * (self.high - self.low)):
            return None
        rows = distance <= width * (1 + 1e-9)
        return _fitted((self.time[rows] - moment) / width, self.values[rows], self.inflation)


def channel_of(time: FloatArray, values: FloatArray) -> Channel:
    """A channel whose noise is that of the residuals of parabolas through equal parts of it."""
    before, after = [np.zeros(0)], [np.zeros(0)]
    for at, part in zip(np.array_split(time, _WINDOWS), np.array_split(values, _WINDOWS), strict=True):
        if at.size >= FEWEST_LOCAL:
            residual = part - np.polynomial.Polynomial.fit(at, part, 2)(at)
            before.append(residual[:-1])
            after.append(residual[1:])
    first, second = np.concatenate(before), np.concatenate(after)
    power = float(first @ first)
    correlation = min(max(float(first @ second) / power, 0.0), _MOST_CORRELATED) if power > 0 else 0.0
    return Channel(time=time, values=values, inflation=(1 + correlation) / (1 - correlation))


def _fitted(moment: FloatArray, values: FloatArray, inflation: float) -> Estimate:
    """The value at 0 by a parabola through the samples at `moment` [n], or by a line where that serves."""
    design = np.stack([np.ones_like(moment), moment, moment**2], axis=1)
    estimate, curvature = _least_squares(design, values, inflation)
    if abs(curvature.value) > 2.0 * curvature.sd:
        return estimate
    return _least_squares(design[:, :2], values, inflation)[0]


def _least_squares(design: FloatArray, values: FloatArray, inflation: float) -> tuple[Estimate, Estimate]:
    """The first and the last coefficient."""
    inverse = np.linalg.pinv(design.T @ design)
    coefficients = inverse @ (design.T @ values)
    residual = values - design @ coefficients
    variance = float(residual @ residual) / (values.size - design.shape[1]) * inflation
    first, last = (
        Estimate(value=float(coefficients[i]), sd=math.sqrt(max(variance * float(inverse[i, i]), 0.0))) for i in (0, -1)
    )
    return first, last
