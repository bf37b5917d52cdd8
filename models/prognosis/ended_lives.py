"""What lives of the same kind that have ended say of one that has not: where they ended, and along which course.

The measured course of an ended life, stretched in ζ and a little in size, is one more course that a clutch may take: "as
clutch 12, 1.1 times as long". With D = (1 - y/y_0)/(1 - fraction) the share of the way to the threshold that is behind,

    D(ζ) = x + (1 + a) b_j(ζ T_j/T) + δ(ζ) + steps + e,     b_j the D of ended life j, which ended at T_j

is linear in x and a given life j, the end T and the deviations of e (s) and of δ (q at T): δ is an integrated random
walk, as beside any other course (`models.tracking.discrepancy`). All that is linear is integrated out, and the evidence of
a clutch's tests weighs every j, T, q and s. Where the clutch then crosses the threshold follows from x, a and δ. As no
life is another one stretched evenly, log T has a further deviation ω(q) r^1.5 √(1 + 2/n), r the share of it that remains, by
n lives. The prior of T is the predictive of the others' log ends about their median c, Student's t, given that the clutch is
alive:

    p(T) ∝ t((log T - c - μ)/σ) · Σ w_jqs(T') N(log T; log T', ...),    T > ζ

A clutch of the kind may also take a course that none of them took: three plain ones stand beside theirs. Or it follows a
law that its own filter knows (eq. 6, a straight line, a logarithm, ...): then that filter knows the end best, and its draws
are weighted by the predictive. How probable each law is depends on the kind: the exact filter knows of every ended life how
probably its whole course is that law with the least discrepancy, and the shares of the filter's forms among the kind are the
mean of a Dirichlet distribution about their prior. So the kind teaches the filter its law, and each draw counts by how much
more probable its form is for it; those of a law that the clutch's own tests contradict count for little.

A clutch of another kind takes one of all these courses with an end anywhere, or a plain one, or has the end that its filter
gives: the evidence says how probable that is, and with that probability the ended lives say nothing. That a clutch has
outlived the others is part of it.

An end may be uncertain: a life that was declared worn just short of its threshold. Its log T has a deviation, whose square
the predictive has more in its sum of squares (the expected one). Or it is censored: a life that was taken out at C for
another reason says T > C, a factor 1 - F(log C) in the likelihood of the predictive's mean and deviation, which are then
averaged over numerically; it has no end, so it is no course.

Source: A. Gelman et al., Bayesian Data Analysis (2013) ch. 3, for the predictive.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv, log_ndtr, logsumexp, ndtri

from models.arrays import FloatArray
from models.prognosis import criteria
from models.prognosis.first_passage import Offset, ends_of_life
from models.tracking.courses import FORM_COURSE, LEAST_DISCREPANCY, CourseForm, log_form_weight
from models.tracking.criteria import STEP_SIZE
from models.tracking.filters.grid import Grid
from models.tracking.history import later_epochs, step_sizes
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import weak
from models.tracking.sampling import tempered

_GRID = Grid()
#: Ends T that are tried, and places of the density that is stated.
_ENDS = 50
#: How far beyond the latest end, and before the present age, the end of a course is looked for, in logarithms.
_BEYOND = 0.7
#: How far beyond the present age a clutch of another kind may end, in logarithms: a thousandfold.
_ANYWHERE = 7.0
#: Deviation of x: tests may begin when half of the way is behind.
_LEVEL_SD = 0.5
#: The laws of a life of which it is not known that it follows any.
_NO_LAWS = (0.0,) * len(CourseForm)


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservedLife:
    """An ended life: its end [ζ] by the criterion's `fraction`, and its course until then: `progress` [t] and `damage`
    [t] of its tests, the share of the way to the threshold; the mean energy [J] of its cycles, None where its duty does
    not state it.

    `deviation` is that of the logarithm of an uncertain end; of a `censored` life `end` is when it was taken out before it;
    `laws` are the probabilities that its whole course is each `CourseForm` with the least discrepancy.
    """

    end: float
    fraction: float
    progress: tuple[float, ...]
    damage: tuple[float, ...]
    energy: float | None = None
    deviation: float = 0.0
    censored: bool = False
    laws: tuple[float, ...] = _NO_LAWS

    @property
    def final_pace(self) -> float:
        """Slope of the course over the last tenth of the life, d(damage)/d(share of life), at least 0.3."""
        return max(10.0 * (1.0 - self._inside(np.array(0.9)).item()), 0.3)  # never flatter than 0.3 of its mean pace

    def course(self, share: FloatArray) -> FloatArray:
        """Course b at shares of the life >= 0, any shape: linear between its tests and beyond its end."""
        return np.where(share > 1.0, 1.0 + self.final_pace * (share - 1.0), self._inside(share))

    def _inside(self, share: FloatArray) -> FloatArray:
        """Damage at shares of the life up to 1, straight between its tests."""
        shares = np.append(np.array(self.progress) / self.end, 1.0)
        return np.asarray(np.interp(share, shares, np.append(self.damage, 1.0)))

    def in_unit(self, cycles: float) -> "ObservedLife":
        """The life with ζ counted in units of `cycles`."""
        return replace(self, end=self.end / cycles, progress=tuple(zeta / cycles for zeta in self.progress))

    def to_dict(self) -> dict[str, Any]:
        """The life as values that JSON can carry."""
        return asdict(self) | {name: list(getattr(self, name)) for name in _COLUMNS}

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> "ObservedLife":
        """The inverse of `to_dict`, exactly."""
        return cls(**{**stored, **{name: tuple(stored[name]) for name in _COLUMNS}})


#: What of an ended life is a series of numbers.
_COLUMNS = ("progress", "damage", "laws")


def ended_life(
    progress: FloatArray,
    values: FloatArray,
    end: float,
    *,
    initial: float,
    fraction: float,
    laws: tuple[float, ...] = _NO_LAWS,
) -> ObservedLife | None:
    """The observed life of a clutch that ended at ζ = `end` > 0, from its tests at progress [n] >= 0 with values [n].

    `initial` > 0 is the value when new, `laws` as `new_and_laws` has them. None where it was measured at fewer than
    FEWEST_TESTS different ζ before its end.
    """
    before = np.flatnonzero(progress < end)
    at, where = np.unique(progress[before], return_inverse=True)
    if at.size < criteria.FEWEST_TESTS:
        return None
    mean = np.bincount(where, weights=values[before]) / np.bincount(where)
    damage = (1.0 - mean / initial) / (1.0 - fraction)
    return ObservedLife(
        end=end, fraction=fraction, progress=tuple(at.tolist()), damage=tuple(damage.tolist()), laws=laws
    )


def new_and_laws(history: Sequence[Measurement]) -> tuple[float, tuple[float, ...]]:
    """Posterior mean of ξ0 of a life by its measurements in order, by the exact filter under the weak prior, and the
    probabilities that its course is each `CourseForm` with the least discrepancy."""
    drawn = _drawn(history)
    lawful = drawn.weight * LEAST_DISCREPANCY[drawn.form]
    laws = np.bincount(drawn.course, weights=lawful, minlength=len(CourseForm))
    return float(drawn.weight @ drawn.initial), tuple(laws.tolist())


def _drawn(history: Sequence[Measurement]) -> TrackPosterior:
    """500 draws of eq. 6's coefficients from the exact posterior under the weak prior."""
    prior = weak(history[0], falling=True)
    return _GRID.posterior(_GRID.from_history(prior, history), 500, np.random.default_rng(0))


