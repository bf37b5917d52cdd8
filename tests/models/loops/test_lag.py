"""The two laws of lag against stiff integrators and their limits."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from models.friction.criteria import Z90
from models.friction.stribeck import StribeckParameters
from models.loops import lag_fit
from models.loops.lag_fit import ATTRACTOR, SQUEEZE_FILM, LagFit, LagStatus, Law, StationaryCurve, fit_lag
from models.loops.lag_laws import attractor_torque, film_speed, squeeze_film_torque
from models.loops.loop_area import Direction, clean_samples
from models.loops.loops import evaluate_loops
from models.records.periods import fit_cycle
from tests.models.loops.dynamic_records import (
    FALLING,
    FINE,
    GEOMETRY,
    PERIOD,
    RISING,
    SWING,
    Torque,
    attractor,
    attractor_area,
    curve,
    dense_area,
    record,
    squeezed,
    velocity,
)

# --- The attractor law against a stiff integrator and closed forms, and the area of its loop to first order.

AMPLITUDE = GEOMETRY.mean_radius * SWING


@pytest.mark.parametrize("parameters", [FALLING, RISING])
@pytest.mark.parametrize("c", [50.0, 500.0])
def test_attractor_against_a_stiff_integrator(parameters, c):
    # second order in a step of 1 ms, and a cusp at standstill: 3e-4 Nm of 25 at worst
    found = attractor_torque(FINE, velocity(FINE), parameters, c)
    assert np.abs(found - attractor(parameters, c)(FINE)).max() < 1e-3
    many = attractor_torque(FINE, velocity(FINE), parameters, np.array([[c], [2 * c]]))
    assert np.array_equal(many[0], found)


def test_attractor_limits():
    v = velocity(FINE)
    stiff = attractor_torque(FINE, v, FALLING, 1e9)
    assert np.abs(stiff - curve(v, FALLING))[v > 1e-6].max() < 1e-4
    constant = StribeckParameters(static_torque=20.0, coulomb_ratio=1.0, stribeck_velocity=1.0, viscous_coefficient=0.0)
    time = np.array([0.0, 0.1, 0.5, 3.0])
    relaxed = attractor_torque(time, np.ones(4), constant, 40.0, start=10.0)
    assert relaxed == pytest.approx(20 - 10 * np.exp(-2 * time), rel=1e-13)
    # through zero it runs to the other side's curve
    turned = attractor_torque(time, -np.ones(4), constant, 40.0, start=20.0)
    assert turned == pytest.approx(-20 + 40 * np.exp(-2 * time), rel=1e-13)
    with pytest.raises(ValueError, match="attractor must be positive"):
        attractor_torque(time, np.ones(4), constant, 0.0)
    with pytest.raises(ValueError, match="time must not fall"):
        attractor_torque(time[::-1], np.ones(4), constant, 40.0)


@pytest.mark.parametrize(("parameters", "sign"), [(FALLING, 1), (RISING, -1)])
def test_attractor_area_to_first_order(parameters, sign):
    """-(1/C) ∮ S S' v̇² dt: what is left falls as 1/C² at least, and rising curves give negative loops."""
    t = np.linspace(0.0, 10.0, 100_001)[:-1] + 5e-5
    a = AMPLITUDE * 0.2 * math.pi * np.cos(0.2 * math.pi * t)
    left = []
    for c in (400.0, 1600.0):
        first = attractor_area(velocity(t), a, 10.0, parameters, c)
        full = dense_area(attractor_torque(FINE, velocity(FINE), parameters, c))
        assert np.sign(first) == np.sign(full) == sign
        left.append(abs(full / first - 1))
    assert left[0] < 0.01
    assert left[1] < 0.5 * left[0]


# --- The squeezed film against a stiff integrator of eq. 7 and its limits.


@pytest.mark.parametrize("parameters", [FALLING, RISING])
@pytest.mark.parametrize("film_time", [0.01, 0.1, 1.0])
def test_film_against_a_stiff_integrator_of_eq_7(parameters, film_time):
    # the witness integrates the balance of loads with eq. 7 in the film's thickness, not in w or z
    found = squeeze_film_torque(FINE, velocity(FINE), parameters, film_time)
    assert np.abs(found - squeezed(parameters, film_time)(FINE))[PERIOD].max() < 1e-3


def test_film_limits():
    v = velocity(FINE)
    assert np.abs(film_speed(FINE, v, 1e-7) - v)[v > 0.1].max() < 1e-3
    slow = film_speed(FINE, v, 1e4)
    assert np.ptp(slow) < 0.02 * slow.mean()
    with pytest.raises(ValueError, match="film_time must be positive"):
        film_speed(FINE, v, -1.0)


