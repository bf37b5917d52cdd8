"""dμ/dv at a speed along a life, from joint draws of the Stribeck parameters' tracks.

Each parameter at a reference pressure follows its own eq. 6, and the slope at any ζ is that of eq. 3. The errors of a fit's
four parameters are correlated: where M_s is estimated too large, C_v is estimated too small, and the torque hardly changes.
Tracks of each parameter alone lose that: the slope is then known worse than it was measured. Given φ and ε of each, ξ0 and Δ
of all are jointly normal (generalised least squares with the covariance of every fit), and the evidence has a closed form;
so draws of (φ, ε) from the quantities' own tracks, combined at random, are weighted by joint evidence over the product of
their own:

    y_t = ξ0 + Δ ∘ b_t(φ, ε) + e_t,   e_t ~ N(0, V_t + S)

Where a few combinations would take all weight, the weights are tempered until enough of them count.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from models.arrays import FloatArray
from models.friction.stribeck import StribeckParameters, slope
from models.tracking.courses import CourseForm, basis
from models.tracking.criteria import UNMERGED
from models.tracking.merged_tests import bins_of
from models.tracking.posterior import TrackPosterior
from models.tracking.sampling import systematic, tempered

#: Combinations that are tried.
_TRIED = 3_000


def draw_jointly(
    progress: FloatArray,
    values: FloatArray,
    covariance: FloatArray,
    own: Sequence[TrackPosterior],
    size: int,
    rng: np.random.Generator,
) -> list[TrackPosterior]:
    """`size` joint draws of equal weight of each of q quantities, row by row together, from their own tracks.

    `progress` [t] >= 0 and `values` [t, q] with `covariance` [t, q, q], positive definite: that of the fit and the scatter
    between tests. `own` are the quantities' own samples: of these only φ and ε are used.
    """
    quantities = values.shape[1]
    typical = np.maximum(np.abs(values).max(axis=0), 1e-300)
    scaled, spread = values / typical, covariance / np.outer(typical, typical)
    precision = np.asarray(np.linalg.inv(spread), dtype=np.float64)
    if progress.size > UNMERGED:
        progress, scaled, precision = _merged(progress, scaled, precision)
        spread = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    index = np.stack([systematic(track.weight, _TRIED, float(rng.random())) for track in own], axis=1)
    index = np.take_along_axis(index, np.argsort(rng.random(index.shape), axis=0), axis=0)
    scale = np.stack([np.log(track.scale[i]) for track, i in zip(own, index.T, strict=True)])
    exponent = np.stack([np.log(track.exponent[i]) for track, i in zip(own, index.T, strict=True)])
    b = basis(progress[:, None, None], scale, exponent, np.array(CourseForm.EQ_6))  # [t, q, n]
    mean, root, evidence = _solved(b, scaled, precision)
    for column in range(quantities):
        alone = 1.0 / spread[:, column, column]
        evidence -= _solved(b[:, [column]], scaled[:, [column]], alone[:, None, None])[2]
    drawn_rows = systematic(tempered(np.ones(_TRIED), evidence), size, float(rng.random()))
    drawn = mean[drawn_rows] + np.linalg.solve(
        np.swapaxes(root[drawn_rows], 1, 2), rng.standard_normal((size, 2 * quantities, 1))
    ).squeeze(2)
    drawn = drawn.reshape(size, 2, quantities) * typical
    return [
        TrackPosterior(
            weight=np.full(size, 1.0 / size),
            initial=drawn[:, 0, column],
            change=drawn[:, 1, column],
            scale=np.exp(scale[column, drawn_rows]),
            exponent=np.exp(exponent[column, drawn_rows]),
            scatter=own[column].scatter[index[drawn_rows, column]],
        )
        for column in range(quantities)
    ]


def _merged(
    progress: FloatArray, values: FloatArray, precision: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Progress [t], values [t, q] and precisions [t, q, q] with the tests of each bin of `merged_tests` merged."""
    order = np.argsort(progress, kind="stable")
    first = np.unique(bins_of(progress[order]), return_index=True)[1]
    count = np.diff(np.append(first, progress.size))
    total = np.add.reduceat(precision[order], first, axis=0)
    pulled = np.add.reduceat(np.einsum("tjk,tk->tj", precision[order], values[order]), first, axis=0)
    level = np.linalg.solve(total, pulled[:, :, None])[:, :, 0]
    return np.add.reduceat(progress[order], first) / count, level, total


