"""What a fleet of earlier lives says about the next: the population of eq. 6's coefficients, learned by empirical Bayes.

Each clutch of a fleet has x = (Δ/ξ0, log φ, log ε, log s/ξ0), drawn from a normal population N(μ, Σ). None of them is
known exactly, so each clutch gives a weighted sample of its posterior under the weak prior, and an
expectation-maximisation alternates between the clutches' moments given the population (the samples, weighted by
population over weak prior) and the population given those moments. The hyperprior, normal-inverse-Wishart, stands for
clutches that differ by 0.15 in Δ/ξ0 and about half in φ, ε and s: it decides where the fleet is small, and loses weight
quickly as the fleet grows. The prediction for the next clutch is then Student's t.

A clutch may be of another kind than its fleet. The prior is therefore a mixture, `share` of the learned population and the
rest weak, and the clutch's own measurements decide between them. A filter runs under the weak prior and under the normal
nearest to the population; the two samples are combined with the weights that make them one sample of the posterior under
the mixture. This needs only the ratio of the two evidences, which is estimated from the samples (Bennett).

Sources: B. P. Carlin, T. A. Louis, Bayesian Methods for Data Analysis (2008) ch. 5, for empirical Bayes; C. H. Bennett,
J. Comput. Phys. 22 (1976) 245-268, and M. R. Shirts, J. D. Chodera, J. Chem. Phys. 129 (2008) 124105, for the weights.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, log_expit

from models.arrays import FloatArray
from models.prognosis import criteria
from models.tracking.courses import UNIT_OF_CHANGE, WITHOUT_EXPONENT, CourseForm
from models.tracking.criteria import REACH
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior, joined
from models.tracking.prior import TrackPrior, weak
from models.tracking.sampling import normalised

_GRID = Grid()
#: How many clutches the hyperprior is worth, and how many the centre of the weak prior as the population's mean.
_HYPER_CLUTCHES, _HYPER_CENTRE = 6.0, 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetPrior:
    """The population learned from `clutches` clutches: Student's t of x [4], `mean` [4], `scale` [4, 4] and `freedom` > 2.

    x is (Δ/ξ0, log φ, log ε, log s/ξ0), φ in cycles.
    """

    clutches: int
    mean: FloatArray
    scale: FloatArray
    freedom: float

    @property
    def share(self) -> float:
        """The learned population's share of the mixture with the weak prior."""
        return criteria.TRUST * self.clutches / (self.clutches + criteria.DOUBT)

    def in_unit(self, cycles: float) -> "FleetPrior":
        """The population with φ counted in units of `cycles`."""
        return replace(self, mean=self.mean - np.array([0.0, math.log(cycles), 0.0, 0.0]))

    def prior_for(self, first: Measurement) -> TrackPrior:
        """The normal prior with the population's moments, half as wide again, for a filter of a series that begins with
        `first`."""
        believed = weak(first, falling=True)
        size = believed.size
        # a clutch at the edge of its fleet must not lie at the edge of what the filter covers
        deviation = (1.5 * np.sqrt(np.diag(self.scale) * self.freedom / (self.freedom - 2.0))).tolist()
        mean = self.mean.tolist()
        return replace(
            believed,
            change_mean=mean[0] * size,
            change_sd=deviation[0] * size,
            log_scale_mean=mean[1],
            log_scale_sd=deviation[1],
            log_exponent_mean=mean[2],
            log_exponent_sd=deviation[2],
            log_scatter_mean=mean[3] + math.log(size),
            log_scatter_sd=deviation[3],
        )

    def log_density(self, x: FloatArray) -> FloatArray:
        """Log density of the population at x [n, 4]; [n]."""
        root = np.linalg.cholesky(self.scale)
        off = np.linalg.inv(root) @ (x - self.mean).T
        d, f = x.shape[1], self.freedom
        constant = gammaln(0.5 * (f + d)) - gammaln(0.5 * f) - 0.5 * d * math.log(f * math.pi)
        distance = np.square(off).sum(axis=0)
        return np.asarray(constant - np.log(np.diag(root)).sum() - 0.5 * (f + d) * np.log1p(distance / f))

    def together(self, under_weak: TrackPosterior, under_fleet: TrackPosterior, first: Measurement) -> TrackPosterior:
        """One weighted sample of the posterior under the mixture prior, from samples of the posteriors under `weak` and
        under `prior_for`."""
        ours, theirs = weak(first, falling=True), self.prior_for(first)
        under_weak, under_fleet = _possible(under_weak, ours), _possible(under_fleet, theirs)
        drawn = pooled(under_weak, under_fleet)
        log_weak = _log_prior(drawn, ours)
        # a vanishing density: no draws beyond REACH deviations of the prior
        lean = np.where(_on_the_grid_of(theirs, drawn), _log_prior(drawn, theirs) - log_weak, (-700.0))
        split = under_weak.weight.size
        ratio = _log_evidence_ratio(lean[:split], under_weak.weight, lean[split:], under_fleet.weight)
        learned = self.log_density(_coordinates(drawn)) - np.log(np.abs(drawn.initial)) - log_weak
        learned = np.where(drawn.course == CourseForm.EQ_6, learned, 0.0)  # of the other courses it has learned nothing
        mixture = np.logaddexp(math.log1p(-self.share), math.log(self.share) + learned)
        with np.errstate(divide="ignore"):
            log_weight = np.log(drawn.weight) + mixture - np.logaddexp(0.0, lean - ratio)
        return replace(drawn, weight=np.exp(log_weight - np.logaddexp.reduce(log_weight)))

    def to_dict(self) -> dict[str, Any]:
        """The population as values that JSON can carry."""
        return asdict(self) | {"mean": self.mean.tolist(), "scale": self.scale.tolist()}

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> "FleetPrior":
        """The inverse of `to_dict`, exactly."""
        mean, scale = (np.array(stored[name], dtype=np.float64) for name in ("mean", "scale"))
        return cls(clutches=stored["clutches"], mean=mean, scale=scale, freedom=stored["freedom"])


