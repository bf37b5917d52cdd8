"""What an explanation is worth: the log marginal likelihood about a refit with everything free.

    Z = Σ_g p(g) mean_t ∫ p(data | θ, a, shapes, b, c; g) p(θ, a, shapes) N(b; 0, τ_t²) N(c; 0, τ²) d(θ, a, shapes, b, c)

g is the scatter of the gains, b the template's error (its change is multiplied by 1 + Σ_k b_k φ_k), c the coefficients of
smooth structure. It is Laplace's integral about the fit in (θ, a, shapes); b and c, linear beside it, are integrated out in
closed form on the residual projected there. The size τ_t of a template's error is averaged over (`TEMPLATE_ERRORS`): held
to one, it charges an exact template for what it is not. A shape at its bound has only the side that falls off there,
∫ e^{-gt - ht²/2} dt.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import erfcx

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.design.design import Design
from models.diagnosis.effects.catalogue import Column, columns_at_rows
from models.diagnosis.effects.effect import log_amplitude_peak
from models.diagnosis.effects.fitted_effect import discrepancy_factors, effect_precisions, effect_rows, free_shapes
from models.diagnosis.explanations.contrasts import contrasts_of, no_contrasts
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import GAINS, Gram, Projected, gram_of, project
from models.gaussian_evidence import independent, log_gain, log_gain_alone, log_mean, log_sum

#: Orders of the cosines over speed, pressure, life and clock, and harmonics of a loop, by which any template may be off.
_SPEED, _PRESSURE, _LIFE, _CLOCK, _HARMONICS = 4, 2, 3, 3, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """About one fit [nats, up to one constant]: `whole` with the templates' errors; `structure` by axis what smooth
    structure adds to it, and `patterns` its likeliest form [N] Nm; `screened` are the given columns projected off the fit,
    one for each scatter of the gains; `misfit` is χ²/N, what is left of the residual when the templates' errors and
    structure on all axes, at its largest size, have taken their part, near 1 where that is noise."""

    whole: float
    structure: Mapping[str, float]
    patterns: Mapping[str, FloatArray]
    screened: tuple[Projected, ...]
    misfit: float


def evidence_of(problem: FitProblem, fitted: Fit, columns: Sequence[Column] = (), *, smooth: bool = True) -> Evidence:
    """The evidence about a fit, with `columns` of the catalogue projected beside it for the screen of one thing more, and
    smooth structure beside it unless not wanted."""
    design = problem.design
    contrasts = contrasts_of(design, fitted.prediction) if smooth else no_contrasts(design)
    errors, own = _template_errors(design, fitted)
    exact = replace(
        fitted, effects=tuple(replace(e, effect=replace(e.effect, discrepancies=())) for e in fitted.effects)
    )
    changes = (columns_at_rows(design, fitted.prediction, columns), contrasts.columns, errors)
    gram = gram_of(problem, exact, np.concatenate(changes, axis=1))
    gram, outward = _held_at_bounds(gram, int(problem.priors.free.sum()), fitted)
    ends = np.cumsum([outward.size, *(change.shape[1] for change in changes)])
    held, catalogue, contrasted, wrong = (slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True))
    axes = np.array(contrasts.axes)
    places = {axis: contrasted.start + np.flatnonzero(axes == axis) for axis in dict.fromkeys(contrasts.axes)}
    prior = _log_prior(fitted)
    wholes, screened = [], []
    structures: dict[str, list[float]] = {axis: [] for axis in places}
    projections = projections_beside(gram, problem.noise)
    for projected in projections:
        base = projected.evidence + _beside_bounds(projected, held, outward) + prior
        wholes.append(base + _averaged(projected, wrong, own, criteria.TEMPLATE_ERRORS))
        for axis, mine in places.items():
            structures[axis].append(base + _structure(projected.info[np.ix_(mine, mine)], projected.score[mine]))
        info, score = projected.info[catalogue, catalogue], projected.score[catalogue]
        screened.append(replace(projected, info=info, score=score, whole=projected.whole[catalogue], evidence=base))
    whole = log_sum(wholes)
    likely = projections[int(np.argmax(wholes))]
    flexible = slice(contrasted.start, wrong.stop)
    sd = np.concatenate(
        [np.full(len(axes), criteria.CONTRAST_SIZES[-1]), np.where(own > 0, *criteria.TEMPLATE_ERRORS[-1])]
    )
    info, score = likely.info[flexible, flexible] + np.diag(sd**-2.0), likely.score[flexible]
    return Evidence(
        misfit=(likely.miss - float(score @ np.linalg.solve(info, score))) / design.torque.size,
        whole=whole,
        structure={axis: log_sum(logs) - whole for axis, logs in structures.items()},
        patterns={
            axis: contrasts.columns[:, axes == axis] @ _likeliest(projections[int(np.argmax(structures[axis]))], mine)
            for axis, mine in places.items()
        },
        screened=tuple(screened),
    )


def projections_beside(gram: Gram, noise: Noise) -> list[Projected]:
    """At every second scatter of the runs' gains, with the curves' as estimated without an effect and with none: an effect
    may be what made them scatter."""
    return [project(gram, gain, curve) for curve in sorted({noise.curve_gain, 0.0}) for gain in GAINS[::2].tolist()]


def _template_errors(design: Design, fitted: Fit) -> tuple[FloatArray, FloatArray]:
    """The changes [N, m] Nm by every factor with which the effects may be off, and [m] 1 for those in which an effect's form
    is uncertain by itself, 0 for the others."""
    columns, own = [np.zeros((design.torque.size, 0))], list[float]()
    for effect in fitted.effects:
        uncertain, other = discrepancy_factors(design, effect.effect), _any_factors(design)
        columns.append(
            effect_rows(design, fitted.prediction, effect)[:, None] * np.concatenate([uncertain, other], axis=1)
        )
        own += [1.0] * uncertain.shape[1] + [0.0] * other.shape[1]
    return np.concatenate(columns, axis=1), np.array(own)


def _any_factors(design: Design) -> FloatArray:
    """φ [N, m] within ±1: smooth factors over every axis, by which any template may be a little wrong."""
    rows, out = design.rows, [np.zeros((design.torque.size, 0))]
    axes = ((rows.velocity, _SPEED), (rows.pressure, _PRESSURE), (rows.cycles, _LIFE), (rows.clock, _CLOCK))
    for values, orders in axes:
        if np.ptp(values) > 0:
            unit = (values - values.min()) / np.ptp(values)
            out.append(np.cos(np.pi * unit[:, None] * np.arange(1, orders + 1)))
    if design.loops:
        turns = rows.phase[:, None] * np.arange(1, _HARMONICS + 1)
        waves = np.where(rows.steady[:, None], 0.0, np.concatenate([np.cos(turns), np.sin(turns)], axis=1))
        out += [np.where(rows.steady, 1.0, 0.0)[:, None], waves]
    return np.concatenate(out, axis=1)


def _averaged(projected: Projected, wrong: slice, own: FloatArray, sizes: Sequence[tuple[float, float]]) -> float:
    """What the templates' errors add [nats], averaged over their sizes (in what a form is uncertain in, in all else)."""
    if not own.size:
        return 0.0
    info, score = projected.info[wrong, wrong], projected.score[wrong]
    return log_mean([log_gain(info, score, np.where(own > 0, *size)) for size in sizes])


