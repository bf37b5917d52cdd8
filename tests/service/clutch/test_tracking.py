"""What a filter is given to work with, what its draws depend on, and what is said of a quantity that is tracked."""

from dataclasses import replace

import numpy as np
import pytest
from fastapi.testclient import TestClient

from models.loops.lag_fit import StationaryCurve
from models.prognosis.ended_lives import ObservedLife
from models.prognosis.fleet import FleetPrior
from models.rig.truth import draw
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from service.api.life import ModelName
from service.clutch.assumptions import (
    ALL_PRESSURES,
    FLEET,
    MEAN_COF,
    WEAK,
    Assumptions,
    LearnedPrior,
    ModelInForce,
    Scale,
)
from service.clutch.criteria import PREDICTION_DRAWS
from service.clutch.quantities.items import track_item
from service.clutch.quantities.measured import QUANTITIES, parameter_tracks, posterior_of, pressure_level
from service.clutch.timeline import Event, Life, Series, lives_of
from service.clutch.tracking import METHODS, PREDICTED, advance, drawn, end_of_life, predict
from tests.lab.plausibility.bench import Bench
from tests.lab.score.paper import PLACE, measured_life
from tests.models.prognosis.test_course_shares import accelerating
from tests.models.tracking.tracked_series import CAMPAIGN
from tests.service.clients import as_answered, post_run
from tests.support import stationary

LIFE = "/v1/clutches/{}/remaining-useful-life"

FLEET_PRIOR = FleetPrior(clutches=10, mean=np.array([-0.75, 8.5, -0.36, -5.8]), scale=0.05 * np.eye(4), freedom=10.0)


