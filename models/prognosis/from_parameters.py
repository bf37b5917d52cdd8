"""Mean COF from the Stribeck parameters' own tracks, a second way to the number that its direct track gives; and dμ/dv.

Each parameter at each reference pressure follows its own eq. 6. At any ζ eq. 3 gives the torque over the protocol's
velocities, and the mean of that over velocities and pressures, divided by the torque of a unit COF, is mean COF again:

    μ(ζ) = Σ_p mean_v S(v; θ_p(ζ)) / (torque per COF at p) / (number of pressures)

The parameters of one pressure are drawn jointly (`draw_jointly`), the pressures are combined with the
correlation that their tests' direct mean COF shows (`paired`). Where pressures lack parameters the paths are
scaled by mean COF of the reference test over all its pressures to that over those that take part. Where the two ways
disagree by more than their uncertainty, eq. 6 cannot hold of both.

The errors of a fit's four parameters are correlated: where M_s is estimated too large, C_v is estimated too small, and the
torque hardly changes. Tracks of each parameter alone lose that: their sum is then known worse than it was measured. Given
φ and ε of each, ξ0 and Δ of all are jointly normal (generalised least squares with the covariance of every fit), and the
evidence has a closed form; so draws of (φ, ε) from the quantities' own tracks, combined at random, are weighted by joint
evidence over the product of their own:

    y_t = ξ0 + Δ ∘ b_t(φ, ε) + e_t,   e_t ~ N(0, V_t + S)

Where a few combinations would take all weight, the weights are tempered until enough of them count. `paired` combines draws
of several pressures: a normal with the wanted correlation is drawn, and each column's draws are put into the order of its
ranks.

Source: R. L. Iman, W. J. Conover, Commun. Stat. Simul. Comput. 11 (1982) 311-334, for the pairing.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.friction.stribeck import StribeckParameters, slope, torque
from models.prognosis.criteria import BAND, FAR_APART, FEWEST_TESTS, HORIZON
from models.prognosis.first_passage import first_below, places, weighted_quantiles
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
    """`size` equal draws of each of q quantities, row by row together, from their own tracks.

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
    """Progress [t], values [t, q] and precisions [t, q, q] with tests of one bin as one: the bins of `merged_tests`."""
    order = np.argsort(progress, kind="stable")
    first = np.unique(bins_of(progress[order]), return_index=True)[1]
    count = np.diff(np.append(first, progress.size))
    total = np.add.reduceat(precision[order], first, axis=0)
    pulled = np.add.reduceat(np.einsum("tjk,tk->tj", precision[order], values[order]), first, axis=0)
    level = np.linalg.solve(total, pulled[:, :, None])[:, :, 0]
    return np.add.reduceat(progress[order], first) / count, level, total


