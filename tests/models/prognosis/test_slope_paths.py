"""dμ/dv from the parameters' tracks against eq. 3 and eq. 6 by themselves; joint draws against what was measured."""

from dataclasses import replace

import numpy as np
import pytest

from models.degradation.general_order import DegradationLaw, value
from models.friction.stribeck import StribeckParameters, slope
from models.prognosis.slope_paths import PressureLevel, draw_jointly, slope_paths
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import weak
from tests.models.tracking.tracked_series import draws_of, on_grid, sent

AT = np.linspace(0.0, 12_000.0, 13)
#: Eq. 6 of M_s [Nm], M̄_c, V_S [m/s] and C_v at 5 bar.
TRUTHS = (
    DegradationLaw(initial=25.0, change=-14.0, scale=4_000.0, exponent=0.6),
    DegradationLaw(initial=0.8, change=-0.3, scale=5_000.0, exponent=0.8),
    DegradationLaw(initial=5.0, change=-3.0, scale=3_000.0, exponent=1.0),
    DegradationLaw(initial=1.5, change=1.0, scale=6_000.0, exponent=0.9),
)
PER_COF = 150.0


def track(truth: DegradationLaw, size: int = 40) -> TrackPosterior:
    """A sample that is sure of its coefficients."""
    law = {"initial": truth.initial, "change": truth.change, "scale": truth.scale, "exponent": truth.exponent}
    return draws_of(size, **law, scatter=1e-6)


def level() -> PressureLevel:
    parameters = np.stack([value(AT, truth) for truth in TRUTHS], axis=1)
    return PressureLevel(
        progress=AT,
        parameters=parameters,
        covariance=np.tile(np.diag((1e-4 * parameters[0]) ** 2), (AT.size, 1, 1)),
        parameter_tracks=[track(truth) for truth in TRUTHS],
        cof_scatter=1e-5,
        torque_per_cof=PER_COF,
    )


def slopes_of_truth(velocity: float) -> np.ndarray:
    """dμ/dv [k] of eq. 3 with the parameters of TRUTHS."""
    at = StribeckParameters.from_array(np.stack([value(AT, truth) for truth in TRUTHS]))
    return slope(np.array(velocity), at) / PER_COF


@pytest.mark.parametrize("velocity", [0.5, 2.0, 10.0])
def test_sure_tracks_give_the_slope_of_eq_3_with_eq_6(velocity: float) -> None:
    found = slope_paths(level(), velocity, AT, np.random.default_rng(0))
    truth = slopes_of_truth(velocity)
    assert found.mean(axis=1) == pytest.approx(truth, abs=2e-3 * np.abs(truth).max())
    with pytest.raises(ValueError, match="positive"):
        slope_paths(level(), 0.0, AT, np.random.default_rng(0))


def test_a_test_that_happens_to_scatter_little_does_not_count_for_all() -> None:
    """Its static torque is 5 % off and its residuals by chance small: the others' covariances tell what it is worth."""
    usual = level()
    parameters, covariance = usual.parameters.copy(), 1e4 * usual.covariance
    parameters[-1, 0] *= 1.05
    covariance[-1] *= 1e-4
    several = replace(usual, parameters=parameters, covariance=covariance)
    found = slope_paths(several, 2.0, AT[-1:], np.random.default_rng(0))
    assert found.mean() == pytest.approx(slopes_of_truth(2.0)[-1], rel=0.025)


# --- Quantities whose measurements err together: what only their sum knows is not lost.

PAIR = (
    DegradationLaw(initial=20.0, change=-9.0, scale=5000.0, exponent=0.8),
    DegradationLaw(initial=5.0, change=3.0, scale=9000.0, exponent=0.5),
)
#: One errs by +1 where the other errs by -1: their sum is known a hundred times better.
COVARIANCE = np.array([[0.25, -0.24998], [-0.24998, 0.25]])


def measured(rng: np.random.Generator) -> np.ndarray:
    errors = rng.multivariate_normal(np.zeros(2), COVARIANCE, AT.size)
    return np.stack([value(AT, truth) for truth in PAIR], axis=1) + errors


def own(values: np.ndarray, rng: np.random.Generator) -> list[TrackPosterior]:
    """Each quantity's track by itself."""
    tests = [sent(AT, column, 0.25) for column in values.T]
    return [on_grid(seen, 1000, rng, weak(seen[0], falling=False)) for seen in tests]


def test_the_sum_is_known_as_well_as_it_was_measured() -> None:
    rng = np.random.default_rng(1)
    values = measured(rng)
    tracks = own(values, rng)
    together = draw_jointly(AT, values, np.repeat(COVARIANCE[None], AT.size, axis=0), tracks, 300, rng)
    end = AT[-1:]
    sums = sum(each.values(end)[0] for each in together)
    true = float(sum(value(AT[-1], truth) for truth in PAIR))
    assert abs(sums.mean() - true) < 0.05
    assert sums.std() < 0.05
    # the negative control: side by side, the two tracks know their sum no better than each knows itself
    alone = tracks[0].values(end)[0] + tracks[1].values(end)[0]
    assert alone.std() > 5.0 * sums.std()


def test_without_correlation_each_track_is_as_it_was() -> None:
    rng = np.random.default_rng(2)
    values = np.stack([value(AT, truth) for truth in PAIR], axis=1) + 0.5 * rng.standard_normal((AT.size, 2))
    tracks = own(values, rng)
    scatter = [float(each.weight @ each.scatter**2) for each in tracks]
    together = draw_jointly(
        AT, values, np.repeat(np.diag(0.25 + np.array(scatter))[None], AT.size, axis=0), tracks, 1000, rng
    )
    for track, each in zip(tracks, together, strict=True):
        mean, sd = track.moments(track.values(AT[-1:])[0])
        found = each.values(AT[-1:])[0]
        assert found.mean() == pytest.approx(mean, abs=0.35 * sd)
        assert found.std() == pytest.approx(sd, rel=0.35)