@pytest.mark.parametrize("method", PREDICTED)
def test_two_priors_share_particles_and_draws(method: str) -> None:
    bench = Bench({})
    for cycles in (0, 1000, 2000):
        bench.accept(stationary(cycles, run_id=f"s{cycles}"))
    life = lives_of(bench.events)[-1]
    sizes = {}
    for name, assumptions in (("alone", Assumptions()), ("taught", Assumptions(prior=LearnedPrior(fleet=FLEET_PRIOR)))):
        series = life.pooled(assumptions)
        tracked = advance(method, series, None, 3)
        assert tracked.states.keys() == ({WEAK} if name == "alone" else {WEAK, FLEET})
        assert drawn(method, series, tracked).weight.size == PREDICTION_DRAWS
        sizes[name] = {key: state.particles.cloud.log_weight.size for key, state in tracked.states.items()}
    assert sizes["taught"] == dict.fromkeys((WEAK, FLEET), sizes["alone"][WEAK] // 2)


# --- A life under an adopted model is tracked under each of its draws, and what is predicted is their mixture.

CYCLES = np.array([0.0, 1500.0, 3000.0, 4500.0, 6000.0, 7500.0, 9000.0])
LEVELS = (4e5, 6e5)
#: What each draw takes off mean COF in the end, growing from nothing, and the draws' weights.
TAKEN, WEIGHTS = (0.0, 0.012), (0.25, 0.75)


def life(*taken: float) -> Life:
    events = []
    for index, cycles in enumerate(CYCLES.tolist()):
        mean = 0.13 * (1 - 0.5 * (1 - (1 + cycles / 6000.0) ** -0.8)) * (1 + 0.001 * (-1) ** index)
        under = {p: tuple(mean - off * cycles / CYCLES[-1] for off in taken) for p in LEVELS}
        means = {p: (float(np.dot(WEIGHTS, draws)) if len(draws) > 1 else draws[0], 2e-4) for p, draws in under.items()}
        stated = {"run_id": str(index), "cycles": cycles, "moment": float(index), "speed_range": (2.0, 200.0)}
        under = under if len(taken) > 1 else {}
        events.append(Event(kind="stationary_stribeck", cofs=means, under=under, **stated))
    return Life(origin=0.0, events=tuple(events))


def assumptions(*weights: float) -> Assumptions:
    return Assumptions(model=ModelInForce(name=ModelName(name="extended", effects=[]), weights=weights))


def ends(method: str, of: Life, under: Assumptions) -> tuple[np.ndarray, np.ndarray]:
    series = of.pooled(under)
    tracked = advance(method, series, None, len(series.measurements))
    sample = drawn(method, series, tracked)
    stated = end_of_life(sample, series, tracked, CYCLES[-1], 0.5, 1e6)
    return stated.ends, stated.weight


@pytest.mark.parametrize("method", METHODS)
def test_what_is_predicted_is_the_mixture_of_the_lives_under_each_draw(method: str) -> None:
    both, weight = ends(method, life(*TAKEN), assumptions(*WEIGHTS))
    assert weight.sum() == pytest.approx(1.0)
    each = [ends(method, life(off), assumptions(1.0)) for off in TAKEN]
    middles = [float(np.median(ends_[np.isfinite(ends_)])) for ends_, _ in each]
    assert middles[1] < 0.75 * middles[0]  # the control: the draws are of different lives
    for at in (12e3, 15e3, 20e3, 30e3, 60e3):
        alone = [float(own_weight[own <= at].sum()) for own, own_weight in each]
        assert weight[both <= at].sum() == pytest.approx(np.dot(WEIGHTS, alone), abs=0.07)


@pytest.mark.parametrize("method", ["particle", "ukf"])
def test_a_filter_that_is_carried_on_says_what_one_that_starts_again_says(method: str) -> None:
    of, under = life(*TAKEN), assumptions(*WEIGHTS)
    series = of.pooled(under)
    carried = None
    for runs in range(1, len(CYCLES) + 1):
        carried = advance(method, series, carried, runs)
    again = advance(method, series, None, len(CYCLES))
    assert set(carried.states) == {"weak@0", "weak@1"}
    said = [predict(method, series, states, CYCLES[-1], 0.5, tests=of.tests) for states in (carried, again)]
    assert said[0] == said[1]


def test_draws_that_differ_nowhere_are_tracked_once() -> None:
    """A delay in loops corrects no mean COF: twelve tracks of it would be one."""
    series = life(0.0).pooled(assumptions(*WEIGHTS))
    assert series.draws == ()
    assert all(isinstance(measurement, Measurement) for measurement in series.measurements)


def test_a_test_is_odd_only_where_it_is_under_every_draw() -> None:
    of, under = life(*TAKEN), assumptions(*WEIGHTS)
    last = of.events[-1]
    jumped = replace(last, under={p: (draws[0], 1.6 * draws[1]) for p, draws in last.under.items()})
    odd_under_one = replace(of, events=(*of.events[:-1], jumped))
    both = replace(of, events=(*of.events[:-1], replace(last, under=dict.fromkeys(LEVELS, (0.25, 0.24)))))
    warned = []
    for one in (of, odd_under_one, both):
        series = one.pooled(under)
        tracked = advance("particle", series, None, len(CYCLES))
        said = as_answered(predict("particle", series, tracked, CYCLES[-1], 0.5, tests=of.tests))
        warned.append("off_track" in {warning["code"] for warning in said["warnings"]})
    assert warned == [False, False, True]


def test_a_clutch_whose_counter_began_elsewhere_is_predicted_and_told_where(client: TestClient) -> None:
    for share in range(8):
        post_run(client, stationary(50_000.0 + 1_000.0 * share, wear=0.08 * share))
    before = client.get(LIFE.format("c1")).json()
    said = {warning["code"]: warning["message"] for warning in before["warnings"]}
    assert "the event rebuild at 50,000 cycles" in said["new_extrapolated"]
    post_run(client, {"kind": "maintenance", "cycles": 50_000.0, "event": "rebuild"})
    answer = client.get(LIFE.format("c1")).json()
    assert "new_extrapolated" not in {warning["code"] for warning in answer["warnings"]}
    assert before["status"] == answer["status"] == "predicted"
    assert before["at_least"] == pytest.approx(answer["at_least"], rel=0.3)


def test_a_prediction_says_how_many_lives_it_draws_on_and_that_its_forecasts_missed() -> None:
    """Two lives that ended as this one goes; of ten later tests two lay within the intervals that were forecast."""
    of, course = life(0.0), np.array([0.0, 6e3, 20e3])
    damage = (1 - (1 + course / 6000.0) ** -0.8) / (1 - (1 + 20e3 / 6000.0) ** -0.8)
    ended = [ObservedLife(end=end, fraction=0.5, progress=tuple(course), damage=tuple(damage)) for end in (21e3, 22e3)]
    said = []
    for lives, misses in (((), [0.5] * 10), (tuple(ended), [0.5] * 2 + [2.0] * 8)):
        under = replace(assumptions(1.0), prior=LearnedPrior(ended=lives))
        series = of.pooled(under)
        tracked = advance("particle", series, None, len(CYCLES))
        tracked = replace(tracked, back_cast=replace(tracked.back_cast, misses=np.array(misses)))
        said.append(as_answered(predict("particle", series, tracked, CYCLES[-1], 0.5, tests=of.tests)))
    assert [answer["ended_lives"] for answer in said] == [0, 2]
    warned = [[w["message"] for w in answer["warnings"] if w["code"] == "missed_forecasts"] for answer in said]
    assert warned[0] == []
    assert "only 2 of 10 later tests" in warned[1][0]


# --- What follows from the fits of a life is weighed by their unbiased covariance; coefficients are those of eq. 6.


def test_a_level_and_the_curve_of_a_loop_have_the_unbiased_covariance() -> None:
    rng = np.random.default_rng(5)
    measured = measured_life(draw(rng), [0.0, 2_000.0, 4_000.0, 6_000.0], rng)
    pressure, cof = list(measured.mean_cofs().items())[PLACE]
    tracks = parameter_tracks(measured.life, measured.assumptions, measured.tests, pressures={pressure})
    direct = cof, posterior_of(cof)
    level = pressure_level(measured, tracks, direct, pressure)
    fits = [levels[PLACE].fit for levels in measured.tests]
    np.testing.assert_array_equal(level.covariance, [fit.unbiased_covariance for fit in fits])
    for fit in fits:
        np.testing.assert_array_equal(StationaryCurve.of(fit).covariance, fit.unbiased_covariance)
        assert (fit.unbiased_covariance.diagonal() < fit.covariance.diagonal()).all()


@pytest.mark.parametrize(("follows", "measurements"), [(True, CAMPAIGN), (False, accelerating(0.8))])
def test_coefficients_are_those_of_eq_6_and_say_how_probable_it_is(follows: bool, measurements: list) -> None:
    """Means over courses of other signs of φ and ε would be of nothing."""
    posterior = Grid().posterior(
        Grid().from_history(weak(measurements[0], falling=True), measurements), 1_000, np.random.default_rng(1)
    )
    series = Series(
        quantity=MEAN_COF,
        pressure=ALL_PRESSURES,
        measurements=tuple(measurements),
        events=tuple(range(len(measurements))),
        scale=Scale(origin=0.0),
        assumptions=Assumptions(),
    )
    item = as_answered(track_item(QUANTITIES[MEAN_COF], series, posterior))
    assert (item["eq6_probability"] > 0.5) is follows
    if item["coefficients"] is None:
        assert item["eq6_probability"] == 0.0
    else:
        size = measurements[0].value
        assert 0.0 < item["coefficients"]["initial"]["value"] < 2.0 * size
        assert -2.0 * size < item["coefficients"]["change"]["value"] < 0.0
        assert item["coefficients"]["scale_cycles"]["value"] > 0.0
        assert 0.0 < item["coefficients"]["exponent"]["value"] < 20.0
