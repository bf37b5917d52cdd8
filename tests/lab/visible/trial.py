"""One trial: an effect hidden at twice the amplitude that a report calls visible, in the blind rig's form of it.

A campaign in which nothing is hidden says from which amplitude on it would show an effect. The same plan, clutch and sensor
measure once more with the rig's own form of that effect at twice the amplitude. Amplitudes beyond what makes sense on a rig
are not tried.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from models.diagnosis.campaign import Campaign
from models.diagnosis.criteria import LIKELY
from models.diagnosis.design.design import build_design
from models.diagnosis.effects.thermal import REFERENCE_FLUX
from models.diagnosis.explanations.posterior import Posterior, posterior_of
from models.diagnosis.explanations.verdict import NOTHING
from models.diagnosis.pooled_fit.baseline_fit import IndeterminateError, fit_baseline
from models.diagnosis.report.isolability import visible_of
from tests.lab.blind.rig.clutch import Law
from tests.lab.blind.rig.hide import Hidden, hide
from tests.lab.blind.rig.makers import CATALOGUED
from tests.lab.blind.rig.plan import DWELL, RPM, Life, Site
from tests.lab.blind.rig.sensor import measure
from tests.lab.blind.rig.sent import campaign
from tests.lab.blind.rig.world import Effect, read
from tests.lab.blind.rows import LOOPS, RECORDS

#: How often the amplitude that a report states is hidden.
TIMES = 2.0
#: Vibrations have no visible amplitude: raw records are searched for them.
SLUGS = tuple(slug for slug in CATALOGUED if slug not in RECORDS)
_MIDDLE, _AREA = 0.5 * 1970 * RPM * 0.058, 2 * np.pi / 4 * (0.133**2 - 0.099**2)
_PER_UNIT = {"oil_change": 100.0, "running_in": 100.0, "rest_recovery": 100.0, "channel_delay": 1000.0}


@dataclass(frozen=True)
class Shown:
    """What became of a hidden effect: the amplitudes stated and hidden, in the catalogue's unit; whether it was seen."""

    seed: tuple[int, ...]
    slug: str
    stated: float
    hidden: float
    seen: bool


def shown(seed: tuple[int, ...], slug: str) -> Shown | str:
    """Hide an effect at twice its stated amplitude in a campaign of this seed; why not, where that cannot be done."""
    rng = np.random.default_rng([*seed, 5])
    wanted = {"states": int(rng.integers(6, 13)), "loops": slug in LOOPS or bool(rng.random() < 0.5)}
    blank = hide(seed, (), **CATALOGUED[slug][1], **wanted)
    stated = next((each for each in visible_of(_posterior(campaign(blank))) if each.effect == slug), None)
    if stated is None or not np.isfinite(stated.amplitude):
        return "no amplitude is visible in whatever form"
    effect = CATALOGUED[slug][0](rng, blank.plan)
    amplitude = _found(lambda a: public(effect, a, blank), TIMES * stated.amplitude, effect)
    if amplitude is None:
        return f"{TIMES * stated.amplitude:.3g} {stated.unit} is beyond what makes sense on the rig"
    truth = read(blank.plan, blank.clutch, [(effect, amplitude)])
    if not all(np.isfinite(part).all() for part in truth):
        return "the effect makes no number of some readings"
    given = campaign(replace(blank, measured=measure(rng, blank.plan, blank.sensor, truth)))
    try:
        # whether the diagnosis calls the model anything but adequate
        seen = bool(_posterior(given).probabilities[NOTHING] < LIKELY)
    except IndeterminateError as lacking:
        return str(lacking)
    return Shown(seed, slug, stated.amplitude, TIMES * stated.amplitude, seen)


def _posterior(given: Campaign) -> Posterior:
    return posterior_of(fit_baseline(build_design(given)), ())


def public(effect: Effect, amplitude: float, blank: Hidden) -> float:
    """The size of the rig's effect by the catalogue's meaning of its amplitude and in its unit."""
    slug = effect.slug
    if slug == "interface_heating":  # loss of torque at the reference's heat flux, in %
        return 100 * _loss(effect, amplitude)
    if slug == "hydrodynamic_drag":
        site = _site(np.array([_MIDDLE]), blank.plan.life)
        return float(effect.friction(amplitude, site, blank.clutch.law(site.bar, site.cycles))[0, 0])
    if slug == "unsettled_dwell":  # what a plateau still carries of the one before, in %
        torque = np.array([[20.0, 10.0]])
        carried = effect.reading(amplitude, replace(_site(np.array([1.0, 1.0]), blank.plan.life), step=DWELL), torque)
        return float(10 * carried[0, 1])
    if slug == "accelerated_wear":
        return float(100 * -np.expm1(-amplitude))
    if slug == "squeeze_film":
        return _per_acceleration(effect, amplitude, blank)
    return _PER_UNIT.get(slug, 1.0) * amplitude


def _loss(effect: Effect, amplitude: float) -> float:
    """Share of the torque that is lost at REFERENCE_FLUX by the rig's formula, at 6 m/s."""
    site = _site(np.array([_MIDDLE, _MIDDLE]), _LIFE)
    nothing = np.zeros_like(site.bar)
    torque = REFERENCE_FLUX * _AREA * 0.058 / (_MIDDLE + nothing)
    law = Law(torque, 1 + nothing, 1 + nothing, nothing)
    return float(-effect.friction(amplitude, site, law)[0, -1] / torque[0, -1])


def _per_acceleration(effect: Effect, amplitude: float, blank: Hidden) -> float:
    """Torque over acceleration at 5 bar and mid speed, rising and falling, over the plan's loops [Nm s²/m]."""
    sites = [site for site in blank.plan.sites if site.kind == "loop"]
    found = []
    for site in sites:
        law = blank.clutch.law(site.bar, site.cycles)
        change = (
            effect.friction(amplitude, site, law)
            if effect.friction is not None
            else effect.reading(amplitude, site, law.torque(site.v))
        )
        slope = np.gradient(site.v, site.step, axis=1)
        near = (np.abs(site.bar - 5.0) < 0.6) & (np.abs(site.v - _MIDDLE) < 1.0) & (np.abs(slope) > 1e-3)
        found.append(float((change[near] * slope[near]).sum() / (slope[near] ** 2).sum()))
    return float(np.mean(found))


_LIFE = hide((0,)).plan.life


def _site(velocity: np.ndarray, life: Life) -> Site:
    """A stationary site of the fresh clutch at these velocities, 5 bar and 85 °C."""
    row = velocity[None, :]
    nothing = np.zeros_like(row)
    return Site(
        "stationary", np.zeros(1, dtype=int), 5 + nothing, row / (RPM * 0.058), nothing, 85 + nothing, life, DWELL
    )


def _found(size: Callable[[float], float], wanted: float, effect: Effect) -> float | None:
    """The rig's amplitude with this public size, None where that is beyond its `most`."""
    if abs(size(effect.most)) < wanted:
        return None
    low, high = 0.0, effect.most
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if abs(size(middle)) < wanted else (low, middle)
    return high
