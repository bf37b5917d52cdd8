"""Mean torque of measured points: on the protocol it is the mean of the points, and a law's factor goes with it."""

import numpy as np
import pytest

from models.friction.measured_curve import MeasuredCurve
from tests.models.friction.stribeck_curves import VELOCITY

RISING = 2.0 + 3.0 * VELOCITY / VELOCITY[-1]


def test_on_the_protocol_it_is_the_mean_of_the_points_with_the_noise_of_a_mean() -> None:
    mean, sd = MeasuredCurve.of(VELOCITY, RISING, 0.2).mean(VELOCITY)
    assert mean == pytest.approx(RISING.mean())
    assert sd == pytest.approx(0.2 / np.sqrt(VELOCITY.size))
    # in both directions, in any order and with each point twice
    both, torque = np.concatenate([VELOCITY, -VELOCITY]), np.concatenate([RISING, -RISING])
    shuffled = np.random.default_rng(0).permutation(both.size)
    twice = MeasuredCurve.of(both[shuffled], torque[shuffled], 0.2).mean(VELOCITY)
    assert twice == pytest.approx((mean, sd / np.sqrt(2)))


def test_its_deviation_is_that_of_the_mean_over_repeated_measurements() -> None:
    rng = np.random.default_rng(1)
    at = VELOCITY[::3]
    grid = VELOCITY[: VELOCITY.searchsorted(at[-1], side="right")]
    torque = np.interp(at, VELOCITY, RISING)
    means = [MeasuredCurve.of(at, torque + rng.normal(0, 0.2, at.size), 0.2).mean(grid)[0] for _ in range(2000)]
    sd = MeasuredCurve.of(at, torque, 0.2).mean(grid)[1]
    assert np.std(means) == pytest.approx(sd, rel=0.06)  # four deviations of a deviation of 2,000


def test_where_nothing_was_measured_the_range_of_the_points_is_uncertain() -> None:
    half = MeasuredCurve.of(VELOCITY[:20], RISING[:20], 0.01)
    mean, sd = half.mean(VELOCITY)
    assert abs(mean - RISING.mean()) < 2 * sd
    assert half.mean(VELOCITY[:20])[1] < 0.01 < sd


def test_a_factor_multiplies_what_was_measured_at_its_speed() -> None:
    factor = 1.0 + 0.1 * np.sin(VELOCITY)
    mean, _ = MeasuredCurve.of(VELOCITY, RISING / factor, 0.01).mean(VELOCITY, factor)
    assert mean == pytest.approx(RISING.mean())


def test_many_rows_are_a_few_points_and_come_back_from_their_columns() -> None:
    velocity = np.linspace(0.1, 10.0, 30_000)
    curve = MeasuredCurve.of(velocity, 2.0 * velocity, 0.1)
    assert curve.velocity.size == 200
    assert curve.count.sum() == velocity.size
    again = MeasuredCurve.of_columns(curve.columns(), 0.1)
    assert again.mean(VELOCITY) == curve.mean(VELOCITY)
