"""Rivals in plain numpy and scipy: eq. 6 and our prior of it, each method started as its own literature says.

- IBIS (N. Chopin, Biometrika 89 (2002) 539) starts at draws of the prior, that of the scatter too.
- The filter of J. Liu and M. West (Sequential Monte Carlo Methods in Practice (2001) 197), discount 0.98, starts likewise.
- filterpy's unscented filter (S. Julier, J. Uhlmann, Proc. IEEE 92 (2004) 401) starts at the mode of the first
  tests with its curvature: a linearisation about a wide prior is not what it is made for.
- scipy's `curve_fit` starts at several draws of the prior; the best fit counts.
"""

import math
from collections.abc import Sequence

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from scipy.optimize import curve_fit, least_squares

from models.degradation.general_order import DegradationLaw, first_passage
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior
from models.tracking.sampling import systematic
from tests.statistical.lives import CAP

Sample = tuple[np.ndarray, np.ndarray]
DRAWS = 1_000
#: Tests that the unscented filter starts from: twice its coefficients.
FIRST = 8


def law(progress: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Eq. 6 at progress [t] for rows of (ξ0, Δ, log φ, log ε) [n, 4 or more]; [n, t]."""
    initial, change = coefficients[:, 0, None], coefficients[:, 1, None]
    scale, exponent = (np.exp(np.clip(coefficients[:, k, None], -50.0, 50.0)) for k in (2, 3))
    return initial - change * np.expm1(-exponent * np.log1p(progress / scale))


def ends_of(coefficients: np.ndarray) -> np.ndarray:
    """End of life [n] of rows of (ξ0, Δ, log φ, log ε)."""
    initial, change, log_scale, log_exponent = np.clip(coefficients[:, :4], -50.0, 50.0).T
    degradation = DegradationLaw(initial=initial, change=change, scale=np.exp(log_scale), exponent=np.exp(log_exponent))
    return np.minimum(np.where(initial <= 0.0, 0.0, first_passage(0.5 * initial, degradation)), CAP)


def prior_moments(prior: TrackPrior) -> tuple[np.ndarray, np.ndarray]:
    """Mean and deviation of (ξ0, Δ, log φ, log ε, log s)."""
    names = ("initial", "change", "log_scale", "log_exponent", "log_scatter")
    mean, sd = (np.array([getattr(prior, f"{name}_{of}") for name in names]) for of in ("mean", "sd"))
    return mean, sd


class Ibis:
    """Iterated batch importance sampling: particles weighted test by test; at half of their number effective, resampled and
    moved by a random walk of their own covariance, until nine in ten have moved, ten times at most."""

    def __init__(self, prior: TrackPrior, rng: np.random.Generator) -> None:
        self.mean, self.sd = prior_moments(prior)
        self.particles = self.mean + self.sd * rng.standard_normal((DRAWS, 5))
        self.log_weight, self.seen, self.rng = np.zeros(DRAWS), np.zeros((0, 3)), rng

    def log_likelihood(self, particles: np.ndarray, tests: np.ndarray) -> np.ndarray:
        progress, value, variance = tests.T
        total = variance + np.exp(2.0 * particles[:, 4, None])
        return -0.5 * ((value - law(progress, particles)) ** 2 / total + np.log(total)).sum(axis=1)

    def log_target(self, particles: np.ndarray) -> np.ndarray:
        off = (particles - self.mean) / self.sd
        return self.log_likelihood(particles, self.seen) - 0.5 * np.square(off).sum(axis=1)

    @property
    def weight(self) -> np.ndarray:
        weight = np.exp(self.log_weight - self.log_weight.max())
        return weight / weight.sum()

    def update(self, measurement: Measurement) -> None:
        test = np.array([[measurement.progress, measurement.value, measurement.variance]])
        self.seen = np.concatenate([self.seen, test])
        self.log_weight += self.log_likelihood(self.particles, test)
        weight = self.weight
        if 1.0 / np.square(weight).sum() >= 0.5 * DRAWS:
            return
        covariance = np.cov(self.particles, rowvar=False, aweights=weight) + 1e-12 * np.diag(self.sd**2)
        step = 2.38 / math.sqrt(5) * np.linalg.cholesky(covariance)
        self.particles = self.particles[systematic(weight, DRAWS, float(self.rng.random()))]
        self.log_weight, target = np.zeros(DRAWS), self.log_target(self.particles)
        moved = np.zeros(DRAWS, dtype=bool)
        for _ in range(10):
            proposed = self.particles + self.rng.standard_normal((DRAWS, 5)) @ step.T
            offered = self.log_target(proposed)
            accepted = np.log(self.rng.random(DRAWS)) < offered - target
            self.particles = np.where(accepted[:, None], proposed, self.particles)
            target, moved = np.where(accepted, offered, target), moved | accepted
            if moved.mean() >= 0.9:
                break

    def sample(self) -> Sample:
        return ends_of(self.particles), self.weight


class LiuWest(Ibis):
    """Particles drawn again at every test from normals around their places shrunk to the mean: nothing seen is kept."""

    def update(self, measurement: Measurement) -> None:
        test = np.array([[measurement.progress, measurement.value, measurement.variance]])
        weight, shrinkage = self.weight, (3 * 0.98 - 1) / (2 * 0.98)
        covariance = np.cov(self.particles, rowvar=False, aweights=weight) + 1e-12 * np.diag(self.sd**2)
        places = shrinkage * self.particles + (1.0 - shrinkage) * (weight @ self.particles)
        expected = self.log_likelihood(places, test)
        first = weight * np.exp(expected - expected.max())
        index = systematic(first / first.sum(), DRAWS, float(self.rng.random()))
        step = math.sqrt(1.0 - shrinkage**2) * np.linalg.cholesky(covariance)
        self.particles = places[index] + self.rng.standard_normal((DRAWS, 5)) @ step.T
        self.log_weight = self.log_likelihood(self.particles, test) - expected[index]


def mode_of(
    measurements: Sequence[Measurement], prior: TrackPrior, scatter: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The mode of (ξ0, Δ, log φ, log ε) given tests and the prior, from several starts, and the inverse of its curvature."""
    mean, sd = (moment[:4] for moment in prior_moments(prior))
    progress, value = (np.array([getattr(m, name) for m in measurements]) for name in ("progress", "value"))

    def residual(z: np.ndarray) -> np.ndarray:
        return np.concatenate([(law(progress, (mean + sd * z)[None])[0] - value) / scatter, z])

    starts = np.concatenate([np.zeros((1, 4)), rng.standard_normal((4, 4))])
    best = min((least_squares(residual, start) for start in starts), key=lambda found: float(found.cost))
    return mean + sd * best.x, np.outer(sd, sd) * np.linalg.inv(best.jac.T @ best.jac)


class PlainUkf:
    """filterpy's unscented Kalman filter in (ξ0, Δ, log φ, log ε), with the scatter given and the sigma points that its
    documentation advises."""

    def __init__(self, prior: TrackPrior, scatter: float, rng: np.random.Generator) -> None:
        points = MerweScaledSigmaPoints(n=4, alpha=0.1, beta=2.0, kappa=-1.0)
        self.filter = UnscentedKalmanFilter(4, 1, 1.0, hx=self.expected, fx=lambda x, _: x, points=points)
        self.filter.Q, self.filter.R = 1e-9 * np.diag(prior_moments(prior)[1][:4] ** 2), np.array([[scatter**2]])
        self.prior, self.scatter, self.rng = prior, scatter, rng
        self.first, self.progress = list[Measurement](), 0.0

    def expected(self, x: np.ndarray) -> np.ndarray:
        return law(np.array([self.progress]), x[None])[0]

    def update(self, measurement: Measurement) -> None:
        if len(self.first) < FIRST:
            self.first.append(measurement)
            if len(self.first) == FIRST:
                self.filter.x, self.filter.P = mode_of(self.first, self.prior, self.scatter, self.rng)
            return
        self.progress = measurement.progress
        self.filter.predict()
        self.filter.update(np.array([measurement.value]))
        self.filter.P = 0.5 * (self.filter.P + self.filter.P.T) + 1e-14 * np.eye(4)

    def sample(self) -> Sample:
        drawn = self.rng.multivariate_normal(self.filter.x, self.filter.P, DRAWS, check_valid="ignore")
        return ends_of(drawn), np.full(DRAWS, 1.0 / DRAWS)


def fitted(measurements: list[Measurement], prior: TrackPrior, rng: np.random.Generator, *, starts: int) -> Sample:
    """scipy's `curve_fit` of eq. 6 within four deviations of the prior, from several starts, and draws of the normal of its
    coefficients. Raises RuntimeError where no start converges."""
    progress, value = (np.array([getattr(m, name) for m in measurements]) for name in ("progress", "value"))
    mean, sd = (moment[:4] for moment in prior_moments(prior))

    def course(z: np.ndarray, *coefficients: float) -> np.ndarray:
        return law(z, np.array([coefficients]))[0]

    found = []
    for start in np.concatenate([np.zeros((1, 4)), np.clip(rng.standard_normal((starts - 1, 4)), -3.0, 3.0)]):
        try:
            best, covariance = curve_fit(
                course, progress, value, p0=mean + sd * start, bounds=(mean - 4.0 * sd, mean + 4.0 * sd), x_scale=sd
            )
        except RuntimeError:  # not converged: the next start
            continue
        found.append((float(np.square(course(progress, *best) - value).sum()), best, covariance))
    if not found:
        raise RuntimeError("curve_fit converged from no start")
    _, best, covariance = min(found, key=lambda each: each[0])
    if not np.isfinite(covariance).all():
        raise RuntimeError("curve_fit found no covariance")
    drawn = rng.multivariate_normal(best, covariance, DRAWS, check_valid="ignore")
    return ends_of(drawn), np.full(DRAWS, 1.0 / DRAWS)
