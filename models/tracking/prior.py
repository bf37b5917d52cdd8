"""The prior of eq. 6's coefficients, before a clutch has been measured.

Independent normals on ξ0, Δ, log φ, log ε and the logarithm of the run-to-run scatter, as plain numbers, so that a
prior learned from other clutches of the same material can take the place of the weak one; and the prior of what affects
measurements beyond scatter: how often a run is outlying and by how much, the probability that the clutch follows one
eq. 6 at all, and how far an event such as an oil change may shift the level.
"""

import math
from dataclasses import astuple, dataclass, fields

import numpy as np

from models.arrays import FloatArray
from models.tracking import criteria
from models.tracking.measurement import Measurement


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackPrior:
    """The prior of a track: means and deviations; ξ0, Δ and the scatter in the unit of the quantity, φ in cycles.

    `outlying_share` of the runs are off by a further normal of deviation `outlying_size`, `law_share` is the probability
    that there is no discrepancy beside eq. 6, `eq_6_share` that the course is that of eq. 6, `proportional_share` that the
    scatter is a share of the value (s then is that of a value of `size`), `step_size` the deviation of the level's shift at
    an event; both sizes are shares of `size`. `knee_hazard` is that of a knee per e-fold of progress (`discrepancy`).
    Raises ValueError where a number is not finite, a deviation or size not positive, a share not within [0, 1) or a hazard
    negative.
    """

    initial_mean: float
    initial_sd: float
    change_mean: float
    change_sd: float
    log_scale_mean: float
    log_scale_sd: float
    log_exponent_mean: float
    log_exponent_sd: float
    log_scatter_mean: float
    log_scatter_sd: float
    outlying_share: float = criteria.OUTLYING_SHARE
    outlying_size: float = criteria.OUTLYING_SIZE
    law_share: float = criteria.LAW_SHARE
    step_size: float = criteria.STEP_SIZE
    eq_6_share: float = 1.0
    proportional_share: float = 0.0
    knee_hazard: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            number = getattr(self, field.name)
            if not math.isfinite(number):
                raise ValueError(f"{field.name} must be finite, got {number}")
            if field.name.endswith(("_sd", "_size")) and number <= 0:
                raise ValueError(f"{field.name} must be positive, got {number}")
        for name in ("outlying_share", "proportional_share"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ValueError(f"{name} must lie within [0, 1), got {getattr(self, name)}")
        if self.knee_hazard < 0.0:
            raise ValueError(f"knee_hazard must not be negative, got {self.knee_hazard}")
        for name in ("law_share", "eq_6_share"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must lie within (0, 1], got {getattr(self, name)}")

    @property
    def size(self) -> float:
        """Size of the quantity, in its unit."""
        return max(abs(self.initial_mean), self.initial_sd)

    def relative_squared(self, value: FloatArray | float) -> FloatArray:
        """(value / size)² of any shape, at least 0.01: the factor on the variance of scatter that is a share of it. Where a
        measured value stands in for the true one, it is too large by the scatter squared on average."""
        return np.maximum(np.square(np.asarray(value) / self.size), 0.01)  # values may cross zero

    def to_array(self) -> FloatArray:
        """The numbers in the order of the fields [17]."""
        return np.array(astuple(self), dtype=np.float64)

    @classmethod
    def from_array(cls, numbers: FloatArray) -> "TrackPrior":
        """The inverse of `to_array`."""
        return cls(**{field.name: float(x) for field, x in zip(fields(cls), numbers, strict=True)})

    def log_density(
        self, log_scale: FloatArray | float, log_exponent: FloatArray | float, log_scatter: FloatArray | float
    ) -> FloatArray:
        """Log density of (log φ, log ε, log s), broadcast, without its constant."""
        return np.asarray(
            -0.5
            * (
                ((log_scale - self.log_scale_mean) / self.log_scale_sd) ** 2
                + ((log_exponent - self.log_exponent_mean) / self.log_exponent_sd) ** 2
                + ((log_scatter - self.log_scatter_mean) / self.log_scatter_sd) ** 2
            )
        )


def weak(first: Measurement, *, falling: bool) -> TrackPrior:
    """A weak prior: little more than the size of the quantity, taken from its first measurement.

    With the size a = √(value² + variance): ξ0 is within some 50 % of a, for the first run need not be at ζ = 0. The
    change Δ is -0.6 a ± 0.4 a where the quantity is known to be `falling` (mean COF; 7 % remains for a rise) and 0 ±
    a otherwise (Stribeck parameters). φ has its median at 4,000 cycles and two deviations cover 40 to 400,000, ε its
    median at 0.8, covering 0.2 to 3.2: together, lives of 10² to 10⁶ cycles. The scatter has its median at 0.3 % of
    a, two deviations covering 0.06 % to 1.5 %.
    """
    size = math.hypot(first.value, math.sqrt(first.variance)) or 1.0
    change_mean, change_sd = (-0.6, 0.4) if falling else (0.0, 1.0)
    return TrackPrior(
        initial_mean=first.value,
        initial_sd=0.5 * size,
        change_mean=change_mean * size,
        change_sd=change_sd * size,
        log_scale_mean=math.log(4_000.0),
        log_scale_sd=2.3,
        log_exponent_mean=math.log(0.8),
        log_exponent_sd=0.7,
        log_scatter_mean=math.log(0.003 * size),
        log_scatter_sd=0.8,
        eq_6_share=criteria.EQ_6_SHARE if falling else 1.0,
        proportional_share=criteria.PROPORTIONAL_SHARE if falling else 0.0,
        knee_hazard=criteria.KNEE_HAZARD if falling else 0.0,
    )