def _solved(b: FloatArray, values: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of (ξ0 [q], Δ [q]) given b [t, q, n]: mean [n, 2q], Cholesky root of the precision [n, 2q, 2q], log evidence [n]."""
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


def shrunk_correlation(residuals: FloatArray) -> FloatArray:
    """The correlation [k, k] of residuals [t, k] from test to test, shrunk towards none."""
    count, size = residuals.shape
    spread = residuals.std(axis=0) if count > 1 else np.zeros(size)
    if not (spread > 0.0).all():
        return np.eye(size)
    scaled = (residuals - residuals.mean(axis=0)) / spread
    share = count / (count + 5.0)  # no correlation is worth five tests
    return np.asarray(share * scaled.T @ scaled / count + (1.0 - share) * np.eye(size))


def paired(values: FloatArray, wanted: FloatArray, rng: np.random.Generator) -> NDArray[np.intp]:
    """Which draw of each column stands in each row [n, k], so that values [n, k] have about the correlation [k, k]."""
    n, k = values.shape
    roots, vectors = np.linalg.eigh(wanted)
    normals = rng.standard_normal((n, k)) @ (vectors * np.sqrt(np.maximum(roots, 0.0))).T
    order = np.argsort(values, axis=0, kind="stable")
    ranks = np.argsort(np.argsort(normals, axis=0, kind="stable"), axis=0, kind="stable")
    return np.asarray(np.take_along_axis(order, ranks, axis=0), dtype=np.intp)


#: Draws, and places of the paths: evenly up to now, and in equal ratios beyond.
_BEHIND = 24
#: Tests before and after, over which a fit's covariance is averaged: each is estimated from the residuals of its own test
#: and errs as that test does, so that tests that happen to scatter less count for too much. Tried on 100 lives as those of
#: `make score PARTS=shudder`, held at 40/60/80/120 % of life: none 86/87/83/72 %, one 91/92/89/83, two 93/97/93/87, three
#: 91/97/91/90, five 93/96/94/91, all tests 93/99/96/98 (the early ones of which know V_S least); on 300 more two
#: 93/94/90/86, three 93/93/92/88, four 93/94/90/89.
_BESIDE = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureLevel:
    """What is known at one reference pressure.

    progress [t], parameters [t, 4] and unbiased covariance [t, 4, 4]: the fits that determine all four parameters.
    parameter_tracks: a sample of eq. 6 for each parameter, in the order of PARAMETER_NAMES. tests [m] numbers the tests
    whose mean COF was measured at cof_progress [m] as cof [m], m >= 1; cof_track is its sample. torque_per_cof [Nm] of a
    unit COF and reference_cof [-] are those of the reference test.
    """

    progress: FloatArray
    parameters: FloatArray
    covariance: FloatArray
    parameter_tracks: Sequence[TrackPosterior]
    tests: Sequence[int]
    cof_progress: FloatArray
    cof: FloatArray
    cof_track: TrackPosterior
    torque_per_cof: float
    reference_cof: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CofPaths:
    """Mean COF [k, n] of n draws at progress [k], of which row `now` is at the last measurement."""

    progress: FloatArray
    paths: FloatArray
    now: int

    @property
    def present(self) -> FloatArray:
        """Mean COF [n] at the last measurement."""
        return np.asarray(self.paths[self.now])

    def band(self) -> FloatArray:
        """The quantiles BAND of mean COF at progress [k]; [3, k]."""
        return np.asarray(np.quantile(self.paths, BAND, axis=1))

    def ends_of_life(self, fraction: float) -> FloatArray:
        """The ζ [n] at which each draw first comes down to `fraction` of its value at ζ = 0; inf where it never does."""
        return first_below(self.paths, self.progress, fraction * self.paths[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackDisagreement:
    """COF from parameters less the direct track: of the value now, in deviations of both together, and of the median end of
    life, in those of its logarithm. None where there is no uncertainty, or one of them lies beyond the horizon."""

    now: float | None
    end_of_life: float | None


def far_apart(deviations: float | None) -> bool:
    """Whether two ways to one number, so many deviations apart, disagree."""
    return deviations is not None and abs(deviations) > FAR_APART


def mean_cof_paths(
    levels: Sequence[PressureLevel],
    *,
    now: float,
    horizon: float,
    velocities: FloatArray,
    reference_cofs: Sequence[float],
    rng: np.random.Generator,
) -> CofPaths | None:
    """Mean COF from `now` >= 0, the last progress measured, back to 0 and on to `horizon`; None where it cannot be computed.

    velocities [v] m/s are the protocol's, `reference_cofs` the reference test's mean COF at every pressure. Levels with
    fewer than FEWEST_TESTS tests at different progress take no part.
    """
    progress = places(now, horizon, _BEHIND, 49)
    parts, at_levels = [], []
    for level in levels:
        if np.unique(level.progress).size >= FEWEST_TESTS:
            parts.append(level)
            at_levels.append(_mean_torque(parameter_draws(level, rng), progress, velocities) / level.torque_per_cof)
    if not parts:
        return None
    taking_part = math.fsum(level.reference_cof for level in parts) / len(parts)
    share = math.fsum(reference_cofs) / len(reference_cofs) / taking_part
    return CofPaths(progress=progress, paths=_together(parts, at_levels, rng) * share, now=_BEHIND - 1)


def disagreement(
    now: FloatArray,
    ends: FloatArray,
    direct_now: FloatArray,
    direct_ends: FloatArray,
    weight: FloatArray,
    origin: float,
) -> TrackDisagreement:
    """How far mean COF `now` [n] and `ends` of life [n] cycles from the parameters are from those of the direct track, [m]
    each with weight [m]; the life began at `origin` [cycles]."""
    mean = float(weight @ direct_now)
    variance = float(weight @ np.square(direct_now - mean))
    both = math.sqrt(0.5 * (variance + float(now.var())))
    cap = 10.0 * HORIZON
    logarithms = [
        np.log(np.maximum(quantiles - origin, 1.0))
        for quantiles in (
            np.quantile(np.minimum(ends, origin + cap), BAND),
            weighted_quantiles(np.minimum(direct_ends, origin + cap), weight, BAND),
        )
    ]
    beyond = any(math.exp(median) > HORIZON for _, median, _ in logarithms)
    # of a normal's 90 % interval, in deviations
    spread = math.sqrt(0.5 * sum(((high - low) / 3.29) ** 2 for low, _, high in logarithms))
    return TrackDisagreement(
        now=(float(now.mean()) - mean) / both if both > 0.0 else None,
        end_of_life=None if beyond or spread == 0.0 else float(logarithms[0][1] - logarithms[1][1]) / spread,
    )


def parameter_draws(level: PressureLevel, rng: np.random.Generator) -> list[TrackPosterior]:
    """Joint draws of the four parameters at a pressure, under the fits' covariance and the scatter between tests."""
    values, covariance = level.parameters, _averaged(level.covariance)
    scatter = np.array([track.weight @ np.square(track.scatter) for track in level.parameter_tracks])
    gain = float(level.cof_track.weight @ level.cof_track.scatter) / float(level.cof[0])
    # what shifts a whole test's level shifts both torques alike; what else scatters does so as the fits err
    common = gain * values.mean(axis=0) * np.array([1.0, 0.0, 0.0, 1.0])
    usual = covariance.mean(axis=0)
    deviation = np.sqrt(np.maximum(np.diag(usual), 1e-300))
    further = usual / np.outer(deviation, deviation) * np.sqrt(np.outer(scatter, scatter))
    floor = np.diag((1e-5 * np.abs(values).max(axis=0)) ** 2 + 1e-300)
    total = covariance + further + np.outer(common, common) + floor
    return draw_jointly(level.progress, values, total, level.parameter_tracks, 200, rng)


def _averaged(covariance: FloatArray) -> FloatArray:
    """Covariances [t, q, q], each the mean of those of its own and the neighbouring tests."""
    if len(covariance) > UNMERGED:
        beyond = [covariance[:_BESIDE][::-1], covariance, covariance[-_BESIDE:][::-1]]
        return np.asarray(sliding_window_view(np.concatenate(beyond), 2 * _BESIDE + 1, axis=0).mean(axis=-1))
    places = range(len(covariance))
    return np.stack([covariance[max(0, place - _BESIDE) : place + _BESIDE + 1].mean(axis=0) for place in places])


def _mean_torque(draws: Sequence[TrackPosterior], progress: FloatArray, velocities: FloatArray) -> FloatArray:
    """Mean torque over velocities [m] at ζ [k] of every draw of the four parameters; [k, n]."""
    parameters = _parameters_at(draws, progress)
    total: FloatArray = np.zeros(np.shape(parameters.static_torque))
    for velocity in velocities.tolist():
        total += torque(np.array(velocity), parameters)
    return np.asarray(total / velocities.size)


def _together(levels: Sequence[PressureLevel], at_levels: Sequence[FloatArray], rng: np.random.Generator) -> FloatArray:
    """The mean over levels of paths [k, n], paired so that they are correlated as the levels' tests are."""
    residuals: dict[int, list[float]] = {}
    for level in levels:
        expected = level.cof_track.values(level.cof_progress) @ level.cof_track.weight
        for test, residual in zip(level.tests, (level.cof - expected).tolist(), strict=True):
            residuals.setdefault(test, []).append(residual)
    complete = [row for _, row in sorted(residuals.items()) if len(row) == len(levels)]
    correlation = shrunk_correlation(np.array(complete).reshape(-1, len(levels)))
    index = paired(np.stack([paths[_BEHIND - 1] for paths in at_levels], axis=1), correlation, rng)
    return np.asarray(np.mean([paths[:, index[:, i]] for i, paths in enumerate(at_levels)], axis=0))


def slope_paths(level: PressureLevel, velocity: float, progress: FloatArray, rng: np.random.Generator) -> FloatArray:
    """dμ/dv [s/m] at velocity > 0 [m/s] and progress ζ [k] >= 0 of n equal draws; [k, n].

    The slope's own course is no eq. 6: it rises a little, passes through 0 and falls steeply, so that a track of the fitted
    slopes alone sees shudder far too late. `level` holds at least FEWEST_TESTS tests at different progress. Raises
    ValueError where velocity is not positive.
    """
    if not velocity > 0.0:
        raise ValueError(f"velocity must be positive, got {velocity}")
    parameters = _parameters_at(parameter_draws(level, rng), progress)
    return np.asarray(slope(np.array(velocity), parameters) / level.torque_per_cof)


def _parameters_at(draws: Sequence[TrackPosterior], progress: FloatArray) -> StribeckParameters:
    """The four parameters of every draw at ζ [k]; [k, n] each."""
    return StribeckParameters.from_array(np.maximum(np.stack([track.values(progress) for track in draws]), 0.0))
