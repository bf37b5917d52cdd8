"""Importance sampling: draws of (φ, ε, s) from the prior, weighted by how well eq. 6 then fits all measurements.

Given (φ, ε, s) eq. 6 is linear in (ξ0, Δ), whose normal posterior and marginal likelihood are exact. No run is outlying and
there is no discrepancy beside eq. 6. Slow and simple: a witness for the other filters.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.degradation.general_order import progress_fraction
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior

_DRAWS = 40_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportanceState:
    """All measurements so far; nothing is computed before a posterior is wanted."""

    prior: TrackPrior
    measurements: tuple[Measurement, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Importance:
    """The filter; all its chance lies in `posterior`."""

    @property
    def name(self) -> str:
        """`importance`."""
        return "importance"

    def start(self, prior: TrackPrior) -> ImportanceState:
        """The prior itself."""
        return ImportanceState(prior=prior)

    def update(self, state: ImportanceState, measurement: Measurement, rng: np.random.Generator) -> ImportanceState:  # noqa: ARG002
        """The state with one more measurement."""
        return replace(state, measurements=(*state.measurements, measurement))

    def posterior(self, state: ImportanceState, size: int, rng: np.random.Generator) -> TrackPosterior:
        """`size` draws of equal weight, taken again from those of the prior by their weights."""
        prior = state.prior
        means = [prior.log_scale_mean, prior.log_exponent_mean, prior.log_scatter_mean]
        sds = [prior.log_scale_sd, prior.log_exponent_sd, prior.log_scatter_sd]
        scale, exponent, scatter = np.exp(rng.normal(means, sds, (_DRAWS, 3))).T
        precision = np.zeros((_DRAWS, 2, 2)) + np.diag([prior.initial_sd**-2, prior.change_sd**-2])
        moment = np.zeros((_DRAWS, 2)) + np.array([prior.initial_mean, prior.change_mean]) @ precision[0]
        log_weight = -0.5 * (moment[0] @ np.linalg.solve(precision[0], moment[0])) + np.zeros(_DRAWS)
        for measurement in state.measurements:
            row = np.stack([np.ones(_DRAWS), progress_fraction(measurement.progress, scale, exponent)], axis=1)
            variance = scatter**2 + measurement.variance
            precision += row[:, :, None] * row[:, None, :] / variance[:, None, None]
            moment += row * (measurement.value / variance)[:, None]
            log_weight -= 0.5 * (np.log(variance) + measurement.value**2 / variance)
        mean = np.linalg.solve(precision, moment[:, :, None])[:, :, 0]
        log_weight += 0.5 * np.einsum("ni,ni->n", moment, mean) - 0.5 * np.linalg.slogdet(precision)[1]
        weight = np.exp(log_weight - log_weight.max())
        taken = rng.choice(_DRAWS, size, p=weight / weight.sum())
        root = np.linalg.cholesky(np.linalg.inv(precision[taken]))
        initial, change = (mean[taken] + np.einsum("nij,nj->ni", root, rng.standard_normal((size, 2)))).T
        return TrackPosterior(
            weight=np.full(size, 1.0 / size),
            initial=initial,
            change=change,
            scale=scale[taken],
            exponent=exponent[taken],
            scatter=scatter[taken],
        )
