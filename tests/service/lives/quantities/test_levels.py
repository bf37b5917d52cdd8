"""What follows from the fits of a life together is weighed by their unbiased covariance."""

import numpy as np

from models.loops.lag_fit import StationaryCurve
from models.rig.truth import draw
from service.lives.quantities.measured import parameter_tracks, posterior_of, pressure_level
from tests.score.measured_lives import PLACE, measured_life


def test_a_level_and_the_curve_of_a_loop_have_the_unbiased_covariance() -> None:
    rng = np.random.default_rng(5)
    measured = measured_life(draw(rng), [0.0, 2_000.0, 4_000.0, 6_000.0], rng)
    pressure, cof = list(measured.mean_cofs().items())[PLACE]
    tracks = parameter_tracks(measured.life, measured.assumptions, measured.tests, pressures={pressure})
    direct = cof, posterior_of(cof, measured.assumptions)
    level = pressure_level(measured, tracks, direct, pressure)
    fits = [levels[PLACE].fit for levels in measured.tests]
    np.testing.assert_array_equal(level.covariance, [fit.unbiased_covariance for fit in fits])
    for fit in fits:
        np.testing.assert_array_equal(StationaryCurve.of(fit).covariance, fit.unbiased_covariance)
        assert (fit.unbiased_covariance.diagonal() < fit.covariance.diagonal()).all()
