"""`/degradation`: eq. 6 of mean COF and of every Stribeck parameter, and mean COF computed back from the parameters.

The numerics of the latter are in `models.prognosis.from_parameters`, to which a life hands its tests and tracks by pressure.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from models.clutch import Geometry
from models.friction.stribeck import PARAMETER_NAMES
from models.prognosis.criteria import FEWEST_TESTS, HORIZON, QUANTILES
from models.prognosis.first_passage import ends_of_life
from models.prognosis.first_passage import paths as track_paths
from models.prognosis.from_parameters import (
    CofPaths,
    Disagreement,
    PressureLevel,
    disagreement,
    far_apart,
    mean_cof_paths,
)
from service import records
from service.lives.assumptions import ALL_PRESSURES, Assumptions
from service.lives.history import Life, nearest, nearest_pressure, reference_velocities
from service.lives.parameter_tracks import Track, parameter_tracks, posterior_of, tests_of, track_item
from service.lives.payloads import notice_items
from service.lives.run_analysis import LevelFit, Notice
from service.lives.tracks import offset_of, step_rng
from storage.engine.database import Database

_COEFFICIENTS = ("initial", "change", "scale_cycles", "exponent")
COLUMNS = (
    "quantity",
    "unit",
    "pressure_bar",
    *(f"{name}{part}" for name in _COEFFICIENTS for part in ("", "_sd")),
)


def degradation(database: Database, clutch_id: str) -> dict[str, Any]:
    """Eq. 6 over all pressures together and at every reference pressure, in the present life. Raises NotFoundError."""
    with database.reading() as connection:
        state = records.state(connection, clutch_id)
        levels = records.levels(connection, clutch_id)
    assumptions = state.assumptions()
    head = {"clutch_id": clutch_id, "revision": state.revision}
    life = state.lives[-1] if state.events else None
    if life is None or not life.reference:
        return head | {"items": [], "rebuilt": None, "warnings": []} | assumptions.named() | {"next": None}
    tests = tests_of(life, levels)
    direct = [life.pooled(assumptions), *(life.at(assumptions, level) for level in life.reference)]
    tracked = [(series, posterior_of(clutch_id, series, assumptions)) for series in direct if series.measurements]
    parameters = parameter_tracks(clutch_id, life, assumptions, tests)
    by_pressure = {series.pressure: (series, posterior) for series, posterior in tracked}
    again = _from_parameters(
        clutch_id, life, assumptions, tests, parameters, by_pressure, state.geometry, state.fraction
    )
    return (
        head
        | {
            "items": [
                track_item(series, posterior, assumptions) for series, posterior in (*tracked, *parameters.values())
            ],
            "rebuilt": again,
            "warnings": notice_items(_disagreements(again)),
        }
        | assumptions.named()
        | {"next": None}
    )


def rows(payload: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Eq. 6's coefficients as rows of a table, a row a quantity and pressure."""
    for item in payload["items"]:
        yield (
            {name: item[name] for name in COLUMNS[:3]}
            | {name: _part(item, name, "value") for name in _COEFFICIENTS}
            | {f"{name}_sd": _part(item, name, "sd") for name in _COEFFICIENTS}
        )


def _part(item: Mapping[str, Any], name: str, part: str) -> float | None:
    """A number of a coefficient of eq. 6; None where the quantity does not follow it."""
    coefficients = item["coefficients"]
    return None if coefficients is None else coefficients[name][part]


def _from_parameters(
    clutch_id: str,
    life: Life,
    assumptions: Assumptions,
    tests: Sequence[Sequence[LevelFit]],
    tracks: Mapping[tuple[str, float], Track],
    direct: Mapping[float, Track],
    geometry: Geometry,
    fraction: float,
) -> dict[str, Any] | None:
    """The trajectory from the parameters with its band, its end of life, and its disagreement with the direct track; None
    where there are too few tests.

    `tests` are the levels of each of the life's events; `tracks` are by parameter and pressure, all four at each pressure
    that counts; `direct` is mean COF by pressure and over all reference pressures.
    """
    series, _ = direct[ALL_PRESSURES]
    tested = {measurement.progress for measurement in series.measurements}
    if life.speed_range is None or len(tested) < FEWEST_TESTS:
        return None
    paths = mean_cof_paths(
        [
            _level(life, tests, tracks, direct[level], level, geometry)
            for level in life.reference
            if level in direct and all((name, level) in tracks for name in PARAMETER_NAMES)
        ],
        now=series.measurements[-1].progress,
        horizon=float(series.scale.progress(series.scale.origin + HORIZON)),
        velocities=reference_velocities(life.speed_range, geometry),
        reference_cofs=[cof for cof, _ in life.reference.values()],
        rng=step_rng(clutch_id, "rebuilt", series, len(series.measurements)),
    )
    return None if paths is None else _payload(paths, direct[ALL_PRESSURES], assumptions, fraction)


