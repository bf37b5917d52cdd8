"""How large the causes are: a sample of what the diagnosis does not know of them, and the few draws that stand for it.

A size bends with the course over life that is assumed for it: a pressure that grows as ζ^0.5 and one that grows as ζ^1.5
leave the same trace behind eq. 6 with opposite signs. Nor is it shrunk as the search for causes shrinks it, where most are
small: that it is there is known by now. So every explanation that stands is refitted under each course of its
effects (`Effect.courses`), and the courses are weighed by their evidence. About each refit the amplitudes are sampled, and
smooth shapes and the templates' discrepancies b given them (`amplitudes`), under each size of the templates' errors and
scatter of the gains, weighed by evidence. The size that is stated is that after the last state,
a (1 + Σ_k b_k φ_k) e^(f z): what a template calls an amplitude another rig's form of the same cause would call a little
differently, and no data of torque show it. The draws have no f, for their torque is what was measured. Explanations count
with their probability, with what may be beside them; what is left to one is nothing at work.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.design.design import Design
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Shape, Tried
from models.diagnosis.effects.fitted_effect import Draw, FittedEffect
from models.diagnosis.explanations.amplitude_posterior import Proportional
from models.diagnosis.explanations.evidence import evidence_of, template_error_columns, template_error_factors
from models.diagnosis.explanations.verdict import Judgement
from models.diagnosis.pooled_fit.gauss_newton import PooledFit, fit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import Gram, Projected, Reduced, coarse_projections, gram_of
from models.gaussian_evidence import log_sum

BoolArray: TypeAlias = NDArray[np.bool_]

#: Values of an amplitude that stand for its density.
_AMPLITUDES = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """The posterior of an effect's size after the last state, given that it is at work."""

    value: float
    sd: float
    interval: tuple[float, float]  # of 90 %
    other_sign: (
        float  # the probability that it is at work without the likelier sign, for nothing of it may be left by then
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """Posterior draws of a judgement's causes, and the size of each cause by slug."""

    draws: tuple[Draw, ...] = ()
    by_slug: Mapping[str, Size]

    @property
    def sign_is_open(self) -> bool:
        """Whether a cause's less likely sign has more than SIGN_UNDETERMINED of the probability."""
        return any(size.other_sign > criteria.SIGN_UNDETERMINED for size in self.by_slug.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class _Component:
    """A component of the posterior mixture: a refit with its weight and a normal about it."""

    weight: float
    fit: PooledFit
    mean: FloatArray  # of (amplitude, smooth shapes) of each effect, then their b
    root: FloatArray  # of the covariance
    trend: tuple[float, FloatArray]  # what a draw changes between the first state and the last, and its derivatives
    last: tuple[FloatArray, ...]  # φ after the last state by effect

    def effects(self, off: FloatArray) -> tuple[FittedEffect, ...]:
        """The fitted effects at one sample [m] of the component."""
        drawn, at, after = [], 0, sum(1 + len(fitted.smooth_places) for fitted in self.fit.effects)
        for fitted, last in zip(self.fit.effects, self.last, strict=True):
            shape = list(fitted.shape)
            for place, move in zip(fitted.smooth_places, off[at + 1 :], strict=False):
                parameter = fitted.effect.shapes[place]
                shape[place] = float(np.clip(shape[place] + move, parameter.lowest, parameter.highest))
            amplitude = fitted.amplitude + float(off[at])
            drawn.append(
                FittedEffect(
                    effect=fitted.effect,
                    amplitude=float(np.clip(amplitude, fitted.effect.lowest, fitted.effect.highest)),
                    shape=tuple(shape),
                    factors=tuple(off[after : after + last.size].tolist()),
                )
            )
            at, after = at + 1 + len(fitted.smooth_places), after + last.size
        return tuple(drawn)

    def sizes(self, drawn: Sequence[FittedEffect]) -> list[float]:
        """Sizes of the effects after the last state, template errors included."""
        return [
            effect.amplitude * max(1.0 + float(last @ np.array(effect.factors)), 0.0)
            for effect, last in zip(drawn, self.last, strict=True)
        ]


def sizes_of(problem: FitProblem, judgement: Judgement, rng: np.random.Generator) -> Sizes:
    """Posterior of the size of each of a judgement's causes, and at most DRAWS draws of equal weight that stand for it:
    the middle sample of each stratum of all samples in order of their change over life. None where nothing was fitted."""
    components = [
        component
        for fitted, share in _shares(judgement)
        for component in _components_of_courses(problem, fitted, share, rng)
    ]
    if not components:
        return Sizes(by_slug={})
    samples, sizes = _sampled(components, judgement.causes, rng)
    samples += [_Sample(trend=0.0, component=0, effects=())] * (
        criteria.SIZES_SAMPLED - len(samples)
    )  # nothing at work
    samples.sort(key=lambda sample: sample.trend)
    strata = np.array_split(np.arange(len(samples)), min(criteria.DRAWS, len(samples)))
    chosen = [samples[stratum[stratum.size // 2]] for stratum in strata]
    return Sizes(
        draws=tuple(
            Draw(weight=1.0 / len(chosen), laws=components[one.component].fit.laws, effects=one.effects)
            for one in chosen
        ),
        by_slug={slug: _size(np.array(sizes[slug])) for slug in sizes if slug in judgement.causes},
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sample:
    """One sample of a component, by its index: the named causes' effects, and what all effects change [Nm] between the
    first state and the last."""

    trend: float
    component: int
    effects: tuple[FittedEffect, ...]


def _sampled(
    components: Sequence[_Component], causes: Collection[str], rng: np.random.Generator
) -> tuple[list[_Sample], dict[str, list[float]]]:
    """Samples of the components, as many of each as its weight times SIZES_SAMPLED, and the sampled sizes of each effect
    by slug, with the error e^(f z) of a template's form."""
    weight = np.array([component.weight for component in components])
    counts = np.diff(np.floor(np.cumsum(weight) * criteria.SIZES_SAMPLED + rng.random()), prepend=0.0).astype(int)
    width = max(component.mean.size for component in components)
    samples: list[_Sample] = []
    sizes: dict[str, list[float]] = {}
    for index, (component, count) in enumerate(zip(components, counts.tolist(), strict=True)):
        offs = component.mean + rng.standard_normal((count, width))[:, : component.mean.size] @ component.root.T
        trends = component.trend[0] + offs @ component.trend[1]
        for off, trend in zip(offs, trends.tolist(), strict=True):
            effects = component.effects(off)
            for effect, size in zip(effects, component.sizes(effects), strict=True):
                form = float(np.exp(criteria.SIZE_FORM * rng.standard_normal()))
                possible = float(np.clip(size * form, effect.effect.lowest, effect.effect.highest))
                sizes.setdefault(effect.effect.slug, []).append(possible)
            named = tuple(effect for effect in effects if effect.effect.slug in causes)
            samples.append(_Sample(trend=trend, component=index, effects=named))
    return samples, sizes


def _shares(judgement: Judgement) -> list[tuple[PooledFit, float]]:
    """The fits of the explanations that stand, with their probabilities, whose sum is at most one. An explanation with
    further causes beside one that stands counts for the largest one it contains."""
    shares = [0.0] * len(judgement.stand)
    for each in judgement.explanations:
        places = [k for k, cause in enumerate(judgement.stand) if set(cause.slugs) <= {*each.effects}]
        if places:
            shares[max(places, key=lambda k: len(judgement.stand[k].slugs))] += each.probability
    return [(cause.fit, share) for cause, share in zip(judgement.stand, shares, strict=True) if share > 0.0]


def _size(sizes: FloatArray) -> Size:
    """Mean, standard deviation, 90 % interval and sign uncertainty of a size from samples [n]."""
    likelier = max(float((sizes > 0).mean()), float((sizes < 0).mean()))
    low, high = np.quantile(sizes, (0.05, 0.95)).tolist()
    return Size(
        value=float(sizes.mean()),
        sd=float(sizes.std()),
        interval=(low, high),
        other_sign=(1.0 - likelier) * sizes.size / criteria.SIZES_SAMPLED,
    )


def _components_of_courses(
    problem: FitProblem, original: PooledFit, share: float, rng: np.random.Generator
) -> Iterator[_Component]:
    """Components of the posterior of a fit's effects, refitted under each of their courses and weighted by evidence;
    under the fitted shapes if they have no courses."""
    # a prior that is nearly flat in a size's logarithm: that the effect is at work is decided already
    flat = [replace(e.effect, tails=min(e.effect.tails, criteria.SIZE_TAILS)) for e in original.effects]
    effects = [replace(e, effect=effect) for e, effect in zip(original.effects, flat, strict=True)]
    fitted = replace(original, effects=tuple(effects))
    courses = list(_course_refits(problem, fitted))
    if not courses:
        courses = [(0.0, fit(problem, fitted.laws, fitted.effects, steps=criteria.FEW_STEPS))]
    logs = np.array([log for log, _ in courses])
    weights = np.exp(logs - logs.max())
    for weight, (_, fitted) in zip((share * weights / weights.sum()).tolist(), courses, strict=True):
        if weight > share / criteria.SIZES_SAMPLED:
            yield from _components_about(problem, fitted, weight, rng)


def _course_refits(problem: FitProblem, fitted: PooledFit) -> Iterator[tuple[float, PooledFit]]:
    """Refits with each effect in turn under its other courses, and their log weights [nats], without negligible ones.

    Of each kind of course the one most like the fitted one is refitted first, and then its neighbours as long as their
    weights count."""
    best = -np.inf
    for place, effect in enumerate(fitted.effects):
        for kind in _kinds_of_courses(effect, problem.design.facts):
            first = _most_alike(fitted, effect, kind)
            for way in (range(first, len(kind)), range(first - 1, -1, -1)):
                near = fitted
                for index in way:
                    refit = _refit_under(problem, near, place, _with_free(kind[index].shape, effect))
                    if not np.isfinite(refit.cost) or refit.wrong_sign:
                        break
                    log = evidence_of(problem, refit, smooth=False).whole + kind[index].log_weight
                    best = max(best, log)
                    if log < best - 10.0:  # e^-10
                        break
                    near = refit
                    yield log, refit


def _kinds_of_courses(fitted: FittedEffect, facts: Facts) -> list[list[Tried]]:
    """Courses over life under which an effect may be refitted, by kind (the first of the shapes); empty without any."""
    kinds: dict[float, list[Tried]] = {}
    for tried in fitted.effect.courses(facts) if fitted.effect.courses is not None else ():
        kinds.setdefault(tried.shape[0], []).append(tried)
    return list(kinds.values())


def _refit_under(problem: FitProblem, near: PooledFit, place: int, shape: Shape) -> PooledFit:
    """Refit that starts at the fit `near`, with the effect at that place in this shape; shapes that a course holds are
    not fitted."""
    effects, fitted = near.effects, near.effects[place]
    shapes = tuple(replace(one, smooth=one.smooth and not one.held) for one in fitted.effect.shapes)
    tried = replace(fitted, effect=replace(fitted.effect, shapes=shapes), shape=shape)
    return fit(problem, near.laws, (*effects[:place], tried, *effects[place + 1 :]), steps=criteria.FEW_STEPS)


def _with_free(shape: Shape, fitted: FittedEffect) -> Shape:
    """The shape of a course; if it is of the fitted kind, with the fitted values of the smooth shapes that are not
    held."""
    if shape[0] != fitted.shape[0]:
        return shape
    own = zip(shape, fitted.shape, fitted.effect.shapes, strict=True)
    return tuple(was if parameter.smooth and not parameter.held else value for value, was, parameter in own)


def _most_alike(fitted: PooledFit, effect: FittedEffect, kind: Sequence[Tried]) -> int:
    """Index of the course whose change of torque is most nearly parallel to that of the fitted effect."""
    scene = fitted.prediction.scene
    change = effect.effect.change(scene, effect.amplitude, effect.shape)
    other_changes = effect.effect.changes(scene, [(effect.amplitude, tried.shape) for tried in kind])
    along = np.abs(change @ other_changes) / np.maximum(np.linalg.norm(other_changes, axis=0), 1e-300)
    return int(np.argmax(along))


def _likely_projections(whole: Gram, gram: Gram, problem: FitProblem) -> Iterator[Projected]:
    """Projections of a fit's effects at each scatter of the gains and size of the law with at least NEGLIGIBLE of the
    posterior about the fit."""
    about = coarse_projections(whole, problem.noise)
    total = log_sum([projected.evidence for projected in about])
    reduced: dict[tuple[float, float], Reduced] = {}
    for projected in about:
        if projected.evidence > total + np.log(criteria.NEGLIGIBLE):
            gains = projected.run_gain, projected.curve_gain
            if gains not in reduced:
                reduced[gains] = gram.reduced(*gains)
            yield reduced[gains].beside_law(projected.sizes, projected.log_weight)


@dataclass(frozen=True, slots=True, kw_only=True)
class _TemplateErrors:
    """Errors of the templates of a fit's effects at the rows."""

    factors: list[FloatArray]  # φ [N, m] of each effect
    uncertain: FloatArray  # [Σ m] 1 for each factor of an effect's own discrepancy, 0 for the small ones
    columns: FloatArray  # [N, Σ m] Nm, the change of torque by a unit of each


def _components_about(
    problem: FitProblem, fitted: PooledFit, weight: float, rng: np.random.Generator
) -> Iterator[_Component]:
    """Components of the mixture about a refit of that weight: sampled amplitudes with a normal of all else about each,
    for each non-negligible combination of scatter of the gains, size of the law and size of the templates' errors."""
    design, effects = problem.design, fitted.effects
    factors, uncertain = template_error_factors(design, fitted)
    errors = _TemplateErrors(
        factors=factors, uncertain=uncertain, columns=template_error_columns(design, fitted, factors)
    )
    supposed = _amplitude_posteriors(problem, fitted, errors)
    last, first = _end_states(design)
    columns = np.concatenate([*(e.columns(design, fitted.prediction) for e in effects), errors.columns], axis=1)
    whole = np.sum([effect.rows(design, fitted.prediction) for effect in effects], axis=0)
    rising = columns[last].mean(axis=0) - columns[first].mean(axis=0)
    trend = float(whole[last].mean() - whole[first].mean())
    at_end = tuple(own_factors[last].mean(axis=0) for own_factors in factors)
    total = log_sum([log for log, _ in supposed])
    for log, one in supposed:
        share = weight * float(np.exp(log - total))
        if share * criteria.SIZES_SAMPLED >= 1.0:
            count = int(np.ceil((_AMPLITUDES * share) ** (1.0 / len(effects))))
            for sample in one.amplitudes(count, rng):
                mean, root = one.normal(sample)
                rises = rising * one.ratio(sample)
                part = share / count ** len(effects)
                yield _Component(weight=part, fit=fitted, mean=mean, root=root, trend=(trend, rises), last=at_end)


def _amplitude_posteriors(
    problem: FitProblem, fitted: PooledFit, errors: _TemplateErrors
) -> list[tuple[float, Proportional]]:
    """Log evidence [nats] and posterior of the amplitudes under each likely scatter of the gains and size of the law,
    and each size of the templates' errors (TEMPLATE_ERRORS)."""
    whole_gram = gram_of(problem, fitted, errors.columns)
    gram = replace(whole_gram, base=whole_gram.laws + int(problem.priors.free.sum()))
    effects, places = fitted.effects, np.arange(len(fitted.effects))
    priors = [np.array([np.inf, *(effect.precisions[1:] ** -0.5)]) for effect in effects]
    of_shapes, of_errors = [prior.size for prior in priors], [off.shape[1] for off in errors.factors]
    shapes, of = np.concatenate(priors), np.concatenate([np.repeat(places, of_shapes), np.repeat(places, of_errors)])
    supposed = []
    for projected in _likely_projections(whole_gram, gram, problem):
        info = projected.info.copy()
        info[np.diag_indices(shapes.size)] -= np.where(np.isinf(shapes), 0.0, shapes**-2.0)  # their priors stand in sd
        for size in criteria.TEMPLATE_ERRORS:
            sd = np.concatenate([shapes, np.where(errors.uncertain > 0, *size)])
            one = Proportional(info=info, score=projected.score, sd=sd, of=of, effects=effects)
            supposed.append((projected.evidence + one.log_integral(), one))
    return supposed


def _end_states(design: Design) -> tuple[BoolArray, BoolArray]:
    """Masks [N] of the closed clutch's plateaus at the last state and at the first."""
    steady = design.closed & design.rows.steady
    states = design.rows.cycles[steady]
    return steady & (design.rows.cycles == states.max()), steady & (design.rows.cycles == states.min())
