"""The simulated clutch: what a rig would measure without noise. Everything here is simulated, nothing was measured.

Stribeck curve of eq. 3, its parameters over pressure in the shapes of fig. 9,

    M_s, V_S, C_v = α + β p          M̄_c = c_∞ + a e^{-p/p_0}

and each of them over life multiplied by its own eq. 6 with ξ0 = 1, so that Δ is a share of the fresh value. How torque
lags that curve while speed changes is in `models.rig.hysteresis`.

The reference's figures give no legible numbers, so the nominal ones are chosen: 25 Nm fresh at 5 bar and 1000 rpm, the
signs and shapes of figs. 6, 7, 9 and 10, and a mean coefficient of friction (COF) halved near 15,000 duty cycles.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, eqs. 2, 3 and 6, sections 2.3.3 and 3.1.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import brentq

from models.arrays import FloatArray
from models.clutch import Geometry
from models.degradation.general_order import DegradationLaw, value
from models.engagements.simulation import Capacity
from models.friction.pressure_laws import AsymptoticPressureLaw, LinearPressureLaw
from models.friction.speed_protocol import REFERENCE_SPEEDS
from models.friction.stribeck import StribeckParameters, torque
from models.rig.hysteresis import FrictionLag

#: The protocol's pressures (section 2.3.3): 4 to 7 bar by 0.5 bar [7] Pa; its 40 speeds are REFERENCE_SPEEDS.
PROTOCOL_PRESSURES: FloatArray = np.linspace(4.0e5, 7.0e5, 7)

#: An open clutch is pressed by this [Pa], which transfers nothing that a recorder would see.
OPEN = 1.0


def _share(change: float, scale: float, exponent: float) -> DegradationLaw:
    """A course of eq. 6 that begins at 1."""
    return DegradationLaw(initial=1.0, change=change, scale=scale, exponent=exponent)


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedClutch:
    """A clutch that exists only here: four pressure laws when fresh, and four courses of eq. 6 that multiply them.

    The defaults are the nominal clutch; `draw` makes others around it. Courses are dimensionless (initial = 1), their
    abscissa is duty cycles. The laws are meant for 4 to 8 bar; below, torque goes with pressure.
    """

    geometry: Geometry = field(default_factory=Geometry)
    static_torque: LinearPressureLaw = field(default_factory=lambda: LinearPressureLaw(intercept=1.0, slope=4.8e-5))
    coulomb_ratio: AsymptoticPressureLaw = field(
        default_factory=lambda: AsymptoticPressureLaw(asymptote=0.60, excess=4.2, decay=1.62e5)
    )
    stribeck_velocity: LinearPressureLaw = field(
        default_factory=lambda: LinearPressureLaw(intercept=0.2, slope=0.96e-5)
    )
    viscous_coefficient: LinearPressureLaw = field(
        default_factory=lambda: LinearPressureLaw(intercept=0.1, slope=0.24e-5)
    )
    static_torque_course: DegradationLaw = field(default_factory=lambda: _share(-0.66, 3700.0, 0.55))
    coulomb_ratio_course: DegradationLaw = field(default_factory=lambda: _share(-0.56, 4000.0, 0.80))
    stribeck_velocity_course: DegradationLaw = field(default_factory=lambda: _share(-0.94, 2200.0, 1.00))
    viscous_coefficient_course: DegradationLaw = field(default_factory=lambda: _share(1.00, 6500.0, 0.90))
    lag: FrictionLag = field(default_factory=FrictionLag)

    def parameters(self, pressure: float | FloatArray, cycles: float | FloatArray) -> StribeckParameters:
        """The true parameters at pressure > 0 [Pa] after cycles >= 0; arrays broadcast. Raises ValueError outside.

        Below the protocol's lowest pressure they are those there, with both torques in proportion to pressure."""
        pressures, zeta = np.asarray(pressure, dtype=np.float64), np.asarray(cycles, dtype=np.float64)
        if not (np.isfinite(pressures).all() and (pressures > 0).all()):
            raise ValueError(f"pressure must be finite and positive, got {pressure}")
        if not (np.isfinite(zeta).all() and (zeta >= 0).all()):
            raise ValueError(f"cycles must be finite and not negative, got {cycles}")
        p = np.maximum(pressures, PROTOCOL_PRESSURES[0])
        share = pressures / p
        return StribeckParameters(
            static_torque=share * self.static_torque(p) * value(zeta, self.static_torque_course),
            coulomb_ratio=self.coulomb_ratio(p) * value(zeta, self.coulomb_ratio_course),
            stribeck_velocity=self.stribeck_velocity(p) * value(zeta, self.stribeck_velocity_course),
            viscous_coefficient=share * self.viscous_coefficient(p) * value(zeta, self.viscous_coefficient_course),
        )

    def moving_torque(self, time: FloatArray, velocity: FloatArray, pressure: FloatArray, cycles: float) -> FloatArray:
        """True torque [n] Nm, including its lag, at time [n] s (ascending), velocity [n] m/s and pressure [n] > 0 Pa."""
        return self.lag.torque(time, velocity, pressure, self.parameters(pressure, cycles), cycles)

    def capacity(self, cycles: float) -> Capacity:
        """The clutch's torque capacity [Nm] after cycles >= 0, as a function of pressure and velocity."""

        def transferred(pressure: float, velocity: float) -> float:
            at = self.parameters(max(pressure, OPEN), cycles)
            return float(torque(np.array(velocity), at))

        return transferred

    def mean_cofs(self, cycles: FloatArray) -> FloatArray:
        """True mean COF [m] after cycles [m]: the mean over the protocol's 7 pressures and 40 speeds."""
        pressures = PROTOCOL_PRESSURES[:, np.newaxis]
        at = self.parameters(pressures, np.asarray(cycles, dtype=np.float64)[:, np.newaxis, np.newaxis])
        torques = torque(self.geometry.sliding_velocity(REFERENCE_SPEEDS), at)
        unit = np.array([self.geometry.torque_per_cof(float(p)) for p in PROTOCOL_PRESSURES])
        return np.asarray((torques / unit[:, np.newaxis]).mean(axis=(1, 2)), dtype=np.float64)

    def mean_cof(self, cycles: float) -> float:
        """True mean COF [-] after cycles >= 0."""
        return float(self.mean_cofs(np.array([cycles]))[0])

    def end_of_life(self, fraction: float = 0.5) -> float | None:
        """Duty cycles at which mean COF first is `fraction` of its initial value, by root finding.

        None where it never is within a million cycles: eq. 6 saturates. Raises ValueError unless 0 < fraction < 1.
        """
        if not 0 < fraction < 1:
            raise ValueError(f"fraction must lie between 0 and 1, got {fraction}")
        threshold = fraction * self.mean_cof(0.0)
        places = np.concatenate([[0.0], np.geomspace(1.0, 1e6, 240)])
        below = np.flatnonzero(self.mean_cofs(places) - threshold <= 0)
        if below.size == 0:
            return None
        low, high = places[below[0] - 1], places[below[0]]
        return float(brentq(lambda zeta: self.mean_cof(zeta) - threshold, low, high, xtol=1e-6))


