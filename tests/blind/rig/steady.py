"""Hidden effects that a stationary test sees: heat, oil, zero, gauge and the dwell. Forms of their own, not the catalogue's.

Every maker draws a shape and returns the effect; amplitudes are set by loudness later.
"""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from models.arrays import FloatArray
from tests.blind.rig.clutch import Law
from tests.blind.rig.plan import DWELL, Plan, Site
from tests.blind.rig.world import TESTS, Effect


def lagged(x: FloatArray, step: float, time: float) -> FloatArray:
    """x [series, n] through a first-order lag of `time` s, settled at the start."""
    keep = np.exp(-step / time)
    return lfilter([1 - keep], [1, -keep], x, axis=1, zi=keep * x[:, :1])[0]


def vogel(rng: np.random.Generator) -> "Vogel":
    return Vogel(float(rng.uniform(-115.0, -75.0)))


class Vogel:
    """ν(T) of the ATF through its two points, after Vogel: ln ν = A + B/(T - T0), relative to 85 °C."""

    def __init__(self, pole: float) -> None:
        self.pole = pole
        self.slope = np.log(56 / 9.3) / (1 / (40 - pole) - 1 / (100 - pole))

    def __call__(self, celsius: FloatArray) -> FloatArray:
        return np.exp(self.slope * (1 / (celsius - self.pole) - 1 / (85 - self.pole)))


def oil_temperature(rng: np.random.Generator, _: Plan) -> Effect:
    """Viscous torque with the viscosity of a film that follows the oil late; the Stribeck velocity goes the other way."""
    nu, late, second = vogel(rng), rng.uniform(4.0, 30.0), rng.uniform(0.0, 0.5)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        thick = nu(lagged(site.oil, site.step, late)) ** a
        warm = Law(law.static, law.ratio, law.stribeck / thick**second, law.viscous * thick)
        return warm.torque(site.v) - law.torque(site.v)

    return Effect("oil_temperature", 0.3, 4.0, friction)


def interface_heating(rng: np.random.Generator, _: Plan) -> Effect:
    """Sliding power warms the lining's face within milliseconds; warm friction is less, and less so the warmer it is."""
    late, most = rng.uniform(0.01, 0.05), rng.uniform(1.0, 3.0)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        torque = law.torque(site.v)
        power = lagged(torque * site.v / 150.0, site.step, late)
        return -torque * -np.expm1(-a * power / most) * most / (1 + a)

    return Effect("interface_heating", 0.05, 1.0, friction)


def viscous_exponent(rng: np.random.Generator, _: Plan) -> Effect:
    """The film thins with shear (Carreau): C_v v^0.3 (1 + (v/v_c)²)^a, either sign."""
    sign, knee = rng.choice([-1.0, 1.0]), rng.uniform(0.4, 1.2)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        return law.viscous * site.v**0.3 * ((1 + (site.v / knee) ** 2) ** (sign * a / 2) - 1)

    return Effect("viscous_exponent", 0.05, 0.6, friction)


def hydrodynamic_drag(rng: np.random.Generator, _: Plan) -> Effect:
    """Oil sheared in the grooves whatever the pressure: a little less than linear in speed, with Vogel's viscosity."""
    nu, full = vogel(rng), rng.uniform(80.0, 300.0)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        return a * nu(site.oil) * site.v / (1 + site.v / full) + 0 * law.static

    return Effect("hydrodynamic_drag", 0.05, 4.0, friction)


def torque_zero_shift(rng: np.random.Generator, plan: Plan) -> Effect:
    """The zero wanders over the days as a smoothed random walk with a trend, or jumps within a few cycles and stays."""
    life = plan.life
    if rng.random() < 0.5:
        days = np.linspace(life.moment[0], life.moment[-1] + 3000, 400)
        walk = gaussian_filter1d(np.cumsum(rng.standard_normal(400)) / 20, 40) + rng.uniform(1.5, 3) * np.linspace(
            0, 1, 400
        )
        walk -= walk[0]
        walk /= np.abs(walk).max() * rng.choice([-1.0, 1.0])

        def zero(site: Site) -> FloatArray:
            return np.interp(site.life.moment[site.state][:, None] + site.clock, days, walk)
    else:
        k = int(rng.integers(1, life.cycles.size))
        at, wide = 0.5 * (life.cycles[k - 1] + life.cycles[k]), 0.05 * (life.cycles[k] - life.cycles[k - 1])
        sign = rng.choice([-1.0, 1.0])

        def zero(site: Site) -> FloatArray:
            return sign * 0.5 * (1 + np.tanh((site.cycles - at) / wide)) * np.ones_like(site.bar)

    return Effect("torque_zero_shift", 0.1, 10.0, reading=lambda a, site, _: a * zero(site))


def pressure_offset(rng: np.random.Generator, plan: Plan) -> Effect:
    """The gauge reads wrong by more and more bar: the clutch is pressed by what it says and the offset."""
    sign, order = rng.choice([-1.0, 1.0]), rng.uniform(0.7, 1.5)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        wrong = sign * a * (site.cycles / plan.life.span) ** order
        return law.at(site.bar + wrong).torque(site.v) - law.torque(site.v)

    return Effect("pressure_offset", 0.05, 1.5, friction)


def unsettled_dwell(rng: np.random.Generator, _: Plan) -> Effect:
    """Torque creeps to a new level with two time constants, so that a plateau still carries a share of the one before it."""
    fast, slow, share = rng.uniform(0.8, 2.0), rng.uniform(2.5, 5.0), rng.uniform(0.3, 0.7)

    def left(torque: FloatArray, step: float, a: float) -> FloatArray:
        return a * (share * lagged(torque, step, fast) + (1 - share) * lagged(torque, step, slow) - torque)

    def reading(a: float, site: Site, torque: FloatArray) -> FloatArray:
        if site.kind == "raw":
            return left(torque, site.step, a)
        fine = np.repeat(torque, 20, axis=1)
        change = left(fine, DWELL / 20, a).reshape(*torque.shape, 20)
        return change[..., 8:].mean(axis=-1)

    return Effect("unsettled_dwell", 0.3, 6.0, reading=reading, at=TESTS)


def rest_recovery(rng: np.random.Generator, plan: Plan) -> Effect:
    """A rested lining grips differently: ever more with the pause (saturating in its logarithm), gone in the test. What
    grips is all of friction, or the asperities alone."""
    hours = rng.uniform(0.5, 3.0)
    longest = np.log1p(plan.life.pause.max() / 3600 / hours)
    gone, sign, order = rng.uniform(120, 700), rng.choice([-1.0, 1.0]), rng.uniform(0.7, 1.0)
    as_a_whole = float(rng.random() < 0.5)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        late = site.clock + (DWELL * 250 if site.kind == "loop" else 0.0)  # loops come after the stationary test
        rested = np.log1p(site.life.pause[site.state][:, None] / 3600 / hours) / longest
        gripping = replace(law, viscous=as_a_whole * law.viscous).torque(site.v)
        return sign * a * rested * np.exp(-((late / gone) ** order)) * gripping

    return Effect("rest_recovery", 0.02, 0.5, friction)
