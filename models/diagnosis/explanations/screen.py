"""The linear screen: what every effect promises beside a fit, without refitting anything.

    promise = ln Σ_g Σ_s p(g) p(shape) ∫ p(data | a; g) p(a) da - the same without the effect        [nats]

with the heavy-tailed prior of amplitudes as two normal ones (`amplitude_prior.SCALES`). The shapes that a refit moves are
summed over; those that it does not (a change point, which torque is meant) are kinds, and each kind is a start of its own.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr

from models.diagnosis.effects.amplitude_prior import SCALES
from models.diagnosis.effects.effect import Shape
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.effects.grid import Column
from models.diagnosis.pooled_fit.projection import Projected
from models.gaussian_evidence import log_sum


class Start(NamedTuple):
    """A kind of an effect's shapes: what it promises [nats, its prior included], its best column, the place of the scatter
    of the gains that suits that, and the linear fit of it."""

    promise: float
    column: Column
    gain: int
    fitted: FittedEffect


def stiff(shape: Shape, column: Column) -> Shape:
    """The shapes that a refit does not move."""
    return tuple(x for x, parameter in zip(shape, column.effect.shapes, strict=True) if not parameter.smooth)


def starts(columns: Sequence[Column], screened: Sequence[Projected]) -> dict[str, list[Start]]:
    """By effect its kinds of shapes, best first."""
    if not columns:
        return {}
    sd = np.array([column.effect.prior_sd for column in columns])
    positive = np.array([column.effect.positive for column in columns], dtype=np.bool_)
    weight = np.array([column.log_weight for column in columns])
    null = log_sum([projected.evidence for projected in screened])
    by_gain = []
    for projected in screened:
        info, score = np.maximum(np.diag(projected.info), 0.0), projected.score
        wide = np.outer(SCALES, sd)
        precision = info + wide**-2
        mean = score / precision
        gain = 0.5 * score * mean - 0.5 * np.log(precision * wide**2)
        gain = gain + np.where(positive, np.log(2.0) + log_ndtr(mean * np.sqrt(precision)), 0.0)
        by_gain.append(projected.evidence + np.logaddexp.reduce(gain, axis=0) - np.log(len(SCALES)) + weight)
    table = np.stack(by_gain)
    total = np.logaddexp.reduce(table, axis=0)
    kinds: dict[tuple[str, Shape], list[int]] = {}
    for place, column in enumerate(columns):
        kinds.setdefault((column.effect.slug, stiff(column.shape, column)), []).append(place)
    by_effect: dict[str, list[Start]] = {}
    for (slug, _), mine in kinds.items():
        best = mine[int(np.argmax(total[mine]))]
        gain = int(np.argmax(table[:, best]))
        precision = screened[gain].info[best, best] + (SCALES[-1] * sd[best]) ** -2.0
        amplitude = float(screened[gain].score[best] / precision)
        column = columns[best]
        fitted = FittedEffect(effect=column.effect, amplitude=amplitude, shape=column.shape)
        promise = log_sum(total[mine]) - null
        by_effect.setdefault(slug, []).append(Start(promise, column, gain, fitted))
    return {slug: sorted(by_kind, key=lambda start: -start.promise) for slug, by_kind in by_effect.items()}
