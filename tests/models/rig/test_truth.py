"""The simulated clutch against its equations written out by hand, and against what the reference says of the real one."""

import itertools
import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from models.clutch import Geometry
from models.friction.speed_protocol import RPM
from models.friction.stribeck import torque
from models.records.runs import curves_by_pressure
from models.rig.campaign import simulated_clutch
from models.rig.stationary import stationary_test
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch, draw, surface
from tests.models.rig.exact import NOISELESS

SPEEDS = np.arange(20, 1971, 50) * RPM
BAR = 1e5
CLUTCH = SimulatedClutch()


def curves(clutch, cycles):
    """Noiseless torque [40] at each pressure in bar, through the simulated test itself."""
    plateaus = stationary_test(clutch, cycles, np.random.default_rng(0), NOISELESS)
    return {c.pressure / BAR: c.torque for c in curves_by_pressure(plateaus, clutch.geometry)}


def by_hand(clutch, pressure, cycles, velocity):
    """Eq. 3 and eq. 6 written out again with `math`, in another order of operations."""

    def aged(course):
        return 1 + course.change - course.change / (1 + cycles / course.scale) ** course.exponent

    m_s = (clutch.static_torque.intercept + clutch.static_torque.slope * pressure) * aged(clutch.static_torque_course)
    law = clutch.coulomb_ratio
    fresh_ratio = law.asymptote + law.excess / math.exp(pressure / law.decay)
    m_c = m_s * fresh_ratio * aged(clutch.coulomb_ratio_course)
    law, course = clutch.stribeck_velocity, clutch.stribeck_velocity_course
    share = math.exp(-(law.intercept + law.slope * pressure) * aged(course) / velocity)
    law, course = clutch.viscous_coefficient, clutch.viscous_coefficient_course
    viscous = (law.intercept + law.slope * pressure) * aged(course) * velocity**0.3
    return m_s * (1 - share) + m_c * share + viscous


@pytest.mark.parametrize("cycles", [0, 500, 15_000, 900_000])
def test_torque_agrees_with_the_equations_written_out_by_hand(cycles):
    measured = curves(CLUTCH, cycles)
    for pressure, speed in itertools.product((4.0, 5.5, 7.0), (0, 7, 39)):
        velocity = SPEEDS[speed] * 0.058
        assert measured[pressure][speed] == pytest.approx(by_hand(CLUTCH, pressure * BAR, cycles, velocity), rel=1e-9)


def test_mean_cof_is_the_mean_over_all_plateaus():
    # Pressure levels hold equally many rows, so the mean over rows is the mean over pressures of the means over speeds.
    places = itertools.product(PROTOCOL_PRESSURES, SPEEDS)
    rows = [by_hand(CLUTCH, p, 7000, w * Geometry().mean_radius) / Geometry().torque_per_cof(p) for p, w in places]
    assert CLUTCH.mean_cof(7000) == pytest.approx(math.fsum(rows) / 280, rel=1e-9)


def test_a_fresh_clutch_gives_about_25_newton_metres_at_5_bar_and_ends_where_its_mean_cof_crosses() -> None:
    at_1000_rpm = np.interp(1000 * RPM, SPEEDS, curves(CLUTCH, 0)[5.0])
    assert at_1000_rpm == pytest.approx(25, abs=1)
    assert CLUTCH.end_of_life() == pytest.approx(15_000, rel=0.02)
    # the end of life is where mean cof crosses on a dense grid
    cycles = np.arange(0.0, 40_000.0, 10.0)
    share = CLUTCH.mean_cofs(cycles) / CLUTCH.mean_cof(0)
    for fraction in (0.9, 0.5, 0.45):
        crossing = cycles[np.argmax(share <= fraction)]
        assert crossing - 10 <= CLUTCH.end_of_life(fraction) <= crossing
    # no life ends where the loss saturates above the threshold
    assert CLUTCH.mean_cof(1e6) > 0.2 * CLUTCH.mean_cof(0)
    assert CLUTCH.end_of_life(0.2) is None


def test_drawn_clutches_differ_by_5_to_15_percent_and_live_about_as_long_as_the_nominal_one() -> None:
    drawn = [draw(np.random.default_rng(seed)).parameters(5 * BAR, 0) for seed in range(200)]
    for name in ("static_torque", "coulomb_ratio", "stribeck_velocity", "viscous_coefficient"):
        values = np.array([float(getattr(parameters, name)) for parameters in drawn])
        assert 0.03 < values.std() / values.mean() < 0.16, name  # 200 draws know a deviation to 5 %
        assert (values > 0).all()
    # in none of them sliding grips more than rest
    assert all(draw(np.random.default_rng(seed)).parameters(4 * BAR, 0).coulomb_ratio < 1 for seed in range(200))
    # lives of drawn clutches spread around the nominal one
    lives = [draw(np.random.default_rng(seed)).end_of_life() for seed in range(50)]
    assert None not in lives
    assert min(lives) > 8_000
    assert max(lives) < 32_000
    assert np.median(lives) == pytest.approx(15_000, rel=0.1)
    assert 0.12 < np.std(np.log(lives)) < 0.35


def test_the_clutch_transfers_what_its_curve_says_and_less_below_its_lowest_pressure() -> None:
    capacity = CLUTCH.capacity(2000.0)
    at = float(torque(np.array(3.0), CLUTCH.parameters(6e5, 2000.0)))
    lowest = float(torque(np.array(3.0), CLUTCH.parameters(4e5, 2000.0)))
    assert capacity(6e5, 3.0) == pytest.approx(at)
    assert capacity(1e5, 3.0) == pytest.approx(lowest / 4)


# --- The simulated lining wears as figs. 4 and 5 of the reference show: smooth and flat at the end.

CLUTCHES = (SimulatedClutch(), simulated_clutch(1))


@pytest.mark.parametrize("clutch", CLUTCHES, ids=["nominal", "drawn"])
def test_the_lining_gets_smoother_and_flatter_from_the_references_figures_to_those_after_the_tests(
    clutch: SimulatedClutch,
) -> None:
    end = clutch.end_of_life()
    fresh, worn = surface(clutch, 0.0), surface(clutch, 2 * end)
    assert (fresh.roughness, fresh.skewness) == pytest.approx((9.52e-6, -0.87))
    assert (worn.roughness, worn.skewness) == pytest.approx((1.94e-6, -3.4))
    halved = surface(clutch, end)
    assert (halved.roughness, halved.skewness) == pytest.approx((1.94e-6, -3.4), rel=1e-6)
    # the lining gets smoother and flatter all its life
    surfaces = [surface(clutch, float(cycles)) for cycles in np.linspace(0.0, 0.99 * end, 20)]
    assert (np.diff([state.roughness for state in surfaces]) < 0).all()
    assert (np.diff([state.skewness for state in surfaces]) < 0).all()


@pytest.mark.parametrize(
    ("asked", "rule"),
    [
        *(
            (partial(CLUTCH.end_of_life, share), "fraction must lie between 0 and 1")
            for share in (0.0, 1.0, -1.0, math.nan)
        ),
        (partial(CLUTCH.parameters, 0, 0), "pressure must be finite"),
        (partial(CLUTCH.parameters, 5e5, -1), "cycles must be finite"),
        (partial(CLUTCH.parameters, 5e5, math.nan), "cycles must be finite"),
        (partial(surface, CLUTCH, -1.0), "not negative"),
    ],
)
def test_what_no_clutch_has_is_refused(asked: Callable[[], object], rule: str) -> None:
    with pytest.raises(ValueError, match=rule):
        asked()
