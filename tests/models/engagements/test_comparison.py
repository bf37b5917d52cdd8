"""The three indicators of the sliding speed: nothing for the same engagement, known values for a longer one."""

import math

import numpy as np
import pytest

from models.clutch import Geometry
from models.engagements.comparison import SpeedCourse, compared, reference_of, same_duty
from models.engagements.local_fit import Estimate
from models.engagements.measured import MeasuredEngagement, measured_engagement
from tests.models.engagements.closed_forms import constant, record


def straight(duration: float, points: int = 65) -> SpeedCourse:
    """A speed that falls evenly from 100 rad/s."""
    return SpeedCourse(
        duration=Estimate(value=duration, sd=0.0), speed=100.0 * np.linspace(1.0, 0.0, points), noise=0.0
    )


def test_the_same_engagement_is_no_distance_away() -> None:
    found = compared(straight(1.0), reference_of([straight(1.0), straight(1.0)]))
    assert found.normalised_duration.value == pytest.approx(1.0)
    assert found.euclidean_distance.value == pytest.approx(0.0, abs=1e-9)
    assert found.spectral_angle.value == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("longer", [1.2, 2.0])
def test_a_longer_engagement_is_as_far_away_as_integrals_say(longer: float) -> None:
    """x = 1 - t/λ against r = 1 - t over t in 0 to 1: ∫(x-r)² = (1-1/λ)²/3, ∫r² = 1/3, ∫x² = 1 - 1/λ + 1/3λ²; sums over 50
    moments are within 3 % of that."""
    found = compared(straight(longer), reference_of([straight(1.0)]))
    square = 1 - 1 / longer + 1 / (3 * longer**2)
    product = 1 / 2 - 1 / (6 * longer)
    assert found.normalised_duration.value == pytest.approx(longer)
    assert found.euclidean_distance.value == pytest.approx(1 - 1 / longer, rel=0.03)
    assert found.spectral_angle.value == pytest.approx(math.acos(product / math.sqrt(square / 3)), rel=0.05)


def test_wear_shows_in_noisy_records_beyond_its_standard_error() -> None:
    def course(cof: float, seed: int) -> SpeedCourse:
        found = measured_engagement(record(constant(cof), 100.0, seed), Geometry())
        assert isinstance(found, MeasuredEngagement)
        return found.course

    reference = reference_of([course(0.12, seed) for seed in range(3)])
    same, worn = compared(course(0.12, 3), reference), compared(course(0.10, 4), reference)
    assert abs(same.normalised_duration.value - 1) < 4 * same.normalised_duration.sd
    assert worn.normalised_duration.value == pytest.approx(1.2, rel=0.01)
    for name in ("euclidean_distance", "spectral_angle"):
        estimate, noise = getattr(worn, name), getattr(same, name)
        assert estimate.value > 8 * estimate.sd
        assert noise.value < 3 * noise.sd


def test_a_reference_needs_an_engagement_and_duties_differ_by_more_than_a_tenth() -> None:
    with pytest.raises(ValueError, match="at least one"):
        reference_of([])
    assert same_duty(2100, 2000)
    assert not same_duty(1200, 2000)