def _solved(b: FloatArray, values: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Joint posterior of (ξ0 [q], Δ [q]) from values [t, q] with precision matrices `weight` [t, q, q], given b
    [t, q, n]: mean [n, 2q], Cholesky root of the precision [n, 2q, 2q], log evidence [n]."""
    q, n = values.shape[1], b.shape[2]
    around = values[0]
    precision = np.empty((n, 2 * q, 2 * q))
    precision[:, :q, :q] = weight.sum(axis=0)
    precision[:, :q, q:] = np.einsum("tjk,tkn->njk", weight, b)
    precision[:, q:, :q] = np.swapaxes(precision[:, :q, q:], 1, 2)
    precision[:, q:, q:] = np.einsum("tjn,tjk,tkn->njk", b, weight, b, optimize=True)
    precision += np.diag(np.repeat([0.5**-2, 1.0**-2], q))  # of ξ0 and Δ, as weak as the prior of a single track
    pulled = np.einsum("tjk,tk->tj", weight, values - around)
    right = np.empty((n, 2 * q))
    right[:, :q] = pulled.sum(axis=0)
    right[:, q:] = np.einsum("tjn,tj->nj", b, pulled)
    root = np.linalg.cholesky(precision)
    half = np.linalg.solve(root, right[:, :, None])
    mean = np.linalg.solve(np.swapaxes(root, 1, 2), half).squeeze(2)
    mean[:, :q] += around
    log_root = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return mean, root, np.asarray(0.5 * np.square(half).sum(axis=(1, 2)) - log_root)


#: Tests before and after, over which a fit's covariance is averaged: each is estimated from the residuals of its own test
#: and errs as that test does, so that tests that happen to scatter less count for too much. Tried on 100 lives as those of
#: `make score PARTS=shudder`, held at 40/60/80/120 % of life: none 86/87/83/72 %, one 91/92/89/83, two 93/97/93/87, three
#: 91/97/91/90, five 93/96/94/91, all tests 93/99/96/98 (the early ones of which know V_S least); on 300 more two
#: 93/94/90/86, three 93/93/92/88, four 93/94/90/89.
_BESIDE = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureLevel:
    """Tracks and fits at one reference pressure.

    progress [t], parameters [t, 4] and unbiased covariance [t, 4, 4]: the fits that determine all four parameters.
    parameter_tracks: a sample of eq. 6 for each parameter, in the order of PARAMETER_NAMES. cof_scatter [-] is the relative
    scatter of mean COF between tests; torque_per_cof [Nm] is that of a unit COF in the reference test.
    """

    progress: FloatArray
    parameters: FloatArray
    covariance: FloatArray
    parameter_tracks: Sequence[TrackPosterior]
    cof_scatter: float
    torque_per_cof: float


def _parameter_draws(level: PressureLevel, rng: np.random.Generator) -> list[TrackPosterior]:
    """Joint draws of the four parameters at a pressure, under the fits' covariance and the scatter between tests."""
    values, covariance = level.parameters, _averaged(level.covariance)
    scatter = np.array([track.weight @ np.square(track.scatter) for track in level.parameter_tracks])
    # what shifts a whole test's level shifts both torques alike; what else scatters does so as the fits err
    common = level.cof_scatter * values.mean(axis=0) * np.array([1.0, 0.0, 0.0, 1.0])
    usual = covariance.mean(axis=0)
    deviation = np.sqrt(np.maximum(np.diag(usual), 1e-300))
    further = usual / np.outer(deviation, deviation) * np.sqrt(np.outer(scatter, scatter))
    floor = np.diag((1e-5 * np.abs(values).max(axis=0)) ** 2 + 1e-300)
    total = covariance + further + np.outer(common, common) + floor
    return draw_jointly(level.progress, values, total, level.parameter_tracks, 200, rng)


def _averaged(covariance: FloatArray) -> FloatArray:
    """Covariances [t, q, q] of the tests, each averaged with those of up to _BESIDE tests on either side."""
    if len(covariance) > UNMERGED:
        beyond = [covariance[:_BESIDE][::-1], covariance, covariance[-_BESIDE:][::-1]]
        return np.asarray(sliding_window_view(np.concatenate(beyond), 2 * _BESIDE + 1, axis=0).mean(axis=-1))
    places = range(len(covariance))
    return np.stack([covariance[max(0, place - _BESIDE) : place + _BESIDE + 1].mean(axis=0) for place in places])


def slope_paths(level: PressureLevel, velocity: float, progress: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Slope dμ/dv [k, n] s/m at velocity > 0 [m/s] and progress ζ [k] >= 0 of n equal draws.

    The slope's own course is no eq. 6: it rises a little, passes through 0 and falls steeply, so that a track of the fitted
    slopes alone sees shudder far too late. `level` holds at least FEWEST_TESTS tests at different progress. Raises
    ValueError where velocity is not positive.
    """
    if not velocity > 0.0:
        raise ValueError(f"velocity must be positive, got {velocity}")
    courses = np.stack([track.values(progress) for track in _parameter_draws(level, rng)])
    parameters = StribeckParameters.from_array(np.maximum(courses, 0.0))
    return np.asarray(slope(np.array(velocity), parameters) / level.torque_per_cof)