@pytest.mark.parametrize("parameters", [FALLING, RISING])
@pytest.mark.parametrize("film_time", [0.01, 0.1])
def test_film_is_higher_accelerating_whatever_the_slope(parameters, film_time):
    v = velocity(FINE)
    found = squeeze_film_torque(FINE, v, parameters, film_time)
    assert dense_area(found) > 0
    assert dense_area(squeeze_film_torque(FINE, v, parameters, 10 * film_time)) > 0
    # away from the turning points, where the film still remembers the other direction
    rising = np.cos(0.2 * math.pi * FINE) > 0.3
    falling = np.cos(0.2 * math.pi * FINE) < -0.3
    off = found - curve(v, parameters)
    assert off[PERIOD][rising[PERIOD]].min() > 0
    assert off[PERIOD][falling[PERIOD]].max() < 0
    # the control: contact alone, S at the film's speed without the shear of the thinner film, is wrong where S rises
    contact_only = curve(film_speed(FINE, v, film_time), RISING)
    assert dense_area(contact_only) < 0


# --- The fits of both laws of lag on records made by either.


def evaluated(torque: Torque, parameters: StribeckParameters, **how):
    (loop,) = evaluate_loops(record([torque], [5e5], **how), GEOMETRY, {5e5: StationaryCurve(parameters=parameters)})
    return loop


@pytest.mark.parametrize("parameters", [FALLING, RISING])
@pytest.mark.parametrize("c", [50.0, 160.0, 500.0])
def test_attractor_of_a_record_without_noise(parameters, c):
    # the fit's own grid has 1000 steps a period: 2e-4
    loop = evaluated(attractor(parameters, c), parameters)
    assert loop.attractor == pytest.approx(c, rel=5e-4)
    assert loop.status is LagStatus.DETERMINED
    assert loop.direction is (Direction.HIGHER_ACCELERATING if parameters is FALLING else Direction.HIGHER_DECELERATING)


@pytest.mark.parametrize("frequency", [0.05, 0.5, 2.0])
def test_attractor_at_other_frequencies(frequency):
    made, duration = attractor(FALLING, 120.0, frequency), max(1.5 / frequency, 4.0)
    loop = evaluated(made, FALLING, frequency=frequency, duration=duration, rate=200.0)
    assert loop.frequency == pytest.approx(frequency, rel=1e-9)
    assert loop.attractor == pytest.approx(120.0, rel=2e-3)


@pytest.mark.parametrize("parameters", [FALLING, RISING])
@pytest.mark.parametrize("film_time", [0.02, 0.2])
def test_film_time_of_a_record_without_noise(parameters, film_time):
    loop = evaluated(squeezed(parameters, film_time), parameters)
    assert loop.film_time == pytest.approx(film_time, rel=1e-3)
    assert loop.better_law == "squeeze film"
    assert loop.direction is Direction.HIGHER_ACCELERATING


@pytest.mark.parametrize(("parameters", "name"), [(FALLING, "attractor"), (RISING, "squeeze film")])
def test_the_law_that_made_the_record_is_reported(parameters, name):
    rng = np.random.default_rng(4)
    torque = attractor(parameters, 60.0) if name == "attractor" else squeezed(parameters, 0.2)
    loop = evaluated(torque, parameters, noise=0.01, rng=rng, lost=0.01, jitter=0.3, spikes=1)
    assert loop.better_law == name
    assert f"The {name} law describes the loop better." in loop.message


def test_what_leaves_the_attractor_open_and_what_does_not_reach_it() -> None:
    # a lag that the attractor cannot give
    loop = evaluated(squeezed(RISING, 0.2), RISING, noise=0.01, rng=np.random.default_rng(6))
    assert loop.status is LagStatus.AGAINST_THE_LAW
    assert (loop.attractor, loop.attractor_sd) == (None, None)
    assert abs(loop.film_time - 0.2) < 4 * loop.film_time_sd
    # a loop within its noise leaves the attractor open
    loop = evaluated(attractor(FALLING, 20_000.0), FALLING, noise=0.01, rng=np.random.default_rng(0))
    assert loop.status is LagStatus.UNRESOLVED
    assert loop.attractor is None
    # A record at 3 % more torque and 0.4 Nm of zero: scaled torque lags at C, its curve's C is that over the gain.
    scaled = StribeckParameters.from_array(FALLING.as_array() * [1.03, 1.0, 1.0, 1.03])
    made = attractor(scaled, 150.0)
    loop = evaluated(lambda t: made(t) + 0.4, FALLING)
    assert loop.attractor == pytest.approx(150.0, rel=2e-3)


#: 1.5 periods of 0.1 Hz at 100 Hz.
TIME = np.arange(1500) / 100
LAWS = [(ATTRACTOR, 1 / 150.0, attractor(FALLING, 150.0)), (SQUEEZE_FILM, 0.1, squeezed(FALLING, 0.1))]
BOTH = pytest.mark.parametrize(("law", "truth", "made"), LAWS, ids=["attractor", "squeeze film"])


def fitted(law: Law, torque: np.ndarray, behind: StationaryCurve) -> LagFit:
    cycle = fit_cycle(TIME, velocity(TIME))
    samples = clean_samples(cycle, TIME, torque)
    return fit_lag(law, cycle, samples.phase, samples.torque, behind)


