"""What an explanation is worth: the log marginal likelihood about a refit with everything free.

    Z = Σ_g p(g) mean_t ∫ p(data | θ, a, shapes, b, c; g) p(θ, a, shapes) N(b; 0, τ_t²) N(c; 0, τ²) d(θ, a, shapes, b, c)

g is the scatter of the gains and the sizes of the law's discrepancy, b the template's error (its change is multiplied by 1 +
Σ_k b_k φ_k), c the coefficients of smooth structure. It is Laplace's integral about the fit in (θ, a, shapes); b and c,
linear beside it, are integrated out in closed form on the residual projected there. The size τ_t of a template's error is
averaged over (`TEMPLATE_ERRORS`): held to one, it charges an exact template for what it is not. A shape at its bound has
only the side that falls off there, ∫ e^{-gt - ht²/2} dt.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from scipy.special import erfcx

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.law_form import LawSizes
from models.diagnosis.design.design import Design, IntArray
from models.diagnosis.effects.fitted_effect import discrepancy_factors, ranges_of, small_factors_at
from models.diagnosis.explanations.contrasts import contrasts_of
from models.diagnosis.pooled_fit.gauss_newton import PooledFit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import Gram, Projected, coarse_projections, gram_of, isolability
from models.gaussian_evidence import independent, log_gain, log_gain_alone, log_mean, log_sum


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Log marginal likelihood about one fit [nats, up to one constant], with isolability, smooth structure and
    projections beside it."""

    whole: float  # with the templates' errors
    isolability: tuple[float, ...]  # ι of each effect, beside the sizes of the law that are likely here
    structure: Mapping[str, float]  # what smooth structure adds to it, by axis
    patterns: Mapping[str, FloatArray]  # its likeliest form [N] Nm
    # the given changes projected off the fit, one for each scatter of the gains and size of the law
    screened: tuple[Projected, ...]


def evidence_of(
    problem: FitProblem, fitted: PooledFit, beside: FloatArray | None = None, *, smooth: bool = True
) -> Evidence:
    """Log marginal likelihood about a fit [nats], by the formula above, with smooth structure unless `smooth` is false.

    Changes [N, m] Nm `beside` the fit are projected for the screen of one further effect."""
    design = problem.design
    contrasts, axes = visible_contrasts(problem, fitted) if smooth else (np.zeros((design.torque.size, 0)), [])
    factors, uncertain = template_error_factors(design, fitted)
    changes = np.concatenate([contrasts, template_error_columns(design, fitted, factors)], axis=1)
    gram = gram_of(problem, fitted, changes, screened=beside)
    gram, outward = _bounds_as_changes(gram, int(problem.priors.free.sum()), fitted)
    at_bounds, templates = slice(0, outward.size), slice(outward.size + len(axes), None)
    places = {axis: outward.size + np.flatnonzero(np.array(axes) == axis) for axis in dict.fromkeys(axes)}
    prior = _log_prior(fitted)
    projections = coarse_projections(gram, problem.noise)
    exact = [one.evidence + _log_integral_at_bounds(one, at_bounds, outward) + prior for one in projections]
    whole = [log + _template_error_gain(one, templates, uncertain) for log, one in zip(exact, projections, strict=True)]
    total = log_sum(whole)
    structure, patterns = {}, {}
    for axis, columns in places.items():
        logs = [
            log + structure_gain(one.info[np.ix_(columns, columns)], one.score[columns])
            for log, one in zip(exact, projections, strict=True)
        ]
        structure[axis] = log_sum(logs) - total
        likeliest = projections[int(np.argmax(logs))]
        patterns[axis] = contrasts[:, columns - outward.size] @ _likeliest_coefficients(likeliest, columns)
    return Evidence(
        whole=total,
        isolability=_isolability(problem, fitted, projections[int(np.argmax(whole))]),
        structure=structure,
        patterns=patterns,
        screened=tuple(_screen_alone(one, log) for one, log in zip(projections, exact, strict=True)),
    )


def _screen_alone(projected: Projected, log_evidence: float) -> Projected:
    """The projection with its screened columns, without the changes, and with the log evidence [nats] of the fit."""
    return replace(projected, info=np.zeros((0, 0)), score=np.zeros(0), whole=np.zeros(0), evidence=log_evidence)


def _isolability(problem: FitProblem, fitted: PooledFit, likely: Projected) -> tuple[float, ...]:
    """Isolability ι of each fitted effect beside the baseline without effects: it measures whether an effect is at
    work, not how well its amplitude is known."""
    if not fitted.effects:
        return ()
    changes = np.stack([effect.rows(problem.design, fitted.prediction) for effect in fitted.effects], axis=1)
    noise = likely.noise(problem.noise)
    alone = isolability(problem.with_noise(noise), replace(fitted, effects=()), changes, noise.law)
    return tuple(np.clip(alone, 0.0, 1.0).tolist())


def visible_contrasts(problem: FitProblem, fitted: PooledFit) -> tuple[FloatArray, list[str]]:
    """The isolable contrasts [N, m] Nm, with their axes: ι >= ISOLABLE beside a law's discrepancy of USUAL_LAW. The
    other contrasts are differences of the law, which the law's discrepancy covers already."""
    contrasts, axes = contrasts_of(problem.design, fitted.prediction)
    if problem.law is None or not axes:
        return contrasts, axes
    shown = isolability(problem, fitted, contrasts, LawSizes(*criteria.USUAL_LAW)) >= criteria.ISOLABLE
    return contrasts[:, shown], list(compress(axes, shown))


