"""One effect in a model: its amplitude and shape, its torque at the rows, and the derivatives that a fit needs.

    torque = baseline + Σ_effects change(amplitude, shape) (1 + Σ_k b_k φ_k),     b_k ~ N(0, DISCREPANCY_SD²)

The derivatives in the amplitude and in the smooth shapes are central differences: an effect only has to give its change.
φ_k are cosines over the ranges of speed, life or the test's clock, or a contrast of plateaus against loops: those along
which the effect's form is uncertain (`Effect.discrepancies`). The b_k are integrated out wherever evidence is computed or a
case is checked; a fit has none. So a template is held to its formula up to a tolerance, and none wins because its form
happens to be the more flexible one (after Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425).

What adoption takes off measurements and adds to a life is a weighted set of draws (`diagnosis.extension`). Within a draw
the correction of all runs of a life is one function: runs are not off independently of each other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import erf, sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import BLOCKS, RAISED, Laws, Scene
from models.diagnosis.baseline.prediction import Prediction, predict
from models.diagnosis.design.design import Design, Points
from models.diagnosis.effects.effect import Discrepancy, Effect, EffectKind, Shape
from models.friction.criteria import Z90

#: Steps of the differences: shares of the prior deviation and of a shape's range; and of a law's largest value.
_STEP, _RAISE = 1e-3, 1e-6
#: Along what φ is uncertain: the lowest value and the range in a campaign.
Ranges: TypeAlias = Mapping[Discrepancy, tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedEffect:
    """An effect with its fitted amplitude and shape."""

    effect: Effect
    amplitude: float
    shape: Shape
    factors: tuple[float, ...] = ()  # in a draw: b [m] of its discrepancy and of its template's small errors

    @property
    def wrong_sign(self) -> bool:
        """Whether the amplitude of a one-sided effect is negative."""
        return self.effect.positive and self.amplitude < 0

    def rows(self, design: Design, prediction: Prediction) -> FloatArray:
        """The effect's change of torque [N] Nm at the rows."""
        change = self.effect.change(prediction.scene, self.amplitude, self.shape)
        return prediction.change_at_rows(design, change, before_lag=self.effect.lags(self.shape))

    def columns(self, design: Design, prediction: Prediction) -> FloatArray:
        """∂change/∂(amplitude, smooth shapes) [N, 1 + s] at the rows, by central differences."""
        effect, ends = self.effect, list[tuple[float, Shape]]()
        deltas = [_STEP * effect.prior_sd]
        ends += [(self.amplitude + side * deltas[0], self.shape) for side in (1.0, -1.0)]
        for place in self.smooth_places:
            deltas.append(_STEP * (effect.shapes[place].highest - effect.shapes[place].lowest))
            for side in (1.0, -1.0):
                shape = list(self.shape)
                shape[place] += side * deltas[-1]
                ends.append((self.amplitude, tuple(shape)))
        changes = effect.changes(prediction.scene, ends)
        columns = (changes[:, ::2] - changes[:, 1::2]) / (2 * np.array(deltas))
        return prediction.change_at_rows(design, columns, before_lag=effect.lags(self.shape))

    @property
    def precisions(self) -> FloatArray:
        """Precisions 1/sd² of the priors on (amplitude, smooth shapes) [1 + s]; of the amplitude's heavy-tailed prior,
        at the fitted value."""
        widths = [0.5 * (shape.highest - shape.lowest) for _, shape in self.effect.smooth(self.shape)]
        return np.array([self.effect.amplitude_precision(self.amplitude), *(width**-2.0 for width in widths)])

    @property
    def smooth_places(self) -> list[int]:
        """Indices of the smooth ones among the effect's shapes."""
        return [place for place, shape in enumerate(self.effect.shapes) if shape.smooth]

    @property
    def free(self) -> NDArray[np.bool_]:
        """Whether each of (amplitude, smooth shapes) [1 + s] lies inside its bounds; a parameter at a bound stays there
        in a refit."""
        margins = [
            min(value - shape.lowest, shape.highest - value) / (shape.highest - shape.lowest)
            for value, shape in self.effect.smooth(self.shape)
        ]
        inside = self.amplitude < self.effect.highest and (self.effect.positive or self.amplitude > self.effect.lowest)
        return np.array([inside, *(margin > 0.01 for margin in margins)])  # fits stop exactly there

    def discrepancy_columns(self, design: Design, prediction: Prediction) -> FloatArray:
        """∂torque/∂b [N, m] Nm."""
        return self.rows(design, prediction)[:, None] * discrepancy_factors(design, self.effect)

    def drawn(self, scene: Scene, ranges: Ranges) -> FloatArray:
        """Change of torque [P] Nm in a posterior draw, template errors included. A course that is followed far enough
        ends friction; it does not reverse it."""
        change = self.effect.change(scene, self.amplitude, self.shape)
        if any(self.factors):
            factors = np.concatenate(
                [factors_at(scene.points, self.effect, ranges), small_factors_at(scene.points, ranges)], axis=1
            )
            change = change * (1.0 + factors @ np.array(self.factors))
        return np.maximum(change, -scene.curve) if self.effect.kind is EffectKind.COURSE else change


