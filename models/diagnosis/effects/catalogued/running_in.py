"""Early in life asperities are worn off: friction starts away from eq. 6 and settles onto it."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Shape, ShapeParameter, Tried

STATIC, WHOLE = 0.0, 1.0


def _grid(facts: Facts) -> tuple[Tried, ...]:
    if facts.states.size < 4:
        return ()
    gap = max(float(np.diff(facts.states).min()), 1e-3 * facts.life)
    lengths = np.geomspace(gap / 3, facts.life / 6, 5)
    return tuple(Tried(shape=(float(np.log(length)), part)) for length in lengths for part in (STATIC, WHOLE))


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    log_length, part = shape
    carried = scene.curve if part == WHOLE else scene.gradient[:, 0] * scene.parameters[:, 0]
    return np.asarray(amplitude * carried * np.exp(-scene.points.cycles / np.exp(log_length)), dtype=np.float64)


EFFECT = Effect(
    slug="running_in",
    title="Running-in was not finished",
    physics="The first cycles polish the lining; friction starts away from the course that eq. 6 follows later.",
    formula="a M_s ∂S/∂M_s e^{-ζ/ζ_r}, or a S e^{-ζ/ζ_r}",
    source="Ompusunggu et al. 2013, section 2.3.1: 200 cycles of running-in before cycle 0",
    family=Family.HISTORY,
    kind=Kind.COURSE,
    channels=(),
    amplitude="share when new",
    unit="%",
    prior_sd=0.08,
    positive=False,
    scale=100.0,
    shapes=(
        ShapeParameter(name="log of the length ζ_r", unit="ln cycles", lowest=3.0, highest=8.6, smooth=True),
        ShapeParameter(name="what is changed", unit="-", lowest=0.0, highest=1.0),
    ),
    grid=_grid,
    change=_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.LIFE),
)