def declared_end(
    history: Sequence[Measurement], at: float, *, fraction: float, horizon: float, offset: Offset | None = None
) -> tuple[float, float]:
    """The estimated end [ζ] of a life that was declared worn at ζ = `at` > 0 before any test passed its threshold, and
    the standard deviation of its logarithm.

    x = log T - log at is exponential with the mean DECLARED_EARLY, for nobody declares a life worn that has most of itself
    to come. The exact filter's draws of x >= 0, those before `at` being at it, are weighted by exp(-x/DECLARED_EARLY); and
    with DECLARED_UNSEEN to one against them all the tests show nothing of what ended the life, and x is that alone.
    """
    posterior = _drawn(history)
    ends = ends_of_life(posterior, fraction, offset=offset, horizon=horizon)
    early = np.log(np.clip(ends, at, horizon) / at)
    weight = posterior.weight * np.exp(-early / criteria.DECLARED_EARLY)
    total = float(weight.sum()) + criteria.DECLARED_UNSEEN
    mean = (float(weight @ early) + criteria.DECLARED_UNSEEN * criteria.DECLARED_EARLY) / total
    square = (float(weight @ early**2) + 2.0 * criteria.DECLARED_UNSEEN * criteria.DECLARED_EARLY**2) / total
    return at * math.exp(mean), math.sqrt(max(0.0, square - mean**2))