def _disagreements(payload: Mapping[str, Any] | None) -> list[Notice]:
    """A warning where the two ways are further apart than their uncertainty."""
    if payload is None:
        return []
    words = {"now_sd": "the value now", "end_of_life_sd": "the median end of life"}
    return [
        Notice(
            code="tracks_disagree",
            message=f"{words[name]} from the Stribeck parameters is {value:+.1f} deviations off the direct track's",
        )
        for name, value in payload["disagreement"].items()
        if far_apart(value)
    ]


def _level(
    life: Life,
    tests: Sequence[Sequence[LevelFit]],
    tracks: Mapping[tuple[str, float], Track],
    direct: Track,
    pressure: float,
    geometry: Geometry,
) -> PressureLevel:
    """What is known at a reference pressure [Pa]: its tracks, and the tests whose fit determines all four parameters."""
    series, posterior = direct
    progress, fits = [], []
    for event, levels in zip(life.events, tests, strict=True):
        determined = {level.fit.pressure: level.fit for level in levels if not level.fit.undetermined}
        near = nearest_pressure(pressure, list(determined))
        if near is not None:
            progress.append(float(series.scale.progress(event.cycles)))
            fits.append(determined[near])
    return PressureLevel(
        progress=np.array(progress),
        parameters=np.array([fit.parameters.as_array() for fit in fits]),
        covariance=np.array([fit.covariance for fit in fits]),
        parameter_tracks=[tracks[name, pressure][1] for name in PARAMETER_NAMES],
        tests=series.events,
        cof_progress=np.array([measurement.progress for measurement in series.measurements]),
        cof=np.array([measurement.value for measurement in series.measurements]),
        cof_track=posterior,
        torque_per_cof=_torque_per_cof(life, tests, pressure, geometry),
        reference_cof=life.reference[pressure][0],
    )


def _torque_per_cof(life: Life, tests: Sequence[Sequence[LevelFit]], pressure: float, geometry: Geometry) -> float:
    """Torque [Nm] of a COF of one at a level, by the pressure that the reference test measured there."""
    reference = next((levels for event, levels in zip(life.events, tests, strict=True) if event.cofs and levels), ())
    measured = {level.fit.pressure: (level.mean_pressure, 0.0) for level in reference}
    return geometry.torque_per_cof((nearest(pressure, measured) or (pressure, 0.0))[0])


def _payload(paths: CofPaths, direct: Track, assumptions: Assumptions, fraction: float) -> dict[str, Any]:
    """The paths of mean COF in the public shape, beside the direct track."""
    series, _ = direct
    now = float(paths.progress[paths.now])
    ends = series.scale.cycles(paths.ends_of_life(fraction))
    shown = paths.progress <= max(1.0, now) * 1.5
    cap = series.scale.origin + HORIZON
    quantiles = np.quantile(np.minimum(ends, 10 * cap), QUANTILES).tolist()
    apart = _apart(paths, ends, direct, assumptions, fraction)
    return {
        "trajectory": {
            "cycles": series.scale.cycles(paths.progress)[shown].tolist(),
            **{name: row[shown].tolist() for name, row in zip(("lower", "median", "upper"), paths.band(), strict=True)},
        },
        "end_of_life_cycles": {
            f"{q:g}": None if value > cap else value for q, value in zip(QUANTILES, quantiles, strict=True)
        },
        "disagreement": {"now_sd": apart.now, "end_of_life_sd": apart.end_of_life},
    }


def _apart(
    paths: CofPaths,
    ends: np.ndarray[Any, np.dtype[np.float64]],
    direct: Track,
    assumptions: Assumptions,
    fraction: float,
) -> Disagreement:
    """How far the value now and the `ends` of life [n] cycles are from the direct track's."""
    series, posterior = direct
    offset = offset_of(series, assumptions)
    horizon = float(paths.progress[-1])
    return disagreement(
        paths.present,
        ends,
        track_paths(posterior, paths.progress[paths.now : paths.now + 1], offset)[0],
        series.scale.cycles(ends_of_life(posterior, fraction, offset=offset, horizon=horizon)),
        posterior.weight,
        series.scale.origin,
    )
