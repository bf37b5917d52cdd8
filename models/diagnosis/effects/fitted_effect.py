"""One effect in a model: its amplitude and shape, its torque at the rows, and the derivatives that a fit needs.

    torque = baseline + Σ_effects change(amplitude, shape)

The derivatives in the amplitude and in the smooth shapes are central differences: an effect only has to give its change.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.baseline.prediction import Prediction
from models.diagnosis.design.design import Design
from models.diagnosis.effects import amplitude_prior
from models.diagnosis.effects.effect import Effect, Shape

#: Steps of the differences: shares of the prior deviation and of a shape's range.
_STEP = 1e-3
#: A shape within this share of its range of a bound counts as at the bound (numerical: fits stop exactly there).
_AT_BOUND = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedEffect:
    """An effect in a model: its amplitude and shape."""

    effect: Effect
    amplitude: float
    shape: Shape

    @property
    def wrong_sign(self) -> bool:
        """Whether the amplitude of a one-sided effect is negative."""
        return self.effect.positive and self.amplitude < 0


def effect_rows(design: Design, prediction: Prediction, fitted: FittedEffect) -> FloatArray:
    """The change [N] Nm of an effect at the rows."""
    change = fitted.effect.change(prediction.scene, fitted.amplitude, fitted.shape)
    return prediction.change_at_rows(design, change, before_lag=fitted.effect.lags(fitted.shape))


def effect_columns(design: Design, prediction: Prediction, fitted: FittedEffect) -> FloatArray:
    """∂change/∂(amplitude, smooth shapes) [N, 1 + s] at the rows, by central differences."""
    effect, ends = fitted.effect, list[tuple[float, Shape]]()
    deltas = [_STEP * effect.prior_sd]
    ends += [(fitted.amplitude + side * deltas[0], fitted.shape) for side in (1.0, -1.0)]
    for index, parameter in enumerate(effect.shapes):
        if parameter.smooth:
            deltas.append(_STEP * (parameter.highest - parameter.lowest))
            for side in (1.0, -1.0):
                shape = list(fitted.shape)
                shape[index] += side * deltas[-1]
                ends.append((fitted.amplitude, tuple(shape)))
    changes = effect.changes(prediction.scene, ends)
    columns = (changes[:, ::2] - changes[:, 1::2]) / (2 * np.array(deltas))
    return prediction.change_at_rows(design, columns, before_lag=effect.lags(fitted.shape))


def effect_precisions(fitted: FittedEffect) -> FloatArray:
    """1/sd² of the priors on (amplitude, smooth shapes) [1 + s]; that of the amplitude where it is."""
    smooth = [0.5 * (shape.highest - shape.lowest) for shape in fitted.effect.shapes if shape.smooth]
    return np.array([amplitude_prior.precision(fitted.effect, fitted.amplitude), *(width**-2.0 for width in smooth)])


def smooth_places(effect: Effect) -> list[int]:
    """Which of an effect's shapes are smooth."""
    return [place for place, shape in enumerate(effect.shapes) if shape.smooth]


def free_shapes(fitted: FittedEffect) -> NDArray[np.bool_]:
    """Which of (amplitude, smooth shapes) [1 + s] a refit may move: shapes at a bound stay there."""
    smooth = [(value, shape) for value, shape in zip(fitted.shape, fitted.effect.shapes, strict=True) if shape.smooth]
    margins = [
        min(value - shape.lowest, shape.highest - value) / (shape.highest - shape.lowest) for value, shape in smooth
    ]
    return np.array([True, *(margin > _AT_BOUND for margin in margins)])
