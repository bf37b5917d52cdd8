"""An unscented Kalman filter for eq. 6, filterpy's, in (ξ0, Δ, log φ, log ε).

The state is kept in deviations from the prior mean, in units of the prior's deviations, so that the covariance starts
as the identity whatever the quantity's unit; in logarithms φ and ε cannot leave their domain. Nothing moves between
runs, so a prediction adds only a trace of process noise, which keeps the covariance from collapsing on a bent ridge.

The scatter between runs is learnt from the innovations: of an innovation with y²/S = κ, the share g = s²/S is
scatter, and E[e²] = s² (1 + g (κ - 1)) is averaged into s² with the weight of one observation (the step of an
expectation-maximisation).

The prior is far too wide for sigma points: φ spans decades within them, and a filter started there does not recover.
The first few measurements are therefore taken together, and the normal that has the mean and covariance of their
exact posterior is where the filter starts. Even so, a normal in four dimensions is a rough picture of a bent ridge:
this is the well-known rival, not the reference.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from models.arrays import FloatArray
from models.degradation import progress_fraction
from models.tracking.grid import Grid
from models.tracking.linear import History, resolved
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior
from models.tracking.protocol import Posterior
from models.tracking.sampling import spread_normals

#: Process noise of a step, and the least variance along any axis, in units of the prior's variance.
PROCESS, FLOOR = 1e-7, 1e-10
#: Deviations from the prior mean that the state may reach.
DOMAIN = 5.0
#: An innovation counts at most as one of this many deviations when the scatter is learnt.
OUTLIER = 6.0
#: The grid that starts the filter, and the draws from it whose moments are taken.
STARTER, DRAWS = Grid(nodes=17, rows=17, levels=9), 800
#: Sigma points at ±√4 deviations with no weight on the centre: all weights positive, so S and P stay positive
#: definite.
SIGMA = {"n": 4, "alpha": 1.0, "beta": 0.0, "kappa": 0.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class UkfState:
    """mean [4] and covariance [4, 4] in units of the prior; scatter_variance in the quantity's unit squared, and how
    many observations it is worth; history, the measurements that were taken together at the start."""

    prior: Prior
    history: History
    mean: FloatArray
    covariance: FloatArray
    scatter_variance: float
    scatter_weight: float

    def to_arrays(self) -> dict[str, FloatArray]:
        """The state as named arrays; `from_arrays` gives it back exactly."""
        return self.history.to_arrays() | {
            "prior": self.prior.to_array(),
            "mean": self.mean,
            "covariance": self.covariance,
            "scatter": np.array([self.scatter_variance, self.scatter_weight]),
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, FloatArray]) -> "UkfState":
        """The inverse of `to_arrays`."""
        variance, weight = arrays["scatter"]
        return cls(
            prior=Prior.from_array(arrays["prior"]),
            history=History.from_arrays(arrays),
            mean=arrays["mean"],
            covariance=arrays["covariance"],
            scatter_variance=float(variance),
            scatter_weight=float(weight),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ukf:
    """The filter, started from the first `together` measurements; nothing in its updates is left to chance."""

    together: int = 10

    @property
    def name(self) -> str:
        """`ukf`."""
        return "ukf"

    def start(self, prior: Prior) -> UkfState:
        """The prior itself, with its median scatter, worth as many observations as its width allows."""
        return UkfState(
            prior=prior,
            history=History.of(()),
            mean=np.zeros(4),
            covariance=np.eye(4),
            scatter_variance=math.exp(2.0 * prior.log_scatter_mean),
            scatter_weight=max(1.0, 0.5 / prior.log_scatter_sd**2),
        )

    def update(self, state: UkfState, measurement: Measurement, rng: np.random.Generator | None = None) -> UkfState:  # noqa: ARG002
        """The state after one more measurement: predict (nothing moves), update, symmetrise, keep to the domain."""
        measurement = resolved(measurement, state.prior)
        if state.history.progress.size < self.together:
            return _started(state.prior, state.history.append(measurement))
        centre, unit = _units(state.prior)

        def expected(point: FloatArray) -> FloatArray:
            initial, change, log_scale, log_exponent = centre + unit * np.clip(point, -2 * DOMAIN, 2 * DOMAIN)
            share = progress_fraction(measurement.progress, math.exp(log_scale), math.exp(log_exponent))
            return np.array([(initial + change * float(share)) / unit[0]])

        noise = (measurement.variance + state.scatter_variance) / unit[0] ** 2
        ukf = UnscentedKalmanFilter(
            dim_x=4, dim_z=1, dt=1.0, hx=expected, fx=_unmoved, points=MerweScaledSigmaPoints(**SIGMA)
        )
        ukf.x, ukf.P = state.mean.copy(), state.covariance.copy()
        ukf.Q, ukf.R = PROCESS * np.eye(4), np.array([[noise]])
        ukf.predict()
        ukf.update(np.array([measurement.value / unit[0]]))
        learnt = _scatter_learnt(state, float(ukf.y[0]), float(ukf.S[0, 0]))
        return replace(learnt, mean=np.clip(ukf.x, -DOMAIN, DOMAIN), covariance=_definite(ukf.P))

    def posterior(self, state: UkfState, size: int, rng: np.random.Generator) -> Posterior:
        """`size` evenly spread draws of equal weight from the normal; the scatter is a point estimate."""
        centre, unit = _units(state.prior)
        root = np.linalg.cholesky(state.covariance)
        points = state.mean + spread_normals(size, rng.random(4)) @ root.T
        initial, change, log_scale, log_exponent = (centre + unit * np.clip(points, -2 * DOMAIN, 2 * DOMAIN)).T
        return Posterior(
            weight=np.full(size, 1.0 / size),
            initial=initial,
            change=change,
            scale=np.exp(log_scale),
            exponent=np.exp(log_exponent),
            scatter=np.full(size, math.sqrt(state.scatter_variance)),
        )


def _started(prior: Prior, history: History) -> UkfState:
    """The normal with the moments of the exact posterior of a few measurements, from evenly spread draws."""
    exact = STARTER.laid_over(prior, history)
    draws = STARTER.posterior(exact, DRAWS, np.random.default_rng(0))
    centre, unit = _units(prior)
    points = np.stack([draws.initial, draws.change, np.log(draws.scale), np.log(draws.exponent)], axis=1)
    points = (points - centre) / unit
    mean = draws.weight @ points
    off = points - mean
    return UkfState(
        prior=prior,
        history=history,
        mean=np.clip(mean, -DOMAIN, DOMAIN),
        covariance=_definite((draws.weight * off.T) @ off),
        scatter_variance=math.exp(2.0 * float(draws.weight @ np.log(draws.scatter))),
        scatter_weight=max(1.0, 0.5 / prior.log_scatter_sd**2) + history.progress.size,
    )


def _unmoved(point: FloatArray, _: float) -> FloatArray:
    return point


def _units(prior: Prior) -> tuple[FloatArray, FloatArray]:
    centre = np.array([prior.initial_mean, prior.change_mean, prior.log_scale_mean, prior.log_exponent_mean])
    return centre, np.array([prior.initial_sd, prior.change_sd, prior.log_scale_sd, prior.log_exponent_sd])


def _scatter_learnt(state: UkfState, innovation: float, variance: float) -> UkfState:
    """The scatter after an innovation with its predicted variance, both in units of the prior's deviation of ξ0."""
    prior = state.prior
    surprise = min(innovation**2 / variance, OUTLIER**2)
    share = state.scatter_variance / (variance * prior.initial_sd**2)
    learnt = state.scatter_variance * (1.0 + share * (surprise - 1.0) / (state.scatter_weight + 1.0))
    low, high = (math.exp(2.0 * (prior.log_scatter_mean + k * prior.log_scatter_sd)) for k in (-DOMAIN, DOMAIN))
    return replace(state, scatter_variance=min(max(learnt, low), high), scatter_weight=state.scatter_weight + 1.0)


def _definite(covariance: FloatArray) -> FloatArray:
    """Symmetrised, with no eigenvalue below FLOOR."""
    symmetric = 0.5 * (covariance + covariance.T)
    values, vectors = np.linalg.eigh(symmetric)
    if values[0] >= FLOOR:
        return np.asarray(symmetric)
    lifted = vectors * np.maximum(values, FLOOR) @ vectors.T
    return np.asarray(0.5 * (lifted + lifted.T))