def test_a_curve_wrong_in_shape_moves_the_attractor_little(monkeypatch):
    """The stationary curve at a Stribeck velocity 5 % off: what it has wrong is single-valued and taken out.

    Its slope stays wrong, by about as much as C then is: the lag is S S' v̇/C.
    """
    wrong = StationaryCurve(parameters=replace(FALLING, stribeck_velocity=1.05 * FALLING.stribeck_velocity))
    torque = attractor(FALLING, 150.0)(TIME)
    fit = fitted(ATTRACTOR, torque, wrong)
    assert fit.status is LagStatus.DETERMINED
    assert 1 / fit.lag == pytest.approx(150.0, rel=0.08)
    # the control: with gain and zero alone to absorb it, C goes half as far again astray
    monkeypatch.setattr(lag_fit, "absorbed_beside", partial(lag_fit.absorbed_beside, count=0))
    bare = fitted(ATTRACTOR, torque, wrong)
    assert abs(bare.lag * 150.0 - 1) > 1.3 * abs(fit.lag * 150.0 - 1)
    assert fit.log_likelihood > bare.log_likelihood


@pytest.mark.slow
@BOTH
def test_the_curve_s_error_is_the_lag_s(law, truth, made):  # noqa: ARG001
    """The delta method against fits with curves drawn from the covariance: 60 of them tell a deviation to 9 %."""
    rng, torque = np.random.default_rng(20), made(TIME)
    root = np.diag([0.2, 0.01, 0.1, 0.05]) @ np.array([[1, 0, 0, 0], [0.3, 1, 0, 0], [0, 0.5, 1, 0], [-0.5, 0, 0, 1.0]])

    told = fitted(law, torque, StationaryCurve(parameters=FALLING, covariance=root @ root.T))
    drawn = [StribeckParameters.from_array(FALLING.as_array() + root @ rng.standard_normal(4)) for _ in range(60)]
    lags = [fitted(law, torque, StationaryCurve(parameters=each)).lag for each in drawn]
    assert told.lag_sd == pytest.approx(float(np.std(lags)), rel=0.3)
    # the control: a curve that is taken for exact leaves next to nothing on a record without noise
    assert fitted(law, torque, StationaryCurve(parameters=FALLING)).lag_sd < 0.05 * told.lag_sd
    low, high = told.interval
    # without noise Fieller's interval is that of 1/u, even about it
    assert (1 / low + 1 / high) / 2 == pytest.approx(1 / told.lag, rel=1e-3)
    assert (1 / low - 1 / high) / 2 == pytest.approx(Z90 * told.lag_sd / told.lag**2, rel=0.02)


def test_a_curve_that_may_be_flat_leaves_the_lag_open_and_too_few_samples_are_refused() -> None:
    vague = StationaryCurve(parameters=FALLING, covariance=np.diag([1.0, 0.3, 1.0, 0.5]) ** 2)
    fit = fitted(ATTRACTOR, attractor(FALLING, 150.0)(TIME), vague)
    assert fit.status is LagStatus.UNRESOLVED
    assert 0 < fit.interval[0] < 1 / 150.0
    assert fit.interval[1] == math.inf
    with pytest.raises(ValueError, match="4 x 4 and finite"):
        StationaryCurve(parameters=FALLING, covariance=np.full((4, 4), np.nan))
    # too few sliding samples are refused
    with pytest.raises(ValueError, match="at least 20 samples must slide, got 3"):
        fit_lag(
            SQUEEZE_FILM, fit_cycle(TIME, velocity(TIME)), np.zeros(3), np.ones(3), StationaryCurve(parameters=FALLING)
        )


@BOTH
def test_a_curve_that_is_wrong_beyond_its_covariance_leaves_the_lag_wide(law: Law, truth: float, made: Torque) -> None:
    """M̄_c is 20 % off and stated to a millionth: what the curve has wrong stays in the residual, which makes the lag wide.

    A covariance that small is none. Were the residual rid of its directions all the same, the deviation would be 2 (C) and 5
    (film time) times that behind the right curve; it is 11 and 27 times as wide.
    """
    torque = made(TIME)
    torque = torque + 0.002 * torque.mean() * np.random.default_rng(13).standard_normal(torque.size)
    values = FALLING.as_array()
    wrong = StribeckParameters.from_array(values * [1.0, 0.8, 1.0, 1.0])

    def behind(parameters: StribeckParameters, share: float) -> LagFit:
        own = StationaryCurve(parameters=parameters, covariance=np.diag((share * values) ** 2))
        return fitted(law, torque, own)

    right, none, tiny, honest = behind(FALLING, 0.0), behind(wrong, 0.0), behind(wrong, 1e-6), behind(wrong, 0.2)
    assert tiny.lag_sd == pytest.approx(none.lag_sd, rel=0.01)
    assert tiny.lag_sd > 8 * right.lag_sd
    # the lag itself is further off than that: only a covariance as large as the error says so
    assert abs(honest.lag - truth) < 2 * honest.lag_sd