def representative(lives: Sequence[ObservedLife], most: int = 40) -> list[ObservedLife]:
    """The lives, or a subset of `most` of them, evenly chosen by their ends: with 40 their predictive is within 3 % of
    the normal's width, and each costs every answer 0.1 ms."""
    if len(lives) <= most:
        return list(lives)
    ordered = sorted(lives, key=lambda life: life.end)
    places = np.round(np.linspace(0, len(ordered) - 1, most)).astype(int)
    return [ordered[place] for place in places.tolist()]


@dataclass(frozen=True, slots=True, kw_only=True)
class Kin:
    """Evidence of ended lives about a clutch's end of life.

    If a clutch takes one of their courses: `ends` [n] with weights [n] that sum to one, and the `log_odds` of its tests that
    it is of their kind. If it follows a law of its own filter, that knows the end, and `predictive` is that of
    log(T/`centre`). `lawful` is the share of their kind that does, and `lean` what share of the kind has each form
    (`courses`), over its share of the filter's prior.
    """

    ends: FloatArray
    weight: FloatArray
    log_odds: float
    lawful: float
    lean: FloatArray
    predictive: "_Predictive"
    centre: float

    def together(
        self, own: FloatArray, weight: FloatArray, form: NDArray[np.intp], as_of: float
    ) -> tuple[FloatArray, FloatArray]:
        """The end of life as a weighted sample: a filter's `own` ends [n] with weights [n] that sum to one and forms
        [n], combined with the ends of the kind.

        It holds these as they are (all of those behind `as_of`), under the forms' shares and weighted by the predictive, and
        `ends`. How much the clutch's tests speak for the forms of the kind is evidence against its courses. How well those
        draws agree with the predictive, against an end anywhere, is evidence that the clutch is of the kind, and none for a
        law against their courses. Where few of them agree it is tempered: one draw is no certainty.
        """
        ahead = own > as_of
        near = ahead & np.isfinite(own)
        left = float(weight[ahead].sum())
        by_form = np.where(ahead, weight * self.lean[form], 0.0)
        log_agreeing = self.predictive.log_density(np.log(own[near] / self.centre))
        agreed, evidence = float(by_form[near] @ np.exp(log_agreeing)), float(by_form.sum())
        agreeing = np.zeros(own.size)
        if agreed > 0.0:
            agreeing[near] = tempered(by_form[near], log_agreeing)
        lawful = evidence / (evidence + left * (1.0 - self.lawful)) if agreed > 0.0 else 0.0
        by_law = lawful * _ANYWHERE * agreed / evidence if lawful else 0.0
        by_course = (1.0 - lawful) * math.exp(self.log_odds)
        odds = (by_law + by_course) * (1.0 - criteria.OTHER_KIND) / criteria.OTHER_KIND
        of_kind = odds / (1.0 + odds)
        parts = [
            np.where(ahead, 1.0 - of_kind, 1.0) * weight,
            left * of_kind * lawful * agreeing,
            left * of_kind * (1.0 - lawful) * self.weight,
        ]
        return np.concatenate([own, own, self.ends]), np.concatenate(parts)


def as_its_kind(
    tests: Sequence[Measurement], as_of: float, lives: Sequence[ObservedLife], offset: FloatArray | None = None
) -> Kin | None:
    """The evidence of ended lives for a clutch that is alive at ζ = `as_of` > 0, given its tests.

    `offset` [t] is added to the tests' values. None of fewer than two lives that are not censored, of fewer than
    FEWEST_TESTS tests at different ζ, or where the first value is not positive. Kept for the next filter, which asks it of
    the same tests.
    """
    return _as_its_kind(tuple(tests), as_of, tuple(lives), None if offset is None else tuple(offset.tolist()))


