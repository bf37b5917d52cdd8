"""Mean torque of measured points over a protocol's velocities, without a law of friction.

It stands in for the mean of a fitted curve where that has no static torque to speak of: of a clutch whose friction rises
from zero, or of one that was not measured at the speeds that determine it.
"""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredCurve:
    """A measured friction curve of one pressure level, folded to v >= 0: velocity [n] m/s, ascending, torque [n] Nm and
    the number of rows averaged in each, count [n]; `noise` [Nm], the deviation of a row."""

    velocity: FloatArray
    torque: FloatArray
    count: FloatArray
    noise: float

    @classmethod
    def of(cls, velocity: FloatArray, torque: FloatArray, noise: float, most: int = 200) -> "MeasuredCurve":
        """The curve of rows at velocity [m] m/s of either sign: equal speeds are averaged, and neighbouring ones until no
        more than `most` are left."""
        speed = np.abs(velocity)
        distinct, group = np.unique(speed, return_inverse=True)
        group = group * min(most, distinct.size) // distinct.size
        count = np.bincount(group).astype(np.float64)
        return cls(
            velocity=np.bincount(group, weights=speed) / count,
            torque=np.bincount(group, weights=np.copysign(1.0, velocity) * torque) / count,
            count=count,
            noise=noise,
        )

    def columns(self) -> FloatArray:
        """Velocity, torque and count [3, n]."""
        return np.stack([self.velocity, self.torque, self.count])

    @classmethod
    def of_columns(cls, columns: FloatArray, noise: float) -> "MeasuredCurve":
        """The inverse of `columns`."""
        return cls(velocity=columns[0], torque=columns[1], count=columns[2], noise=noise)

    def mean(self, velocities: FloatArray, raised: FloatArray | float = 1.0) -> tuple[float, float]:
        """Mean torque over velocities [m] m/s and its standard deviation [Nm], by linear interpolation between points
        and constant beyond the ends; `raised` [m] is the ratio of friction to these points' [-].

        The mean is Σ w_i T_i. Its variance is Σ w_i² noise²/count_i; where a share of the velocities lies beyond the ends,
        that share of the points' range is added to the deviation, for nothing was measured there."""
        places = np.abs(velocities)
        corners = np.eye(self.velocity.size)
        reach = np.stack([np.interp(places, self.velocity, corner) for corner in corners], axis=1)
        weight = (reach * np.broadcast_to(raised, places.shape)[:, None]).mean(axis=0)
        beyond = float(((places < self.velocity[0]) | (places > self.velocity[-1])).mean())
        sd = self.noise * float(np.sqrt((weight**2 / self.count).sum())) + beyond * float(np.ptp(self.torque))
        return float(weight @ self.torque), sd
