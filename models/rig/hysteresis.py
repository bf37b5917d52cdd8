"""How the simulated clutch's friction lags its speed: by a squeezed film, an attractor, or both.

The film time τ_1 of `models.loops.lag_laws` is largest when new and falls with use, the more the higher the pressure,

    τ_1(p, ζ) = τ_0 e^{-λ(p) g(ζ)},    λ(p) = max(α + β p, 0),    g(ζ) = 1 - (1 + ζ/φ)^-ε

as a lining does that loses its pores: at high pressure its film no longer lags. The loop area goes with τ_1 and with the
slope of the stationary curve, which steepens as the curve sinks. The nominal values are chosen so that both together
show figs. 14 and 17: areas nearly proportional to pressure when new, growing over life up to 6 bar, falling above, and
in the end falling with pressure. The attractor C, where there is one, adds the difference of its torque from the
stationary one: exact to the first order in both lags. Alone it gives loops of the wrong sign where curves rise (see
`models.loops.lag_laws`).

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, eq. 7 and section 3.2. The formulas of λ and g are this
project's: the reference prints none.
"""

from dataclasses import dataclass, field

import numpy as np

from models.arrays import FloatArray, require_finite
from models.degradation.general_order import progress_fraction
from models.friction.pressure_laws import LinearPressureLaw
from models.friction.stribeck import StribeckParameters, torque
from models.loops.lag_laws import attractor_torque, squeeze_film_torque

#: The attractor C [Nm/s] of a rig that shows both laws at once. Chosen among 100, 150, 200, 300 and 400: at 150 either law
#: describes some loops better, C is determined in 85 % of them (in 45 % by a film alone), the film time in all but one of a
#: hundred, and no area is negative, as one is at 100. What is lost is that areas are proportional to pressure when new.
ATTRACTOR = 150.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionLag:
    """The simulated clutch's friction lag: `film_time` τ_0 >= 0 [s] (0: no film), its `loss` λ over pressure [-], with
    the course's `scale` φ > 0 [cycles] and `exponent` ε > 0 [-]; `attractor` C > 0 [Nm/s], None: none. Raises
    ValueError on values outside."""

    film_time: float = 0.1
    loss: LinearPressureLaw = field(default_factory=lambda: LinearPressureLaw(intercept=-2.75, slope=0.7e-5))
    scale: float = 10_000.0
    exponent: float = 2.0
    attractor: float | None = None

    def __post_init__(self) -> None:
        require_finite(self, ("film_time",))
        require_finite(self, ("scale", "exponent", "attractor"), positive=True)

    def film_time_at(self, pressure: FloatArray, cycles: float) -> FloatArray:
        """Film time τ_1 [...] s at pressure [...] Pa after cycles >= 0."""
        lost = np.maximum(self.loss(pressure), 0.0) * progress_fraction(cycles, self.scale, self.exponent)
        return np.asarray(self.film_time * np.exp(-lost), dtype=np.float64)

    def torque(
        self, time: FloatArray, velocity: FloatArray, pressure: FloatArray, curve: StribeckParameters, cycles: float
    ) -> FloatArray:
        """Torque [n] Nm at time [n] s (ascending), velocity [n] m/s and pressure [n] Pa; `curve` holds at each sample.

        At the first sample the film is that of its velocity at rest.
        """
        stationary = torque(velocity, curve)
        lagging = stationary
        if self.film_time > 0:
            lagging = squeeze_film_torque(time, velocity, curve, self.film_time_at(pressure, cycles))
        if self.attractor is not None:
            lagging = lagging + attractor_torque(time, velocity, curve, self.attractor) - stationary
        return lagging


NO_LAG = FrictionLag(film_time=0.0)
