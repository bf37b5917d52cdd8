"""A particle filter for eq. 6 that marginalises what is linear and keeps its particles apart.

Particles carry (log φ, log ε, log s); given these, ξ0 and Δ follow a Kalman update in closed form (Rao-Blackwell),
and a particle's weight grows by the predictive probability of each measurement. The coefficients do not move, so
resampling alone would soon leave copies of one particle. After it every particle takes Metropolis-Hastings steps that
leave the exact marginal posterior over the whole history as it is (iterated batch importance sampling), until nine in
ten have moved.

A measurement that would starve the cloud at once is let in by degrees: first with a large further variance, which is
then taken away in steps, with resampling and moves in between. Each step is a posterior too, so nothing is
approximated.

Source: N. Chopin, "A sequential particle filter method for static models", Biometrika 89 (2002) 539-552.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.tracking.linear import History, basis, conditional, evidence, pointwise, resolved
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior
from models.tracking.protocol import Posterior
from models.tracking.sampling import correlated_pair, spread_normals, systematic

#: Resample below this share of effective particles; let no single step bring them below the second share.
HEALTHY, STARVED = 0.5, 0.25
#: Steps of a move: at most so many, until this share of particles has moved since resampling.
MOVES, MOVED = 8, 0.9
#: Degrees by which a measurement may be let in, and the ratio of one further variance to the next that is tried.
DEGREES, RATIO = 30, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Cloud:
    """n particles: points [n, 3] of (log φ, log ε, log s), log_weight [n], log_target [n] (log prior plus evidence),
    and the normal of (ξ0, Δ) of each: mean [n, 2], covariance [n, 3] (variance of ξ0, covariance, variance of Δ)."""

    points: FloatArray
    log_weight: FloatArray
    log_target: FloatArray
    mean: FloatArray
    covariance: FloatArray

    def taken(self, index: NDArray[np.intp]) -> "Cloud":
        """The particles at `index`, with equal weights."""
        cloud = Cloud(**{field.name: getattr(self, field.name)[index] for field in fields(self)})
        return replace(cloud, log_weight=np.zeros(self.log_weight.size))


@dataclass(frozen=True, slots=True, kw_only=True)
class ParticleState:
    """Everything measured and the particles that stand for it."""

    prior: Prior
    history: History
    cloud: Cloud

    def to_arrays(self) -> dict[str, FloatArray]:
        """The state as named arrays; `from_arrays` gives it back exactly."""
        cloud = {field.name: getattr(self.cloud, field.name) for field in fields(self.cloud)}
        return {"prior": self.prior.to_array()} | self.history.to_arrays() | cloud

    @classmethod
    def from_arrays(cls, arrays: dict[str, FloatArray]) -> "ParticleState":
        """The inverse of `to_arrays`."""
        return cls(
            prior=Prior.from_array(arrays["prior"]),
            history=History.from_arrays(arrays),
            cloud=Cloud(**{field.name: arrays[field.name] for field in fields(Cloud)}),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Particle:
    """The filter. `moves` = 0 leaves a plain resampling filter, which starves: it is there to be compared with."""

    particles: int = 1_000
    moves: int = MOVES

    @property
    def name(self) -> str:
        """`particle`."""
        return "particle"

    def start(self, prior: Prior) -> ParticleState:
        """Particles spread evenly over the prior, the same every time."""
        centre = np.array([prior.log_scale_mean, prior.log_exponent_mean, prior.log_scatter_mean])
        spread = np.array([prior.log_scale_sd, prior.log_exponent_sd, prior.log_scatter_sd])
        points = centre + spread * spread_normals(self.particles, np.full(3, 0.5))
        nothing = History.of(())
        cloud = _cloud(nothing, prior, points)
        return ParticleState(prior=prior, history=nothing, cloud=cloud)

    def update(self, state: ParticleState, measurement: Measurement, rng: np.random.Generator) -> ParticleState:
        """The posterior with one more measurement."""
        prior, history, cloud = state.prior, state.history, state.cloud
        measurement = resolved(measurement, prior)
        further = math.inf
        for degree in range(DEGREES):
            forecast = _Forecast.of(cloud, measurement)
            before = forecast.log_density(further)
            further = 0.0 if degree == DEGREES - 1 else _next_degree(forecast, cloud.log_weight - before, further)
            log_weight = cloud.log_weight + forecast.log_density(further) - before
            cloud = replace(cloud, log_weight=log_weight - log_weight.max())
            if further > 0.0 or _effective(cloud.log_weight) < HEALTHY * self.particles:
                cloud = self._renewed(cloud, prior, history, measurement, further, rng)
            if further == 0.0:
                break
        return ParticleState(prior=prior, history=history.append(measurement), cloud=_learnt(cloud, measurement))

    def _renewed(
        self,
        cloud: Cloud,
        prior: Prior,
        history: History,
        measurement: Measurement,
        further: float,
        rng: np.random.Generator,
    ) -> Cloud:
        """Resampled, and moved by steps of a random walk shaped like the cloud; the target includes `measurement`."""
        weight = _weights(cloud.log_weight)
        off = cloud.points - weight @ cloud.points
        shape = _root((weight * off.T) @ off)
        cloud = cloud.taken(systematic(weight, weight.size, float(rng.random())))
        target = cloud.log_target + _Forecast.of(cloud, measurement).log_density(further)
        moved = np.zeros(weight.size, dtype=bool)
        for _ in range(self.moves):
            stride = rng.uniform(0.2, 1.6, size=(weight.size, 1))
            step = stride * rng.standard_normal(cloud.points.shape) @ shape.T
            proposed = _cloud(history, prior, cloud.points + step)
            offered = proposed.log_target + _Forecast.of(proposed, measurement).log_density(further)
            accepted = np.log(rng.random(weight.size)) < offered - target
            cloud = _merged(cloud, proposed, accepted)
            target = np.where(accepted, offered, target)
            moved |= accepted
            if moved.mean() >= MOVED:
                break
        return cloud

    def posterior(self, state: ParticleState, size: int, rng: np.random.Generator) -> Posterior:
        """`size` draws of equal weight: systematic over the particles, with evenly spread draws of (ξ0, Δ)."""
        cloud, offset = state.cloud, rng.random(3)
        index = systematic(_weights(cloud.log_weight), size, float(offset[2]))
        variance = cloud.covariance[index]
        pair = cloud.mean[index] + correlated_pair(
            spread_normals(size, offset[:2]), variance[:, 0], variance[:, 2], variance[:, 1]
        )
        scale, exponent, scatter = np.exp(cloud.points[index]).T
        return Posterior(
            weight=np.full(size, 1.0 / size),
            initial=pair[:, 0],
            change=pair[:, 1],
            scale=scale,
            exponent=exponent,
            scatter=scatter,
        )


@dataclass(frozen=True, slots=True)
class _Forecast:
    """What each particle expects of a measurement: `off` [n] by how much it is wrong, with `variance` [n]."""

    off: FloatArray
    variance: FloatArray

    @classmethod
    def of(cls, cloud: Cloud, measurement: Measurement) -> "_Forecast":
        b = basis(np.asarray(measurement.progress), cloud.points[:, 0], cloud.points[:, 1])
        initial, both, change = cloud.covariance.T
        variance = initial + b * (2.0 * both + b * change) + measurement.variance + np.exp(2.0 * cloud.points[:, 2])
        return cls(measurement.value - cloud.mean[:, 0] - cloud.mean[:, 1] * b, variance)

    def log_density(self, further: float) -> FloatArray:
        """Log predictive density, where the measurement has a `further` variance; an infinite one says nothing."""
        if math.isinf(further):
            return np.zeros_like(self.off)
        variance = self.variance + further
        return np.asarray(-0.5 * (np.log(2.0 * np.pi * variance) + self.off**2 / variance))


def _next_degree(forecast: _Forecast, base: FloatArray, further: float) -> float:
    """The smallest further variance, 0 if possible, that does not starve the cloud; `base` are weights without it."""
    enough = STARVED * base.size
    if _effective(base + forecast.log_density(0.0)) >= enough:
        return 0.0
    top = further * RATIO
    if math.isinf(further):
        top = float((forecast.variance + forecast.off**2).max())
        while _effective(base + forecast.log_density(top)) < enough and math.isfinite(top / RATIO):
            top /= RATIO
    best = top
    for _ in range(80):
        if _effective(base + forecast.log_density(top)) < enough:
            break
        best, top = top, top * RATIO
    return best


def _cloud(history: History, prior: Prior, points: FloatArray) -> Cloud:
    """Particles at points [n, 3] with what the history says of each, equally weighted."""
    sums = pointwise(history, prior, *points.T)
    given = conditional(sums, prior)
    return Cloud(
        points=points,
        log_weight=np.zeros(points.shape[0]),
        log_target=evidence(sums, prior) + prior.log_density(*points.T),
        mean=np.stack([given.initial, given.change], axis=1),
        covariance=np.stack([given.initial_variance, given.covariance, given.change_variance], axis=1),
    )


def _learnt(cloud: Cloud, measurement: Measurement) -> Cloud:
    """The Kalman update of (ξ0, Δ) on every particle, and its probability added to the target."""
    forecast = _Forecast.of(cloud, measurement)
    b = basis(np.asarray(measurement.progress), cloud.points[:, 0], cloud.points[:, 1])
    initial, both, change = cloud.covariance.T
    seen = np.stack([initial + both * b, both + change * b], axis=1)
    gain = seen / forecast.variance[:, None]
    first, second = seen.T
    drop = np.stack([gain[:, 0] * first, gain[:, 0] * second, gain[:, 1] * second], axis=1)
    return replace(
        cloud,
        log_target=cloud.log_target + forecast.log_density(0.0),
        mean=cloud.mean + gain * forecast.off[:, None],
        covariance=cloud.covariance - drop,
    )


def _merged(old: Cloud, new: Cloud, accepted: NDArray[np.bool_]) -> Cloud:
    columns = {}
    for field in fields(Cloud):
        kept, offered = getattr(old, field.name), getattr(new, field.name)
        columns[field.name] = np.where(accepted if kept.ndim == 1 else accepted[:, None], offered, kept)
    return Cloud(**columns)


def _weights(log_weight: FloatArray) -> FloatArray:
    weight = np.exp(log_weight - log_weight.max())
    return np.asarray(weight / weight.sum())


def _effective(log_weight: FloatArray) -> float:
    """Effective number of particles, (Σw)²/Σw²."""
    return float(1.0 / np.square(_weights(log_weight)).sum())


def _root(covariance: FloatArray) -> FloatArray:
    """A square root of a covariance [3, 3] that may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 1e-12)))