@lru_cache(maxsize=8)
def _as_its_kind(
    tests: tuple[Measurement, ...], as_of: float, lives: tuple[ObservedLife, ...], offset: tuple[float, ...] | None
) -> Kin | None:
    """What ended lives of its kind say about the end of this life; None with fewer than two ended lives or too few
    tests."""
    exact = np.array([not life.censored for life in lives], dtype=bool)
    # two lives say more than none (`make real`)
    if np.count_nonzero(exact) < 2 or len({test.progress for test in tests}) < criteria.FEWEST_TESTS:
        return None
    decline = _Decline.of(tests, None if offset is None else np.array(offset), lives[0].fraction)
    if decline is None:
        return None
    log_ends = np.log([life.end for life in lives])
    centre = float(np.median(log_ends[exact]))
    variance = np.array([life.deviation**2 for life in lives])
    of_ends = _predictive(log_ends - centre, variance, exact, criteria.VAGUE, criteria.END_WORTH)
    now, earliest = math.log(as_of), math.log(decline.span) - 0.2
    latest = max(float(log_ends.max()), now) + _BEYOND
    log_end = np.linspace(earliest, latest, _ENDS)
    clock = decline.progress / np.exp(log_end)[:, None]
    courses = [life for life, counts in zip(lives, exact, strict=True) if counts]
    kin = decline.nodes(log_end, np.concatenate([[life.course(clock) for life in courses], _plain_courses(clock)]))
    pace = np.array([*(life.final_pace for life in courses), *_PLAIN_PACES])
    wander = np.repeat(criteria.COURSE_STRETCH_SD, criteria.COURSE_SCATTERS.size) * math.sqrt(1.0 + 2.0 / len(courses))
    middle, deviation, share = kin.crossings(decline, log_end, pace, as_of, wander)
    places = now + (latest + _BEYOND - now) * np.linspace(0.0, 1.0, 400 + 1)[1:] ** 1.5
    density = np.exp(-0.5 * np.square((places[:, None] - middle) / deviation)) @ (share / deviation)
    log_prior = of_ends.log_density(places - centre)
    stated = density * np.exp(log_prior - log_prior.max()) * np.gradient(places)
    if not stated.any():
        return None
    lawful, lean = _forms(tests[0], courses)
    return Kin(
        ends=np.exp(places),
        weight=stated / stated.sum(),
        log_odds=_log_odds_of_kind(decline, kin, log_end, of_ends.log_density(log_end - centre)),
        lawful=lawful,
        lean=lean,
        predictive=of_ends,
        centre=math.exp(centre),
    )


def _log_odds_of_kind(decline: "_Decline", kin: "_Nodes", log_end: FloatArray, log_density: FloatArray) -> float:
    """Log odds [nats] that a life's tests belong to the kind of the ended lives: their evidence with an end from the
    predictive density of ln ζ, `log_density` at `log_end` [e], over that with an end anywhere, on courses of the kind or
    on plain ones, half each."""
    log_anywhere = np.linspace(log_end[0], log_end[0] + _ANYWHERE, _ENDS)
    plain = decline.nodes(log_anywhere, _plain_courses(decline.progress / np.exp(log_anywhere)[:, None])).log_evidence
    step, courses = log_end[1] - log_end[0], math.log(kin.log_evidence.shape[2])
    log_prior = log_density + math.log(step)
    of_kind = logsumexp(kin.log_evidence + log_prior[:, None, None]) - courses
    anywhere = logsumexp(kin.log_evidence) + math.log(step / _ANYWHERE) - courses
    others = logsumexp(plain) - math.log(_ENDS * plain.shape[2])
    return float(of_kind - (np.logaddexp(anywhere, others) - math.log(2.0)))


def _forms(first: Measurement, lives: Sequence[ObservedLife]) -> tuple[float, FloatArray]:
    """The share of a kind that follows a law of the filter of a series that begins with `first`, estimated from its
    ended lives, and the forms' shares in the kind over those in the filter's prior [f]."""
    prior = np.exp(log_form_weight(weak(first, falling=True)))
    by_law = np.bincount(FORM_COURSE, weights=prior * LEAST_DISCREPANCY)
    taught = np.sum([life.laws for life in lives], axis=0)
    worth = criteria.LAWFUL_WORTH[0] + LEAST_DISCREPANCY * (taught / by_law)[FORM_COURSE]
    lean = worth / (sum(criteria.LAWFUL_WORTH) + len(lives))
    return float(lean @ prior), lean


