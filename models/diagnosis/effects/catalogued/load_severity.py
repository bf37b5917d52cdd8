"""Harder engagements age the clutch faster: ζ is energy rather than a count."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Shape, Tried

#: Blocks whose log energies differ by less than this cannot show a severity (chosen; no table).
_LEAST_SPREAD = 0.03


def _grid(facts: Facts) -> tuple[Tried, ...]:
    if facts.duty_energies.size > 1 and np.ptp(np.log(facts.duty_energies)) > _LEAST_SPREAD:
        return (Tried(shape=()),)
    return ()


def effective_cycles(cycles: FloatArray, facts: Facts, exponent: float) -> FloatArray:
    """ζ [n] as it counts for ageing: each engagement by (energy/usual energy)^exponent, usual where no energy was sent."""
    ends = np.concatenate([[0.0], facts.duty_ends])
    lengths = np.maximum(np.diff(ends), 0.0)
    usual = float(np.median(facts.duty_energies))
    weights = np.exp(np.clip(exponent * np.log(facts.duty_energies / usual), -3.0, 3.0))
    grown = np.concatenate([[0.0], np.cumsum(lengths * weights)])
    beyond = np.maximum(cycles - ends[-1], 0.0)
    return np.asarray(np.interp(cycles, ends, grown) + beyond, dtype=np.float64)


def _change(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
    counted = effective_cycles(scene.points.cycles, scene.facts, amplitude)
    return scene.curve_at(cycles=counted) - scene.curve


EFFECT = Effect(
    slug="load_severity",
    title="Some duty was harder than other",
    physics="The rate of eq. 6's kinetics grows with the energy of an engagement: harder blocks age the clutch faster.",
    formula="S(ζ_e) - S(ζ), ζ_e = Σ (E/E_usual)^m over the engagements whose energy was sent",
    source="models.degradation.general_order: dD/dζ = -k Dⁿ with k by the load's severity",
    family=Family.HISTORY,
    kind=Kind.COURSE,
    channels=("energy_per_cycle_kj",),
    amplitude="severity exponent m",
    unit="-",
    prior_sd=0.7,
    positive=True,
    scale=1.0,
    shapes=(),
    grid=_grid,
    change=_change,
    before_lag=True,
    discrepancies=(Discrepancy.LIFE,),
    counts_in_severity=True,
)
