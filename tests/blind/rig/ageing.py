"""Hidden effects of use: running-in, fresh oil, late wear, severity. Forms of their own, not the catalogue's."""

import numpy as np

from models.arrays import FloatArray
from tests.blind.rig.clutch import Law
from tests.blind.rig.plan import Plan, Site
from tests.blind.rig.world import Effect


def running_in(rng: np.random.Generator, _: Plan) -> Effect:
    """Asperities bed in: M_s more (or less) when new, going as a stretched or as a double exponential of the cycles."""
    scale, sign = rng.uniform(250, 1200), rng.choice([-1.0, 1.0])
    if rng.random() < 0.5:
        order = rng.uniform(0.6, 0.9)

        def left(z: FloatArray) -> FloatArray:
            return np.exp(-((z / scale) ** order))
    else:
        share, later = rng.uniform(0.5, 0.8), rng.uniform(2.0, 4.0)

        def left(z: FloatArray) -> FloatArray:
            return share * np.exp(-z / scale) + (1 - share) * np.exp(-z / (later * scale))

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        rough = Law(law.static * (1 + sign * a * left(site.cycles)), law.ratio, law.stribeck, law.viscous)
        return rough.torque(site.v) - law.torque(site.v)

    return Effect("running_in", 0.05, 0.6, friction, moves_life=True)


def oil_change(rng: np.random.Generator, plan: Plan) -> Effect:
    """Fresh oil: C_v steps and comes part of the way back as the oil ages; the Coulomb ratio moves a little with it."""
    logged = [at for kind, at in plan.life.events if kind == "oil_change"]
    k = int(rng.integers(2, plan.life.cycles.size - 1))
    at = logged[0] if logged else 0.5 * (plan.life.cycles[k - 1] + plan.life.cycles[k])
    sign, back, stays = rng.choice([-1.0, 1.0]), rng.uniform(0.3, 0.8) * plan.life.span, rng.uniform(0.5, 0.9)
    boundary = rng.uniform(0.0, 0.06)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        since = np.maximum(site.cycles - at, 0.0)
        fresh = np.where(site.cycles >= at, stays + (1 - stays) * np.exp(-since / back), 0.0)
        viscous = law.viscous * (1 + sign * a * fresh)
        other = Law(law.static, law.ratio * (1 - sign * boundary * a * fresh), law.stribeck, viscous)
        return other.torque(site.v) - law.torque(site.v)

    return Effect("oil_change", 0.05, 0.7, friction, moves_life=True)


def accelerated_wear(rng: np.random.Generator, plan: Plan) -> Effect:
    """From some cycle on the lining goes faster: M_s falls with a softened corner, towards an end."""
    life = plan.life
    at = rng.uniform(0.45, 0.72) * life.span
    wide, order = rng.uniform(0.01, 0.05) * life.span, rng.uniform(1.0, 1.6)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        late = wide * np.logaddexp(0.0, (site.cycles - at) / wide) / (life.span - at)
        worn = Law(law.static * np.exp(-a * late**order), law.ratio, law.stribeck, law.viscous)
        return worn.torque(site.v) - law.torque(site.v)

    return Effect("accelerated_wear", 0.05, 1.2, friction, moves_life=True)


def load_severity(rng: np.random.Generator, _: Plan) -> Effect:
    """Cycles count for more the more energy each had: ζ grows by an Arrhenius-like factor of the energy."""
    bend = rng.uniform(-0.2, 0.2)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        blocks = np.diff(site.life.cycles, prepend=0.0)
        strain = site.life.energy / site.life.usual_energy - 1
        factor = np.exp(np.clip(a * (strain + bend * strain**2), -3, 3))
        zeta = np.cumsum(blocks * factor)[site.state][:, None]
        return law.later(zeta).torque(site.v) - law.torque(site.v)

    return Effect("load_severity", 0.3, 6.0, friction, moves_life=True)