@dataclass(frozen=True, slots=True, kw_only=True)
class Taught:
    """One clutch's likelihood of x, as a posterior sample [n, 4] with the weak prior divided out of its log weights
    [n]."""

    x: FloatArray
    log_weight: FloatArray


def taught(history: Sequence[Measurement], seed: int = 0) -> Taught:
    """One clutch's likelihood of x as a weighted sample, from its measurements of mean COF. Raises ValueError below
    FEWEST_TESTS_TO_LEARN of them."""
    if len(history) < criteria.FEWEST_TESTS_TO_LEARN:
        raise ValueError(
            f"a clutch needs {criteria.FEWEST_TESTS_TO_LEARN} tests to teach a fleet's prior, got {len(history)}"
        )
    prior = replace(weak(history[0], falling=True), eq_6_share=1.0)
    drawn = _GRID.posterior(_GRID.from_history(prior, history), 2000, np.random.default_rng(seed))
    sound = drawn.initial > 0.0
    with np.errstate(divide="ignore"):
        log_weight = np.log(drawn.weight) - np.log(np.abs(drawn.initial)) - _log_prior(drawn, prior)
    return Taught(x=_coordinates(drawn)[sound], log_weight=log_weight[sound])


def population(fleet: Sequence[Taught], rounds: int = 40) -> FleetPrior:
    """The population of x learned from the clutches' samples by `rounds` of expectation-maximisation. Raises ValueError
    without samples."""
    if not fleet:
        raise ValueError(f"a fleet needs a clutch with {criteria.FEWEST_TESTS_TO_LEARN} tests or more")
    centre = weak(Measurement(progress=0.0, value=1.0, variance=0.0), falling=True)
    believed = np.array([centre.change_mean, centre.log_scale_mean, centre.log_exponent_mean, centre.log_scatter_mean])
    learned = FleetPrior(
        clutches=len(fleet),
        mean=believed,
        scale=np.diag([centre.change_sd, centre.log_scale_sd, centre.log_exponent_sd, centre.log_scatter_sd]) ** 2,
        freedom=_HYPER_CLUTCHES,
    )
    for _ in range(rounds):
        learned = _learnt(learned, fleet, believed)
    return learned


def pooled(first: TrackPosterior, second: TrackPosterior) -> TrackPosterior:
    """One sample with the draws of both, each sample with half of the weight; discrepancies must be of the same
    history."""
    both = joined((first, second))
    return replace(both, weight=0.5 * both.weight)


def _learnt(population: FleetPrior, fleet: Sequence[Taught], believed: FloatArray) -> FleetPrior:
    """The population after one round of expectation-maximisation: the clutches' moments given the population, then the
    population given their moments."""
    n, d = len(fleet), believed.size
    means, spread = np.zeros((n, d)), np.zeros((d, d))
    for index, clutch in enumerate(fleet):
        weight = normalised(clutch.log_weight + population.log_density(clutch.x))
        means[index] = weight @ clutch.x
        off = clutch.x - means[index]
        spread += (weight * off.T) @ off
    middle = means.mean(axis=0)
    centre = _HYPER_CENTRE + n
    off, pull = means - middle, middle - believed
    # of (Δ/ξ0, log φ, log ε, log s/ξ0) among clutches of one kind
    hyper_sd = np.array([0.15, 0.6, 0.4, 0.5])
    scatter = np.diag(hyper_sd**2) * (_HYPER_CLUTCHES - d + 1.0) + spread + off.T @ off
    scatter += _HYPER_CENTRE * n / centre * np.outer(pull, pull)
    freedom = _HYPER_CLUTCHES + n - d + 1.0
    return FleetPrior(
        clutches=n,
        mean=(_HYPER_CENTRE * believed + n * middle) / centre,
        scale=scatter * (centre + 1.0) / (centre * freedom),
        freedom=freedom,
    )


