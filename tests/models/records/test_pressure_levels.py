"""Levels of pressure among nominal and among scattered pressures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.records.criteria import LEVEL_GAP
from models.records.pressure_levels import level_width, levels_of

NOMINAL = np.repeat(np.arange(4.0, 7.01, 0.5) * 1e5, 40)


@pytest.mark.parametrize(("pressure", "width"), [(0.0, LEVEL_GAP), (4e5, LEVEL_GAP), (8e5, 0.2e5)])
def test_a_level_is_as_wide_as_the_gap_or_its_share_of_the_pressure(pressure, width):
    assert level_width(pressure) == pytest.approx(width)


def test_nominal_pressures_are_their_own_levels():
    np.testing.assert_array_equal(levels_of(NOMINAL), NOMINAL)


def test_scattered_pressures_find_their_level():
    """0.02 bar of scatter about steps of 0.5 bar."""
    measured = NOMINAL + np.random.default_rng(1).normal(0.0, 0.02e5, NOMINAL.size)
    np.testing.assert_allclose(levels_of(measured), NOMINAL)


def test_levels_that_are_close_but_repeated_stay_apart():
    """Nominal values of 5.00 and 5.05 bar in three rows each are two levels."""
    pressure = np.repeat([5.00e5, 5.05e5], 3)
    assert np.unique(levels_of(pressure)).tolist() == [5.00e5, 5.05e5]


def test_a_level_far_from_a_step_keeps_its_own_name():
    assert levels_of(np.array([4.975e5, 4.976e5, 4.977e5])).tolist() == [497600.0] * 3


def test_one_row_is_one_level():
    assert levels_of(np.array([5.01e5])).tolist() == [5e5]


@given(st.permutations(range(28)))
def test_the_order_of_rows_does_not_matter(order):
    measured = np.repeat(np.arange(4.0, 7.01, 0.5) * 1e5, 4)
    measured = measured + np.random.default_rng(2).normal(0.0, 0.02e5, measured.size)
    np.testing.assert_array_equal(levels_of(measured[order]), levels_of(measured)[order])
