"""Simulated lives, brute-force posteriors and scores for the statistical tests of tracking and prognosis."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.degradation import Degradation, first_passage, value
from models.prognosis import ends_of_life, weighted_quantiles
from models.tracking import linear, sampling
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior, weak
from models.tracking.protocol import Posterior

LEVELS = np.array([0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95])
STAGES = (0.2, 0.4, 0.6, 0.8)
PRIOR = weak(Measurement(progress=0.0, value=0.13, variance=0.0), falling=True)
CAP = 1e6  # an end of life beyond it is scored as if it were there


@dataclass(frozen=True)
class Life:
    """A clutch that was: its coefficients, the scatter of its runs and when its COF was half."""

    truth: Degradation
    scatter: float
    end: float

    def measured(self, share: float, runs: int, rng: np.random.Generator) -> list[Measurement]:
        progress = np.linspace(0.0, share * self.end, runs)
        values = value(progress, self.truth) + self.scatter * rng.standard_normal(runs)
        return [
            Measurement(progress=float(z), value=float(y), variance=0.0) for z, y in zip(progress, values, strict=True)
        ]


def lives(count: int, seed: int, prior: Prior = PRIOR) -> Iterator[tuple[Life, np.random.Generator]]:
    """Lives drawn from the prior, of those that reach half of their COF between 100 and 1,000,000 cycles."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    found = 0
    while found < count:
        initial = rng.normal(prior.initial_mean, prior.initial_sd)
        truth = Degradation(
            initial=initial,
            change=rng.normal(prior.change_mean, prior.change_sd),
            scale=math.exp(rng.normal(prior.log_scale_mean, prior.log_scale_sd)),
            exponent=math.exp(rng.normal(prior.log_exponent_mean, prior.log_exponent_sd)),
        )
        scatter = math.exp(rng.normal(prior.log_scatter_mean, prior.log_scatter_sd))
        end = float(first_passage(0.5 * initial, truth))
        if initial > 0.0 and 100.0 < end < CAP:
            found += 1
            yield Life(truth, scatter, end), rng