@dataclass(frozen=True, slots=True, kw_only=True)
class _Decline:
    """A clutch's tests rotated to coordinates in which its scatter and δ are independent: `damage` [n], `features`
    [n, p] (x and the steps, for deviations of 1), `turn` [n, n], the rotation, and δ's variances `walk` [n] for q = 1
    at the `span`; and their `progress` [n]. `sizes` [p] is how far each feature moves the crossing."""

    progress: FloatArray
    span: float
    damage: FloatArray
    features: FloatArray
    sizes: FloatArray
    turn: FloatArray
    walk: FloatArray

    @classmethod
    def of(cls, tests: Sequence[Measurement], offset: FloatArray | None, fraction: float) -> "_Decline | None":
        """The decline of a life's tests, in coordinates in which δ and scatter are independent; None if the first value
        is not positive."""
        rows = [(t.progress, t.value, t.variance, t.epoch, t.new_levels) for t in tests]
        progress, value, variance, epoch, new_levels = np.array(rows).T
        value = value if offset is None else value + offset
        first = value[progress.argmin()]
        if first <= 0.0:
            return None
        damage, span = (1.0 - value / first) / (1.0 - fraction), float(progress.max())
        # half of the scatter is taken to be that of the fits: a test that is known badly counts for less
        noise = np.sqrt(0.5 + 0.5 * variance / variance.mean()) if variance.any() else np.ones(value.size)
        sizes = step_sizes(epoch, new_levels, STEP_SIZE) / (1.0 - fraction)
        steps = (epoch[:, None] >= np.array(later_epochs(epoch))) * sizes
        features = np.column_stack([np.full(value.size, _LEVEL_SD), steps])
        walk, turn = np.linalg.eigh(_walked(progress / span, (progress / span)[:, None]) / np.outer(noise, noise))
        turn = turn / noise[:, None]
        return cls(
            progress=progress,
            span=span,
            damage=damage @ turn,
            features=turn.T @ features,
            sizes=np.array([_LEVEL_SD * (1.0 - fraction), *sizes]),
            turn=turn,
            walk=np.maximum(walk, 0.0),
        )

    def nodes(self, log_end: FloatArray, courses: FloatArray) -> "_Nodes":
        """Log evidence and posterior moments of the linear model

            damage = (1 + a) b + features · β + δ + scatter,     a ~ N(0, COURSE_SIZE_SD²),  β ~ N(0, 1)

        at each end of life [e] (`log_end`), for every course b of `courses` [j, e, n] and every pair of deviations of δ
        and of the scatter."""
        size = np.repeat(criteria.COURSE_DISCREPANCIES, criteria.COURSE_SCATTERS.size)
        scatter = np.tile(criteria.COURSE_SCATTERS, criteria.COURSE_DISCREPANCIES.size)
        size = size * ((self.span * np.exp(-log_end)) ** 1.5)[:, None]
        weight = 1.0 / (np.square(size)[..., None] * self.walk + np.square(scatter)[:, None])
        b, x, d = np.moveaxis(courses @ self.turn, 0, 2), self.features, self.damage
        of_b = np.stack([weight @ (b * column[:, None]) for column in x.T], axis=-1)
        of_d, gram = (weight * d) @ x, np.einsum("ekn,np,nq->ekpq", weight, x, x, optimize=True)
        inverse = np.linalg.inv(np.eye(x.shape[1]) + gram)
        solved = np.einsum("ekpq,ekq->ekp", inverse, of_d)
        # products of b and the damage d, with the features eliminated
        bb = weight @ np.square(b) - np.einsum("ekjp,ekpq,ekjq->ekj", of_b, inverse, of_b, optimize=True)
        bd = weight @ (b * d[:, None]) - np.einsum("ekjp,ekp->ekj", of_b, solved)
        dd = ((weight * d) @ d - (of_d * solved).sum(axis=2))[..., None]
        precision = bb + criteria.COURSE_SIZE_SD**-2
        taller = (bd - bb) / precision
        fixed = np.log(weight).sum(axis=2) + np.linalg.slogdet(inverse)[1]
        log_evidence = 0.5 * (fixed[..., None] - dd + 2.0 * bd - bb + taller * (bd - bb) - np.log(precision))
        return _Nodes(
            log_evidence=log_evidence - math.log(criteria.COURSE_SIZE_SD),
            size=size,
            weight=weight,
            taller=taller,
            taller_variance=1.0 / precision,
            features=solved[:, :, None] - (1.0 + taller)[..., None] * np.einsum("ekpq,ekjq->ekjp", inverse, of_b),
            courses=b,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Nodes:
    """Results at each end, pair of deviations (of δ, of the scatter) and course: the log evidence, the mean and the
    variance of a, each [e, k, j], and the mean of the features [e, k, j, p]; by end and pair δ's deviation at the span
    [e, k] and the weights of the numbers [e, k, n]; the courses [e, n, j]."""

    log_evidence: FloatArray
    size: FloatArray
    weight: FloatArray
    taller: FloatArray
    taller_variance: FloatArray
    features: FloatArray
    courses: FloatArray

    def crossings(
        self, decline: _Decline, log_end: FloatArray, pace: FloatArray, as_of: float, wander: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Crossings of the threshold under the nodes that hold 99.9 % of the evidence: log ζ [m], its standard
        deviation [m], and the nodes' shares of the evidence [m]. `pace` [j] is the slope of every course at its end,
        `wander` [k] the deviation of the logarithm where all of the life is to come.

        Where the damage at a node's end is 1 + x, it is 1 at the share 1 - x/p of that end along the slope p: log ζ =
        log end + ln(1 - x/p).
        """
        share = np.exp(self.log_evidence - self.log_evidence.max()).ravel()
        order = np.argsort(share)[::-1]
        within = np.cumsum(share[order])
        nodes_kept = order[: int(np.searchsorted(within, 0.999 * within[-1])) + 1]
        e, k, j = np.unravel_index(nodes_kept, self.log_evidence.shape)
        beyond, spread = self._damage_at_end(decline, log_end, (e, k, j))
        farthest = 3.0  # a course crosses the threshold at most so much later than its end [T]
        early = np.clip(beyond / pace[j], -farthest, 1.0 - 1.0 / (1.0 + farthest))
        to_come = np.maximum(1.0 - as_of / np.exp(log_end[e]), 0.0)
        step = (log_end[1] - log_end[0]) / math.sqrt(12.0)
        deviation = np.sqrt(spread / np.square(pace[j]) + np.square(wander[k] * to_come**1.5) + step**2)
        return log_end[e] + np.log1p(-early), deviation, share[nodes_kept] / share[nodes_kept].sum()

    def _damage_at_end(
        self, decline: _Decline, log_end: FloatArray, nodes: tuple[NDArray[np.intp], ...]
    ) -> tuple[FloatArray, FloatArray]:
        """Mean, less 1, and variance [m] of the damage at the end of each of the nodes [m], given the tests: of the
        course's size and the features, and of δ led on from the tests to that end."""
        e, k, j = nodes
        end, weight, variance = np.exp(log_end[e]), self.weight[e, k], np.square(self.size[e, k])
        ahead = np.maximum(end / decline.span, 1.0)
        across = _walked(decline.progress / decline.span, ahead[:, None]) @ decline.turn
        features, taller = self.features[e, k, j], self.taller[e, k, j]
        left = decline.damage - features @ decline.features.T - (1.0 + taller)[:, None] * self.courses[e, :, j]
        beyond = taller + features @ decline.sizes + variance * (across * weight * left).sum(axis=1)
        spread = variance * ahead**3 - np.square(variance) * (np.square(across) * weight).sum(axis=1)
        return beyond, np.maximum(spread, 0.0) + self.taller_variance[e, k, j]


def _walked(early: FloatArray, late: FloatArray) -> FloatArray:
    """Covariance, at two times (broadcast), of an integrated random walk whose standard deviation at time 1 is 1."""
    low, high = np.minimum(early, late), np.maximum(early, late)
    return np.asarray(0.5 * low**2 * (3.0 * high - low))


def _plain_courses(share: FloatArray) -> FloatArray:
    """The three plain courses [3, e, n] at shares of life [e, n]: slowing down, straight, steepening."""
    return np.stack([np.log1p(share / _BEND) / math.log1p(1.0 / _BEND), share, np.minimum(share, 2.0) ** 3])


#: How early the first of them bends [shares of life], and their slopes at the end.
_BEND = 0.03
_PLAIN_PACES = (1.0 / ((1.0 + _BEND) * math.log1p(1.0 / _BEND)), 1.0, 3.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Predictive:
    """Student's t predictive density of the next value; with `beyond`, lower bounds [c] of censored values.

    Given the others the mean is normal with `precision` in units of the variance, the variance inverse gamma.
    """

    mean: float
    precision: float
    shape: float
    rate: float
    beyond: FloatArray

    def log_density(self, values: FloatArray) -> FloatArray:
        """Log density at values [n]."""
        if self.beyond.size:
            return self._averaged(values)
        scale, freedom = math.sqrt(self.rate / self.shape * (1.0 + 1.0 / self.precision)), 2.0 * self.shape
        deviations = (values - self.mean) / scale
        height = math.lgamma(0.5 * freedom + 0.5) - math.lgamma(0.5 * freedom)
        height -= 0.5 * math.log(math.pi * freedom) + math.log(scale)
        return np.asarray(height - 0.5 * (freedom + 1.0) * np.log1p(deviations**2 / freedom))

    def _averaged(self, values: FloatArray, nodes: int = 16) -> FloatArray:
        """Log predictive density [n] by quadrature over the mean and deviation at equal-probability nodes, each
        weighted by the likelihood of the censored values `beyond`."""
        even = (np.arange(nodes) + 0.5) / nodes
        deviation = np.repeat(np.sqrt(self.rate / gammaincinv(self.shape, even)), nodes)
        mean = self.mean + deviation / math.sqrt(self.precision) * np.tile(ndtri(even), nodes)
        log_weight = log_ndtr((mean - self.beyond[:, None]) / deviation).sum(axis=0)
        log_weight -= logsumexp(log_weight) + np.log(deviation) + 0.5 * math.log(2.0 * math.pi)
        off = (values[:, None] - mean) / deviation
        return np.asarray(logsumexp(log_weight - 0.5 * off**2, axis=1))


def _predictive(
    values: FloatArray,
    variance: FloatArray,
    exact: NDArray[np.bool_],
    mean_sd: float,
    variance_prior: tuple[float, float],
) -> _Predictive:
    """The predictive of a further value given values [n] that are normal with unknown mean and variance. A priori the
    mean is normal about 0, its deviation `mean_sd` of the values' own, and the variance inverse gamma with (shape,
    rate) `variance_prior`.

    A value is known with a variance [n] of its own, or where it is not `exact` [n], only as a lower bound.
    """
    exact_values = values[exact]
    precision = exact_values.size + mean_sd**-2
    mean = float(exact_values.sum()) / precision
    squares = float(exact_values @ exact_values + variance[exact].sum())
    return _Predictive(
        mean=mean,
        precision=precision,
        shape=variance_prior[0] + 0.5 * exact_values.size,
        rate=variance_prior[1] + 0.5 * (squares - precision * mean**2),
        beyond=values[~exact],
    )


def severity_exponent(ends: FloatArray, work: FloatArray) -> tuple[float, float]:
    """Estimate of the exponent q of lives that end after work^-q cycles, and its standard deviation, from ends [n] and
    their cycles' work [n] > 0.

    Least squares of the logarithms. Raises ValueError where fewer than three lives, or all alike, cannot tell it.
    """
    x = np.log(work) - np.log(work).mean()
    spread = float(x @ x)
    if x.size < criteria.FEWEST_SEVERITIES or spread == 0.0:
        raise ValueError(f"lives under different work are needed, {criteria.FEWEST_SEVERITIES} or more, got {x.size}")
    y = np.log(ends) - np.log(ends).mean()
    slope = float(x @ y) / spread
    left = y - slope * x
    return -slope, math.sqrt(float(left @ left) / (x.size - 2) / spread)