def _coordinates(drawn: TrackPosterior) -> FloatArray:
    """Coordinates x [n, 4] of a sample, (Δ/ξ0, log φ, log ε, log s/ξ0)."""
    log_scatter = np.log(drawn.scatter / np.abs(drawn.initial))
    return np.stack([drawn.change / drawn.initial, drawn.log_scale, drawn.log_exponent, log_scatter], axis=1)


def _log_prior(drawn: TrackPosterior, prior: TrackPrior) -> FloatArray:
    """Log density [n] of (Δ, log φ, log ε, log s) under a prior; ξ0, whose prior is always the same, is left out."""
    spread = math.log(prior.change_sd * prior.log_scale_sd * prior.log_exponent_sd * prior.log_scatter_sd)
    off = (drawn.change * UNIT_OF_CHANGE[drawn.course] - prior.change_mean) / prior.change_sd
    log_other_parts = prior.log_density(drawn.log_scale, drawn.log_exponent, np.log(drawn.scatter))
    density = log_other_parts - 0.5 * off**2 - spread - 2.0 * math.log(2.0 * math.pi)
    no_exponent = WITHOUT_EXPONENT[drawn.course]
    of_exponent = -0.5 * (drawn.log_exponent - prior.log_exponent_mean) ** 2 / prior.log_exponent_sd**2
    of_exponent -= math.log(prior.log_exponent_sd) + 0.5 * math.log(2.0 * math.pi)
    return np.asarray(density - np.where(no_exponent, of_exponent, 0.0))


def _on_the_grid_of(prior: TrackPrior, drawn: TrackPosterior) -> NDArray[np.bool_]:
    """Whether each draw [n] lies on the exact filter's grid under a prior, within REACH deviations of its means.

    Only those can be in the samples of both priors, as Bennett's ratio of their evidences needs.
    """
    of_exponent = (drawn.log_exponent - prior.log_exponent_mean) / prior.log_exponent_sd
    off = [
        (drawn.log_scale - prior.log_scale_mean) / prior.log_scale_sd,
        np.where(WITHOUT_EXPONENT[drawn.course], 0.0, of_exponent),
        (np.log(drawn.scatter) - prior.log_scatter_mean) / prior.log_scatter_sd,
    ]
    return np.asarray((np.abs(off) <= REACH).all(axis=0))


def _possible(drawn: TrackPosterior, prior: TrackPrior) -> TrackPosterior:
    """A sample under a prior without the draws whose Δ lies beyond the prior's range, unless all do: an unscented
    filter's normals reach there, and one draw divided by a density that vanishes would have all of the weight."""
    off = (drawn.change * UNIT_OF_CHANGE[drawn.course] - prior.change_mean) / prior.change_sd
    weight = np.where(np.abs(off) <= REACH, drawn.weight, 0.0)
    return replace(drawn, weight=weight / weight.sum()) if weight.any() else drawn


def _log_evidence_ratio(
    lean_first: FloatArray, weight_first: FloatArray, lean_second: FloatArray, weight_second: FloatArray
) -> float:
    """log(Z2/Z1) of two posteriors with the same likelihood, from samples of both.

    `lean` is log(prior 2/prior 1) at the draws. Bennett: E1[σ(lean - c)] = E2[σ(c - lean)] at c = log(Z2/Z1).
    """
    from scipy.optimize import brentq  # start-up time: only a fleet that is learned compares priors

    both = np.concatenate([lean_first, lean_second])
    low, high = float(both.min()) - 1.0, float(both.max()) + 1.0

    def excess(c: float) -> float:
        return _log_mean(log_expit(lean_first - c), weight_first) - _log_mean(log_expit(c - lean_second), weight_second)

    return float(brentq(excess, low, high, xtol=1e-6))


def _log_mean(log_values: FloatArray, weight: FloatArray) -> float:
    """log Σ w exp(log values), both [n]: scipy's `logsumexp` takes ten times as long for so few."""
    top = float(log_values[weight > 0.0].max())
    return top + math.log(float(weight @ np.exp(np.minimum(log_values - top, 0.0))))
