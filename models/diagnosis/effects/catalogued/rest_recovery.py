"""After a pause friction is off its course and returns to it with use."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Shape, ShapeParameter, Tried

_HOUR, _MINUTE = 3600.0, 60.0
WHOLE, STATIC = 0.0, 1.0


def _grid(facts: Facts) -> tuple[Tried, ...]:
    if not facts.rests or facts.states.size < 2:
        return ()
    gap = float(np.median(np.diff(facts.states)))
    courses = [(length, 0.0) for length in (0.1 * gap, 0.5 * gap, 1.5 * gap)]
    if np.isfinite(facts.rest_moments).any():
        courses += [(0.1 * gap, seconds) for seconds in (150.0, 600.0)]
    powers = (0.0, 1.0) if np.isfinite(facts.rest_lengths).sum() > 1 else (0.0,)
    return tuple(
        Tried(shape=(*course, power, part)) for course in courses for power in powers for part in (WHOLE, STATIC)
    )


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    length, seconds, power, *part = shape
    points = scene.points
    carried = scene.gradient[:, 0] * scene.parameters[:, 0] if part == [STATIC] else scene.curve
    share = np.zeros_like(points.cycles)
    strengths = _strengths(scene.facts) ** power
    for rest, moment, strength in zip(scene.facts.rests, scene.facts.rest_moments, strengths.tolist(), strict=True):
        since = points.cycles - rest
        left = np.where(since >= 0, strength * np.exp(-np.maximum(since, 0.0) / length), 0.0)
        if seconds > 0 and np.isfinite(moment):
            waited = np.where(np.isfinite(points.moment), points.moment - moment, points.clock)
            left = np.where(waited < -_MINUTE, 0.0, left)  # tested at the same cycles, but before the pause
            left = left * np.exp(-np.clip(waited, 0.0, 50 * seconds) / seconds)
        share = np.maximum(share, left)
    return np.asarray(amplitude * carried * share, dtype=np.float64)


def _strengths(facts: Facts) -> FloatArray:
    """[r] What settles grows with the logarithm of the pause; 1 after the longest, and where the length is not known."""
    grown = np.log1p(np.maximum(np.array(facts.rest_lengths, dtype=np.float64), 60.0) / _HOUR)
    timed = np.isfinite(grown)
    return np.where(timed, grown / max(float(grown[timed].max(initial=0.0)), 1e-9), 1.0)


EFFECT = Effect(
    slug="rest_recovery",
    title="Friction recovered during a rest",
    physics="While the clutch rests additives settle on the lining and oil drains: friction starts away from its course "
    "and returns to it within some cycles or minutes of sliding.",
    formula="a S (ln(1 + rest/1 h)/ln(1 + longest/1 h))^r e^{-(ζ - ζ_rest)/ζ_c}, S or M_s ∂S/∂M_s; with the clock also "
    "e^{-(t - t_rest)/τ}",
    source="boundary films of friction modifiers re-form at rest",
    family=Family.HISTORY,
    kind=Kind.COURSE,
    channels=("started_at",),
    amplitude="recovery at the end of the longest rest",
    unit="%",
    prior_sd=0.04,
    positive=False,
    scale=100.0,
    shapes=(
        ShapeParameter(name="length ζ_c", unit="cycles", lowest=1.0, highest=float("inf")),
        ShapeParameter(name="settling time τ", unit="s", lowest=0.0, highest=float("inf")),
        ShapeParameter(name="power of the rest's length r", unit="-", lowest=0.0, highest=2.0, smooth=True),
        ShapeParameter(name="what is changed", unit="-", lowest=WHOLE, highest=STATIC),
    ),
    grid=_grid,
    change=_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.LIFE, Discrepancy.CLOCK),
)