def draw(rng: np.random.Generator) -> SimulatedClutch:
    """A simulated clutch around the nominal one, as clutches of one batch differ: log-normal factors of 5 to 15 %.

    A pressure law scales as a whole, and so do the four ageing rates (a hard or a soft lining), each with a little of
    its own. The Coulomb ratio stays below 1 from 4 bar on: sliding grips less than rest. The shares lost in the end are
    spread least (4 %), for they decide whether a clutch ever fails.
    """
    nominal = SimulatedClutch()

    def factor(deviation: float) -> float:
        return math.exp(deviation * float(rng.standard_normal()))

    def scaled(law: LinearPressureLaw, deviation: float) -> LinearPressureLaw:
        by = factor(deviation)
        return LinearPressureLaw(intercept=law.intercept * by, slope=law.slope * by)

    rate = factor(0.15)

    def course(of: DegradationLaw) -> DegradationLaw:
        change = max(float(of.change) * factor(0.04), -0.99)  # a share that stays above nothing
        return _share(change, float(of.scale) * rate * factor(0.08), float(of.exponent) * factor(0.05))

    def ratio(law: AsymptoticPressureLaw) -> AsymptoticPressureLaw:
        floor = law.asymptote * factor(0.05)
        most = (0.995 - floor) * math.exp(float(PROTOCOL_PRESSURES[0]) / law.decay)
        return AsymptoticPressureLaw(asymptote=floor, excess=min(law.excess * factor(0.05), most), decay=law.decay)

    return SimulatedClutch(
        static_torque=scaled(nominal.static_torque, 0.08),
        coulomb_ratio=ratio(nominal.coulomb_ratio),
        stribeck_velocity=scaled(nominal.stribeck_velocity, 0.12),
        viscous_coefficient=scaled(nominal.viscous_coefficient, 0.12),
        static_torque_course=course(nominal.static_torque_course),
        coulomb_ratio_course=course(nominal.coulomb_ratio_course),
        stribeck_velocity_course=course(nominal.stribeck_velocity_course),
        viscous_coefficient_course=course(nominal.viscous_coefficient_course),
        lag=replace(nominal.lag, film_time=nominal.lag.film_time * factor(0.10), scale=nominal.lag.scale * rate),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """A surface profile's arithmetic mean roughness R_a > 0 [m] and the skewness R_sk [-] of its heights."""

    roughness: float
    skewness: float


#: The lining before and after the reference's tests.
FRESH, WORN = Surface(roughness=9.52e-6, skewness=-0.87), Surface(roughness=1.94e-6, skewness=-3.4)


def surface(clutch: SimulatedClutch, wear: float) -> Surface:
    """Simulated surface profile along the sliding direction after wear ζ >= 0 [duty cycles]; ValueError on another.

        R(ζ) = R_fresh + s(ζ) (R_worn - R_fresh),    s(ζ) = min(1, (1 - μ(ζ)/μ(0)) / 0.5)

    for R_a and R_sk alike, with the mean COF μ. The reference measured both ends (section 3, figs. 4 and 5), each the
    average of eight radial places of one wafer block. It says nothing of the states between, and nothing of other clutches:
    that the surface goes with the loss of COF and is the reference's worn one where half of it is lost is assumed here. It
    prints no scatter of its averages: none is added.
    """
    share = min(1.0, (1.0 - clutch.mean_cof(wear) / clutch.mean_cof(0.0)) / 0.5)
    return Surface(
        roughness=FRESH.roughness + share * (WORN.roughness - FRESH.roughness),
        skewness=FRESH.skewness + share * (WORN.skewness - FRESH.skewness),
    )