def law_columns(design: Design, prediction: Prediction, effects: Sequence[FittedEffect]) -> FloatArray:
    """∂torque/∂θ [N, θ.size] of the baseline and of effects beside it.

    Effects in proportion to friction change when the laws do. That part is found by raising M_s, M̄_c, V_S, C_v and log C a
    little, one at a time; without it a fit of heating by a fifth of the torque ended 49 nats short, and with an error of
    0.1 % in it one of oil temperature 5. An effect of so many Nm has it only where friction lags behind it. It is left out
    where an effect reads the laws at another pressure or at other cycles (pressure offset, gauge hysteresis, load severity,
    wear at a faster pace).
    """
    scene, changes = prediction.scene, np.zeros((design.rows.run.size, RAISED))
    moving = [one for one in effects if one.effect.grows_with is None or one.effect.lags(one.shape)]
    sizes = [*np.abs(scene.parameters).max(axis=0).tolist(), 1.0][: BLOCKS if prediction.lag is None else RAISED]
    before = [one.rows(design, prediction) for one in moving]
    for place, size in enumerate(sizes if moving else ()):
        by = _RAISE * (size or 1.0)
        parameters = scene.parameters + by * (np.arange(BLOCKS) == place)
        raised = predict(design, scene.laws.raised(place, by), parameters)
        for one, change in zip(moving, before, strict=True):
            changes[:, place] += (one.rows(design, raised) - change) / by
    return prediction.jacobian(design, changes)


#: Orders of the cosines by which an effect's form is uncertain, and of those by which any template may be a little off;
#: and the harmonics of a loop of the latter.
_ORDERS = {Discrepancy.SPEED: 2}  # one in all others
_SMALL = {Discrepancy.SPEED: 4, Discrepancy.PRESSURE: 2, Discrepancy.LIFE: 3, Discrepancy.CLOCK: 3}


def ranges_of(rows: Points) -> Ranges:
    """Lowest value and range of a campaign's rows on every axis of `Discrepancy`."""
    return {along: (float(values.min()), float(np.ptp(values))) for along, values in _coordinates(rows).items()}


def factors_at(points: Points, effect: Effect, ranges: Ranges) -> FloatArray:
    """Factors φ [P, m] of an effect's own discrepancy at points, each within ±1, over the axes that a campaign varied;
    beyond a campaign's range, their value at its end."""
    return _cosines(points, {along: _ORDERS.get(along, 1) for along in effect.discrepancies}, ranges)


def small_factors_at(points: Points, ranges: Ranges) -> FloatArray:
    """Factors φ [P, m] of the small error of any template at points, each within ±1, over every axis that a campaign
    varied; beyond a campaign's range, their value at its end."""
    factors = [_cosines(points, _SMALL, ranges)]
    if ranges[Discrepancy.MOTION][1] > 0:
        turns = points.phase[:, None] * np.arange(1, 2 + 1)
        waves = np.where(points.steady[:, None], 0.0, np.concatenate([np.cos(turns), np.sin(turns)], axis=1))
        factors += [np.where(points.steady, 1.0, 0.0)[:, None], waves]
    return np.concatenate(factors, axis=1)


def _cosines(points: Points, orders: Mapping[Discrepancy, int], ranges: Ranges) -> FloatArray:
    """Cosines [P, m] of the orders 1 ... n along each axis that was varied."""
    values, waves = _coordinates(points), [np.zeros((points.run.size, 0))]
    for along, most in orders.items():
        low, width = ranges[along]
        if width > 0:
            unit = np.clip((values[along] - low) / width, 0.0, 1.0)
            waves.append(np.cos(np.pi * unit[:, None] * np.arange(1, most + 1)))
    return np.concatenate(waves, axis=1)


def _coordinates(points: Points) -> dict[Discrepancy, FloatArray]:
    """Coordinates [P] of the points on every axis along which an effect's form may be uncertain."""
    return {
        Discrepancy.SPEED: points.velocity,
        Discrepancy.PRESSURE: points.pressure,
        Discrepancy.LIFE: points.cycles,
        Discrepancy.CLOCK: points.clock,
        Discrepancy.MOTION: np.where(points.steady, 1.0, 0.0),
    }


def discrepancy_factors(design: Design, effect: Effect) -> FloatArray:
    """Factors φ [N, m] of an effect's own discrepancy at the rows of a campaign."""
    return factors_at(design.rows, effect, ranges_of(design.rows))


@dataclass(frozen=True, slots=True, kw_only=True)
class Draw:
    """A weighted draw of the posterior: the effects at work (none: nothing is) and the laws beside them."""

    weight: float
    laws: Laws
    effects: tuple[FittedEffect, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class AmplitudeEstimate:
    """The amplitude of an effect in engineering units."""

    name: str
    value: float
    sd: float
    unit: str
    one_sided: bool = False  # where it cannot be negative
    stated_interval: tuple[float, float] | None = None  # of 90 %, where it is not the normal one
    stated_sign: float | None = None  # its probability likewise

    @property
    def interval(self) -> tuple[float, float]:
        """The 90 % interval."""
        half = Z90 * self.sd
        return self.stated_interval or (self.value - half, self.value + half)

    @property
    def sign_probability(self) -> float | None:
        """The probability that the sign is that of the value; None where nothing was estimated."""
        if self.value == 0.0 or not self.sd > 0.0:
            return None
        if self.stated_sign is not None:
            return self.stated_sign
        return 1.0 if self.one_sided else 0.5 * (1.0 + erf(abs(self.value) / self.sd / sqrt(2.0)))