def template_error_factors(design: Design, fitted: PooledFit) -> tuple[list[FloatArray], FloatArray]:
    """Factors φ [N, m] of each effect's template error at the rows, and over all effects [Σ m] a 1 for each factor of
    the effect's own discrepancy, a 0 for the small ones that every template has."""
    small = small_factors_at(design.rows, ranges_of(design.rows))
    uncertain = [discrepancy_factors(design, effect.effect) for effect in fitted.effects]
    uncertain_by_itself = [np.repeat([1.0, 0.0], [factors.shape[1], small.shape[1]]) for factors in uncertain]
    return [np.concatenate([factors, small], axis=1) for factors in uncertain], np.concatenate(
        [np.zeros(0), *uncertain_by_itself]
    )


def template_error_columns(design: Design, fitted: PooledFit, factors: Sequence[FloatArray]) -> FloatArray:
    """Changes of torque [N, Σ m] Nm by a unit of each template error: each effect's change times each of its factors
    [N, m]."""
    rows = [effect.rows(design, fitted.prediction) for effect in fitted.effects]
    changes = [change[:, None] * effect_factors for change, effect_factors in zip(rows, factors, strict=True)]
    return np.concatenate([np.zeros((design.torque.size, 0)), *changes], axis=1)


def _template_error_gain(projected: Projected, templates: slice, uncertain: FloatArray) -> float:
    """Log Bayes factor [nats] of templates with errors over exact ones, averaged over TEMPLATE_ERRORS: pairs of prior
    deviations, of an effect's own discrepancy (where `uncertain` [m] is 1) and of the small errors of every template."""
    if not uncertain.size:
        return 0.0
    info, score = projected.info[templates, templates], projected.score[templates]
    return log_mean([log_gain(info, score, np.where(uncertain > 0, *size)) for size in criteria.TEMPLATE_ERRORS])


def structure_gain(info: FloatArray, score: FloatArray) -> float:
    """Log Bayes factor [nats] of smooth structure over none, averaged over its size and over all contrasts together or
    one of them alone."""
    values, vectors = independent(info)
    sizes = np.array(criteria.CONTRAST_SIZES)[:, None]
    together = log_gain_alone(values, vectors.T @ score, sizes).sum(axis=1)
    alone = [log_mean(gains) for gains in log_gain_alone(np.maximum(np.diag(info), 0.0), score, sizes)]
    return log_mean([*together.tolist(), *alone])


def _likeliest_coefficients(projected: Projected, columns: IntArray) -> FloatArray:
    """Posterior mean coefficients [k] of the smooth structure in these columns [k], at the size of highest evidence."""
    values, vectors = independent(projected.info[np.ix_(columns, columns)])
    score = vectors.T @ projected.score[columns]
    size = max(criteria.CONTRAST_SIZES, key=lambda size: float(log_gain_alone(values, score, size).sum()))
    return np.asarray(vectors @ (score / (values + size**-2.0)))


def _log_prior(fitted: PooledFit) -> float:
    """Log normalisation of the priors of the effects' amplitudes and smooth shapes [nats]. An amplitude of one sign has
    all of its prior there; one at its bound has one side of it, which `_log_integral_at_bounds` counts twice."""
    logs = [e.effect.log_amplitude_peak + 0.5 * float(np.log(e.precisions[1:]).sum()) for e in fitted.effects]
    halves = sum(int(e.effect.positive) - int(not e.free[0]) for e in fitted.effects)
    return sum(logs) + float(np.log(2.0)) * halves


def _outward_directions(fitted: PooledFit) -> FloatArray:
    """Direction ±1 out of its range at each parameter of the effects [h] that is at a bound; 0 for each that is free."""
    directions: list[float] = []
    for effect in fitted.effects:
        smooth = effect.effect.smooth(effect.shape)
        amplitude_out = 1.0 if effect.amplitude >= effect.effect.highest else -1.0
        out = np.array([amplitude_out, *(1.0 if 2 * x > shape.lowest + shape.highest else -1.0 for x, shape in smooth)])
        directions += np.where(effect.free, 0.0, out).tolist()
    return np.array(directions)


def _bounds_as_changes(gram: Gram, first: int, fitted: PooledFit) -> tuple[Gram, FloatArray]:
    """The Gram matrix with the columns of parameters at a bound moved from the baseline to the head of the changes, and
    the outward direction ±1 at each bound. The effects' columns begin at `first` behind the law's."""
    directions = _outward_directions(fitted)
    at_bound = gram.laws + first + np.flatnonzero(directions)
    order = np.concatenate(
        [np.setdiff1d(np.arange(gram.base), at_bound), at_bound, np.arange(gram.base, gram.matrix.shape[0])]
    )
    matrix, along, screened = gram.matrix[np.ix_(order, order)], gram.along[..., order], gram.screened
    if screened is not None:
        screened = replace(screened, cross=screened.cross[order])
    held = replace(gram, matrix=matrix, along=along, base=gram.base - at_bound.size, screened=screened)
    return held, directions[directions != 0]


def _log_integral_at_bounds(projected: Projected, held: slice, outward: FloatArray) -> float:
    """Log integral [nats] over the parameters at a bound, ∫ e^{-gt - ht²/2} dt for each over its inner side, scaled to
    that of a normal: all of the prior lies on one side, and where the data ask for values beyond the bound, the
    posterior falls off from there."""
    info = np.maximum(np.diag(projected.info)[held], 1e-300)
    slope = np.maximum(outward * projected.score[held], 0.0) / np.sqrt(2 * info)
    return float((np.log(erfcx(slope)) - 0.5 * np.log(info)).sum())
