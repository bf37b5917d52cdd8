"""What is known of the four Stribeck parameters at one pressure, for what follows from all of them together."""

from collections.abc import Mapping

import numpy as np

from models.arrays import FloatArray
from models.friction.stribeck import PARAMETER_NAMES
from models.prognosis.criteria import FEWEST_TESTS
from models.prognosis.from_parameters import PressureLevel
from models.prognosis.slope_paths import slope_paths
from service.columns import RADIANS_PER_SECOND_PER_RPM
from service.lives.history import nearest, nearest_pressure
from service.lives.quantities.measured import MeasuredLife
from service.lives.quantities.parameters import Track
from service.lives.tracks import step_rng

#: Tracks of the parameters by name and pressure [Pa].
ParameterTracks = Mapping[tuple[str, float], Track]


def pressure_level(measured: MeasuredLife, tracks: ParameterTracks, direct: Track, pressure: float) -> PressureLevel:
    """What is known at a reference pressure [Pa]: its tracks, and the tests whose fit determines all four parameters.

    `direct` is mean COF at that pressure. Raises KeyError where a parameter has no track there.
    """
    series, posterior = direct
    progress, fits = [], []
    for event, levels in zip(measured.life.events, measured.tests, strict=True):
        determined = {level.fit.pressure: level.fit for level in levels if not level.fit.undetermined}
        near = nearest_pressure(pressure, list(determined))
        if near is not None:
            progress.append(float(series.scale.progress(event.cycles)))
            fits.append(determined[near])
    return PressureLevel(
        progress=np.array(progress),
        parameters=np.array([fit.parameters.as_array() for fit in fits]),
        covariance=np.array([fit.unbiased_covariance for fit in fits]),
        parameter_tracks=[tracks[name, pressure][1] for name in PARAMETER_NAMES],
        tests=series.events,
        cof_progress=np.array([measurement.progress for measurement in series.measurements]),
        cof=np.array([measurement.value for measurement in series.measurements]),
        cof_track=posterior,
        torque_per_cof=_torque_per_cof(measured, pressure),
        reference_cof=measured.life.reference[pressure][0],
    )


def slopes_along(
    measured: MeasuredLife, tracks: ParameterTracks, direct: Track, speed_rpm: float, progress: FloatArray
) -> FloatArray | None:
    """dμ/dv [k, n] at a speed and progress [k] in joint draws of the parameters at the pressure of the `direct` track of
    mean COF, the same each time; None with too few tests."""
    series, _ = direct
    if not all((name, series.pressure) in tracks for name in PARAMETER_NAMES):
        return None
    level = pressure_level(measured, tracks, direct, series.pressure)
    if np.unique(level.progress).size < FEWEST_TESTS:
        return None
    velocity = float(measured.geometry.sliding_velocity(np.array(speed_rpm * RADIANS_PER_SECOND_PER_RPM)))
    rng = step_rng(measured.clutch_id, f"slope@{speed_rpm:g}rpm", series, level.progress.size)
    return slope_paths(level, velocity, progress, rng)


def _torque_per_cof(measured: MeasuredLife, pressure: float) -> float:
    """Torque [Nm] of a COF of one at a level, by the pressure that the reference test measured there."""
    tests = zip(measured.life.events, measured.tests, strict=True)
    reference = next((levels for event, levels in tests if event.cofs and levels), ())
    means = {level.fit.pressure: (level.mean_pressure, 0.0) for level in reference}
    return measured.geometry.torque_per_cof((nearest(pressure, means) or (pressure, 0.0))[0])