def typical(count: int, seed: int) -> Iterator[tuple[Life, np.random.Generator]]:
    """Lives like the reference's, not drawn from the prior: half of the COF lost around 15,000 cycles."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for _ in range(count):
        initial = 0.13 * math.exp(rng.normal(0.0, 0.1))
        truth = Degradation(
            initial=initial,
            change=-initial * rng.uniform(0.6, 0.9),
            scale=math.exp(rng.normal(math.log(5_000.0), 0.4)),
            exponent=math.exp(rng.normal(math.log(0.7), 0.4)),
        )
        end = float(first_passage(0.5 * initial, truth))
        if end < CAP:
            yield Life(truth, 0.003 * initial, end), rng


def followed(tracker: Any, prior: Prior, measurements: list[Measurement], rng: np.random.Generator) -> Any:
    state = tracker.start(prior)
    for measurement in measurements:
        state = tracker.update(state, measurement, rng)
    return state


def brute(
    prior: Prior, measurements: list[Measurement], points: np.ndarray, log_proposal: np.ndarray | float
) -> Posterior:
    """Importance sampling: points [n, 3] of (log φ, log ε, log s) with their own density, weighted by the target's."""
    history = linear.History.of(measurements)
    parts = [
        linear.pointwise(history, prior, *chunk.T)
        for chunk in np.array_split(points, max(1, points.shape[0] // 20_000))
    ]
    log_weight = (
        np.concatenate([linear.evidence(sums, prior) for sums in parts]) + prior.log_density(*points.T) - log_proposal
    )
    given = [linear.conditional(sums, prior) for sums in parts]
    column = {name: np.concatenate([getattr(g, name) for g in given]) for name in linear.Conditional.__slots__}
    weight = np.exp(log_weight - log_weight.max())
    normals = np.random.default_rng(1).standard_normal((points.shape[0], 2))
    pair = sampling.correlated_pair(
        normals, column["initial_variance"], column["change_variance"], column["covariance"]
    )
    return Posterior(
        weight=weight / weight.sum(),
        initial=column["initial"] + pair[:, 0],
        change=column["change"] + pair[:, 1],
        scale=np.exp(points[:, 0]),
        exponent=np.exp(points[:, 1]),
        scatter=np.exp(points[:, 2]),
    )


def from_prior(prior: Prior, measurements: list[Measurement], count: int, rng: np.random.Generator) -> Posterior:
    spread = np.array([prior.log_scale_sd, prior.log_exponent_sd, prior.log_scatter_sd])
    centre = np.array([prior.log_scale_mean, prior.log_exponent_mean, prior.log_scatter_mean])
    points = centre + spread * rng.standard_normal((count, 3))
    return brute(prior, measurements, points, prior.log_density(*points.T))


def dense(prior: Prior, measurements: list[Measurement], rng: np.random.Generator) -> Posterior:
    """A lattice over the prior's whole range, fine enough for a late posterior (0.01 in log φ), drawn from as it is."""
    history = linear.History.of(measurements)
    log_rate = np.linspace(-4.0, 4.0, 1_841) * prior.log_scale_sd + prior.log_scale_mean
    log_exponent = np.linspace(-4.0, 4.0, 225) * prior.log_exponent_sd + prior.log_exponent_mean
    log_scatter = np.linspace(-4.0, 4.0, 81) * prior.log_scatter_sd + prior.log_scatter_mean
    rows = []
    for row in log_exponent:
        table = linear.basis(history.progress[:, None], log_rate - prior.log_exponent_mean + row, np.array(row))
        flat = prior.log_density(log_rate - prior.log_exponent_mean + row, row, log_scatter[:, None])
        rows.append(linear.evidence(linear.tabulated(history, prior, table, log_scatter), prior) + flat)
    density = np.stack(rows)
    cell = sampling.systematic(np.exp(density - density.max()).ravel(), 100_000, float(rng.random()))
    e, s, u = np.unravel_index(cell, density.shape)
    log_scale = log_rate[u] - prior.log_exponent_mean + log_exponent[e]
    points = np.stack([log_scale, log_exponent[e], log_scatter[s]], axis=1)
    equal = brute(prior, measurements, points, 0.0)
    return replace(equal, weight=np.full(points.shape[0], 1.0 / points.shape[0]))


def ends(posterior: Posterior) -> np.ndarray:
    return np.minimum(ends_of_life(posterior, 0.5), CAP)


def effective(posterior: Posterior) -> float:
    return 1.0 / float(np.square(posterior.weight).sum())


def misplaced(reference: Posterior, other: Posterior) -> np.ndarray:
    """By how much the end-of-life quantiles of one sample miss their level under the other's distribution."""
    sample = ends(reference)
    found = weighted_quantiles(ends(other), other.weight, LEVELS)
    below = np.array([reference.weight[sample < x * (1 - 1e-9)].sum() for x in found])
    upto = np.array([reference.weight[sample <= x * (1 + 1e-9)].sum() for x in found])
    return np.where(below > LEVELS, below - LEVELS, np.where(upto < LEVELS, LEVELS - upto, 0.0))


def crps(posterior: Posterior, truth: float) -> float:
    """E|x - truth| - E|x - x'|/2 of the end of life, weighted."""
    sample = ends(posterior)
    order = np.argsort(sample)
    x, w = sample[order], posterior.weight[order]
    return float(w @ np.abs(x - truth) - 2.0 * np.sum(w * x * (np.cumsum(w) - 0.5 * w - 0.5)) / 2.0)


def covered(posterior: Posterior, truth: float) -> bool:
    low, high = weighted_quantiles(ends(posterior), posterior.weight, (0.05, 0.95))
    return bool(low <= truth <= high)
