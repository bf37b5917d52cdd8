"""Courses of either sign of φ and ε: the kinetics that they obey, their coordinates, and their prior probabilities."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from models.degradation.general_order import Degradation, first_passage, progress_fraction, value
from models.tracking.courses import (
    FORM_COURSE,
    FORM_PROPORTIONAL,
    FORM_SIZE,
    WITHOUT_EXPONENT,
    Course,
    basis,
    coefficients_at,
    coordinates_of,
    course_of,
    form_of,
    log_form_weight,
    log_scale_at,
    place_of,
    unit_of_change,
)
from models.tracking.prior import weak
from tests.models.tracking.tracked_series import CAMPAIGN, PRIOR

SIGNED = [(3_000.0, 0.7), (-9_000.0, -0.5), (-9_000.0, -2.0), (3_000.0, -2.0), (-9_000.0, 0.8)]


@pytest.mark.parametrize(("scale", "exponent"), SIGNED)
def test_each_course_is_kinetics_of_its_order(scale: float, exponent: float) -> None:
    """dD/dζ = -k Dⁿ, and with both signs turned dD/dζ = k Dⁿ, by differences over half a cycle."""
    zeta, step, sign = np.linspace(10.0, 8_000.0, 40), 0.25, np.sign(scale) * np.sign(exponent)

    def left(at: np.ndarray) -> np.ndarray:
        return 1.0 - sign * progress_fraction(at, scale, exponent)

    rate = (left(zeta + step) - left(zeta - step)) / (2.0 * step)
    expected = -sign * abs(exponent / scale) * left(zeta) ** (1.0 + 1.0 / exponent)
    np.testing.assert_allclose(rate, expected, rtol=1e-5)


@pytest.mark.parametrize(("scale", "exponent"), SIGNED)
def test_the_first_passage_is_where_the_course_has_that_value(scale: float, exponent: float) -> None:
    degradation = Degradation(initial=0.13, change=-0.1, scale=scale, exponent=exponent)
    for zeta in (1.0, 500.0, 8_500.0):
        assert first_passage(float(value(zeta, degradation)), degradation) == pytest.approx(zeta, rel=1e-9)
    assert first_passage(0.2, degradation) == math.inf


@pytest.mark.parametrize("course", list(Course))
def test_basis_is_the_share_of_the_change_and_coordinates_lead_back(course: Course) -> None:
    log_scale, log_exponent, kind = np.array([9.2]), np.array([-0.4]), np.array([course])
    scale, exponent = coefficients_at(log_scale, log_exponent, kind)
    zeta = np.array([[0.0], [100.0], [9_000.0]])
    expected = progress_fraction(zeta, scale, exponent)
    found = basis(zeta, log_scale, log_exponent, kind) * unit_of_change(kind)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert course_of(scale, exponent) == [course]
    back = coordinates_of(scale, exponent, kind)
    assert back[0] == pytest.approx(log_scale)
    assert back[1] == pytest.approx(0.0 if WITHOUT_EXPONENT[course] else log_exponent)


@pytest.mark.parametrize(
    ("course", "expected"),
    [(Course.EXPONENTIAL, lambda x: -np.expm1(-x)), (Course.LOGARITHM, np.log1p)],
    ids=["exponential", "logarithm"],
)
def test_courses_without_an_exponent_are_what_they_are_called(course: Course, expected: Any) -> None:
    zeta = np.linspace(0.0, 30_000.0, 50)
    found = basis(zeta[:, None], np.array([math.log(5_000.0)]), np.zeros(1), np.array([course]))
    np.testing.assert_allclose(found[:, 0], expected(zeta / 5_000.0), atol=1e-3)


def test_a_course_that_ends_does_so_beyond_what_was_measured() -> None:
    course, place = np.array([Course.EQ_6, Course.ENDING, Course.HYPERBOLIC]), np.full(3, math.log(100.0))
    log_scale, stretch = log_scale_at(place, course, 7_000.0)
    np.testing.assert_allclose(np.exp(log_scale), [100.0, 7_100.0, 7_100.0])
    np.testing.assert_allclose(place_of(log_scale, course, 7_000.0), place)
    near = log_scale_at(place + 1e-6, course, 7_000.0)[0]
    np.testing.assert_allclose(stretch, np.log((near - log_scale) / 1e-6), atol=1e-5)


def test_forms_are_courses_by_sizes_and_share_the_prior() -> None:
    weight = np.exp(log_form_weight(PRIOR))
    assert weight.sum() == pytest.approx(1.0)
    assert weight[FORM_COURSE == Course.EQ_6].sum() == pytest.approx(PRIOR.eq_6_share)
    np.testing.assert_array_equal(form_of(FORM_COURSE, FORM_SIZE, FORM_PROPORTIONAL), np.arange(FORM_SIZE.size))
    sure = log_form_weight(replace(PRIOR, eq_6_share=1.0))
    assert np.isneginf(sure[FORM_COURSE != Course.EQ_6]).all()


def test_what_may_rise_or_fall_is_tracked_by_eq_6_alone() -> None:
    """The Stribeck parameters, whose law the paper states."""
    assert weak(CAMPAIGN[0], falling=False).eq_6_share == 1.0
    assert weak(CAMPAIGN[0], falling=True).eq_6_share < 1.0
