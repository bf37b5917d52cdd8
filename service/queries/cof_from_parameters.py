"""Mean COF rebuilt from the Stribeck parameters' own tracks, beside its direct track: two ways to one number.

Each parameter at each reference pressure follows its own eq. 6; at any count of cycles eq. 3 gives the torque over the
protocol's velocities, and its mean over velocities and pressures is mean COF again. Where the two ways disagree by more than
their uncertainty, eq. 6 cannot hold of both.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.stribeck import PARAMETER_NAMES, StribeckParameters, torque
from models.prognosis.first_passage import HORIZON, QUANTILES, ends_of_life, weighted_quantiles
from models.prognosis.first_passage import paths as bare_paths
from models.prognosis.from_parameters import correlation, first_below, joint, paired
from models.tracking.posterior import Posterior
from service.lives.assumptions import ALL_PRESSURES, Assumptions
from service.lives.criteria import FEWEST_TESTS
from service.lives.history import Life, Series, nearest, reference_velocities
from service.lives.parameter_tracks import Track
from service.lives.run_analysis import LevelFit, Notice
from service.lives.tracks import offset_of, step_rng

#: Draws of each track, and where the paths are looked at: up to now, and in equal ratios beyond.
DRAWS, BEHIND, AHEAD = 200, 24, 48
#: The two ways disagree where they are further apart than this many deviations.
FAR = 3.0
_BAND = (0.05, 0.5, 0.95)
_COVERED = 3.29  # deviations of a normal between its 5 and 95 % quantiles


def rebuilt(
    clutch_id: str,
    life: Life,
    assumptions: Assumptions,
    tests: Sequence[Sequence[LevelFit]],
    tracks: Mapping[tuple[str, float], Track],
    direct: Mapping[float, Track],
    geometry: Geometry,
    fraction: float,
) -> dict[str, Any] | None:
    """The rebuilt trajectory with its band, its end of life, and how far it is from the direct one; None where it cannot be.

    `tests` are the levels of each of the life's events; `tracks` are by parameter and pressure, all four at each pressure
    that counts; `direct` is mean COF by pressure and over all reference pressures.
    """
    series, posterior = direct[ALL_PRESSURES]
    if life.speed_range is None or len({each.progress for each in series.measurements}) < FEWEST_TESTS:
        return None
    rng = step_rng(clutch_id, "rebuilt", series, len(series.measurements))
    velocities = reference_velocities(life.speed_range, geometry)
    zeta = _places(series)
    at_levels = {}
    for level in life.reference:
        if level in direct and all((name, level) in tracks for name in PARAMETER_NAMES):
            draws = _drawn(life, tests, tracks, direct[level], level, rng)
            if draws is not None:
                per_cof = _torque_per_cof(life, tests, level, geometry)
                at_levels[level] = _mean_torque(draws, zeta, velocities) / per_cof
    if not at_levels:
        return None
    paths = _together(at_levels, direct, rng) * _share(life, list(at_levels))
    return _told(paths, zeta, series, posterior, assumptions, fraction)


def disagreements(said: Mapping[str, Any] | None) -> list[Notice]:
    """A warning where the two ways are further apart than their uncertainty."""
    if said is None:
        return []
    apart = {name: value for name, value in said["disagreement"].items() if value is not None and abs(value) > FAR}
    words = {"now_sd": "the value now", "end_of_life_sd": "the median end of life"}
    return [
        Notice(
            code="tracks_disagree",
            message=f"{words[name]} rebuilt from the Stribeck parameters is {value:+.1f} deviations off the direct track's",
        )
        for name, value in apart.items()
    ]


def _told(
    paths: FloatArray, zeta: FloatArray, series: Series, posterior: Posterior, assumptions: Assumptions, fraction: float
) -> dict[str, Any]:
    """The paths [k, n] of mean COF at ζ [k] in the public shape, beside the direct track."""
    now, origin = zeta[BEHIND - 1], series.scale.origin
    ends = series.scale.cycles(first_below(paths, zeta, fraction * paths[0]))
    offset = offset_of(series, assumptions)
    direct_now = bare_paths(posterior, np.array([now]), offset)[0]
    direct_ends = series.scale.cycles(ends_of_life(posterior, fraction, offset=offset, horizon=float(zeta[-1])))
    band = np.quantile(paths, _BAND, axis=1)
    shown = zeta <= max(1.0, now) * 1.5
    cap = origin + HORIZON
    quantiles = np.quantile(np.minimum(ends, 10 * cap), QUANTILES).tolist()
    return {
        "trajectory": {
            "cycles": series.scale.cycles(zeta)[shown].tolist(),
            **{name: band[i][shown].tolist() for i, name in enumerate(("lower", "median", "upper"))},
        },
        "end_of_life_cycles": {
            f"{q:g}": None if value > cap else value for q, value in zip(QUANTILES, quantiles, strict=True)
        },
        "disagreement": _disagreement(paths[BEHIND - 1], ends, (direct_now, direct_ends, posterior.weight), origin),
    }


def _places(series: Series) -> FloatArray:
    """ζ at which the paths are looked at: evenly up to now, and in equal ratios to the horizon."""
    now = series.measurements[-1].progress
    start = max(now, 1.0)
    last = max(float(series.scale.progress(series.scale.origin + HORIZON)), 2.0 * start)
    return np.concatenate([np.linspace(0.0, now, BEHIND), np.geomspace(start * 1.02, last, AHEAD)])


def _drawn(
    life: Life,
    tests: Sequence[Sequence[LevelFit]],
    tracks: Mapping[tuple[str, float], Track],
    direct: Track,
    level: float,
    rng: np.random.Generator,
) -> list[Posterior] | None:
    """Joint draws of the four parameters at a pressure, from the tests whose fit tells all four; None from too few."""
    own = [tracks[name, level][1] for name in PARAMETER_NAMES]
    scale, found = direct[0].scale, []
    for event, levels in zip(life.events, tests, strict=True):
        fits = {each.fit.pressure: each.fit for each in levels if not each.fit.undetermined}
        near = nearest(level, {pressure: (pressure, 0.0) for pressure in fits})
        if near is not None:
            fit = fits[near[0]]
            found.append((float(scale.progress(event.cycles)), fit.parameters.as_array(), fit.covariance))
    if len({progress for progress, _, _ in found}) < FEWEST_TESTS:
        return None
    values = np.array([row for _, row, _ in found])
    covariance = np.array([each for _, _, each in found])
    scatter = np.array([each.weight @ np.square(each.scatter) for each in own])
    gain = float(direct[1].weight @ direct[1].scatter) / direct[0].measurements[0].value
    # what shifts a whole test's level shifts both torques alike; what else scatters does so as the fits err
    common = gain * values.mean(axis=0) * np.array([1.0, 0.0, 0.0, 1.0])
    usual = covariance.mean(axis=0)
    deviation = np.sqrt(np.maximum(np.diag(usual), 1e-300))
    further = usual / np.outer(deviation, deviation) * np.sqrt(np.outer(scatter, scatter))
    floor = np.diag((1e-5 * np.abs(values).max(axis=0)) ** 2 + 1e-300)
    total = covariance + further + np.outer(common, common) + floor
    return joint(np.array([progress for progress, _, _ in found]), values, total, own, DRAWS, rng)


def _torque_per_cof(life: Life, tests: Sequence[Sequence[LevelFit]], level: float, geometry: Geometry) -> float:
    """Torque [Nm] of a COF of one at a level, by the pressure that the reference test measured there."""
    first = next(each for event, each in zip(life.events, tests, strict=True) if event.cofs and each)
    measured = {each.fit.pressure: (each.mean_pressure, 0.0) for each in first}
    return geometry.torque_per_cof((nearest(level, measured) or (level, 0.0))[0])


def _mean_torque(draws: Sequence[Posterior], zeta: FloatArray, velocities: FloatArray) -> FloatArray:
    """Mean torque over velocities [m] at ζ [k] of every draw of the four parameters; [k, n]."""
    values = np.maximum(np.stack([each.values(zeta) for each in draws]), 0.0)
    parameters = StribeckParameters.from_array(values)
    total: FloatArray = np.zeros(values.shape[1:])
    for velocity in velocities.tolist():
        total += torque(np.array(velocity), parameters)
    return np.asarray(total / velocities.size)


def _together(
    at_levels: Mapping[float, FloatArray], direct: Mapping[float, Track], rng: np.random.Generator
) -> FloatArray:
    """The mean over levels of paths [k, n], paired so that they are correlated as the levels' tests are."""
    off: dict[int, list[float]] = {}
    for level in at_levels:
        series, posterior = direct[level]
        middle = posterior.values(np.array([each.progress for each in series.measurements])) @ posterior.weight
        for event, each, expected in zip(series.events, series.measurements, middle.tolist(), strict=True):
            off.setdefault(event, []).append(each.value - expected)
    whole = [row for _, row in sorted(off.items()) if len(row) == len(at_levels)]
    wanted = correlation(np.array(whole).reshape(-1, len(at_levels)))
    now = np.stack([paths[BEHIND - 1] for paths in at_levels.values()], axis=1)
    index = paired(now, wanted, rng)
    return np.asarray(np.mean([paths[:, index[:, i]] for i, paths in enumerate(at_levels.values())], axis=0))