def _structure(info: FloatArray, score: FloatArray) -> float:
    """What smooth structure adds [nats], averaged over its size, all contrasts together or one of them alone."""
    values, vectors = independent(info)
    sizes = np.array(criteria.CONTRAST_SIZES)[:, None]
    together = log_gain_alone(values, vectors.T @ score, sizes).sum(axis=1)
    alone = [log_mean(gains) for gains in log_gain_alone(np.maximum(np.diag(info), 0.0), score, sizes)]
    return log_mean([*together.tolist(), *alone])


def _likeliest(projected: Projected, mine: FloatArray) -> FloatArray:
    """The likeliest coefficients of smooth structure, at the size that suits it best."""
    values, vectors = independent(projected.info[np.ix_(mine, mine)])
    score = vectors.T @ projected.score[mine]
    size = max(criteria.CONTRAST_SIZES, key=lambda size: float(log_gain_alone(values, score, size).sum()))
    return np.asarray(vectors @ (score / (values + size**-2.0)))


def _log_prior(fitted: Fit) -> float:
    """The normalisation of the priors of the effects' amplitudes and smooth shapes [nats]."""
    logs = [log_amplitude_peak(e.effect) + 0.5 * float(np.log(effect_precisions(e)[1:]).sum()) for e in fitted.effects]
    return sum(logs) + float(np.log(2.0)) * sum(e.effect.positive for e in fitted.effects)


def _held_at_bounds(gram: Gram, first: int, fitted: Fit) -> tuple[Gram, FloatArray]:
    """The Gram matrix with shapes at a bound before the changes [h], and which way is out for each [h] ±1; the effects'
    columns begin at `first`."""
    ways: list[float] = []  # 0 for what is free
    for effect in fitted.effects:
        smooth = effect.effect.smooth(effect.shape)
        out = np.array([1.0, *(1.0 if 2 * x > shape.lowest + shape.highest else -1.0 for x, shape in smooth)])
        ways += np.where(free_shapes(effect), 0.0, out).tolist()
    outward = np.array(ways)
    held = first + np.flatnonzero(outward)
    order = np.concatenate([np.setdiff1d(np.arange(gram.base), held), held, np.arange(gram.base, gram.matrix.shape[0])])
    matrix, along = gram.matrix[np.ix_(order, order)], gram.along[:, order]
    return replace(gram, matrix=matrix, along=along, base=gram.base - held.size), outward[outward != 0]


def _beside_bounds(projected: Projected, held: slice, outward: FloatArray) -> float:
    """What the shapes at a bound add [nats]: all of their prior lies on one side, and where the data ask for values beyond,
    it falls off there (twice the half of a normal one that it would be where they do not)."""
    info = np.maximum(np.diag(projected.info)[held], 1e-300)
    slope = np.maximum(outward * projected.score[held], 0.0) / np.sqrt(2 * info)
    return float((np.log(erfcx(slope)) - 0.5 * np.log(info)).sum())