def _share(life: Life, levels: Sequence[float]) -> float:
    """Mean COF of the reference over all its pressures, over that of the levels that take part."""
    reference = life.reference
    every = math.fsum(value for value, _ in reference.values()) / len(reference)
    return every / (math.fsum(reference[level][0] for level in levels) / len(levels))


def _disagreement(
    now: FloatArray, ends: FloatArray, direct: tuple[FloatArray, FloatArray, FloatArray], origin: float
) -> dict[str, float | None]:
    """Rebuilt less direct: of the value now, in deviations of both together, and of the median end of life, in those of
    its logarithm. None where one of them lies beyond the horizon."""
    direct_now, direct_ends, weight = direct
    mean = float(weight @ direct_now)
    variance = float(weight @ np.square(direct_now - mean))
    both = math.sqrt(0.5 * (variance + float(now.var())))
    cap = 10.0 * HORIZON
    levels = [
        np.log(np.maximum(quantiles - origin, 1.0))
        for quantiles in (
            np.quantile(np.minimum(ends, origin + cap), _BAND),
            weighted_quantiles(np.minimum(direct_ends, origin + cap), weight, _BAND),
        )
    ]
    beyond = any(math.exp(level[1]) > HORIZON for level in levels)
    spread = math.sqrt(0.5 * sum(((level[2] - level[0]) / _COVERED) ** 2 for level in levels))
    return {
        "now_sd": (float(now.mean()) - mean) / both if both > 0.0 else None,
        "end_of_life_sd": None if beyond or spread == 0.0 else float(levels[0][1] - levels[1][1]) / spread,
    }
