"""A life under an adopted model is tracked under each of its draws, and what is predicted is their mixture."""

from dataclasses import replace

import numpy as np
import pytest

from models.tracking.measurement import Measurement
from service.lives.assumptions import Assumptions, ModelInForce
from service.lives.history import Event, Life
from service.lives.tracks import METHODS, advance, drawn, end_of_life, predict

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
        events.append(
            Event(
                run_id=str(index),
                kind="stationary_stribeck",
                cycles=cycles,
                moment=float(index),
                speed_range=(2.0, 200.0),
                cofs=means,
                under=under if len(taken) > 1 else {},
            )
        )
    return Life(origin=0.0, events=tuple(events))


def assumptions(*weights: float) -> Assumptions:
    return Assumptions(model=ModelInForce(name={"name": "extended", "effects": []}, weights=weights))


def ends(method: str, of: Life, under: Assumptions) -> tuple[np.ndarray, np.ndarray]:
    series = of.pooled(under)
    tracked = advance(method, series, under, None, len(series.measurements))
    sample = drawn(method, series, under, tracked)
    stated = end_of_life(sample, series, under, tracked, CYCLES[-1], 0.5, 1e6)
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
        carried = advance(method, series, under, carried, runs)
    again = advance(method, series, under, None, len(CYCLES))
    assert carried is not None
    assert set(carried.states) == {"weak@0", "weak@1"}
    said = [predict(method, series, under, states, CYCLES[-1], 0.5) for states in (carried, again)]
    assert said[0] == said[1]


def test_draws_that_differ_nowhere_are_tracked_once() -> None:
    """A delay in loops corrects no mean COF: twelve tracks of it would be one."""
    series = life(0.0).pooled(assumptions(*WEIGHTS))
    assert series.draws == ()
    assert all(isinstance(measurement, Measurement) for measurement in series.measurements)


def test_a_test_is_odd_only_where_it_is_under_every_draw() -> None:
    of, under = life(*TAKEN), assumptions(*WEIGHTS)
    last = of.events[-1]
    jumped = replace(
        last,
        under={p: (draws[0], 0.6 * draws[1]) for p, draws in last.under.items()},
    )
    odd_under_one = replace(of, events=(*of.events[:-1], jumped))
    both = replace(of, events=(*of.events[:-1], replace(last, under=dict.fromkeys(LEVELS, (0.05, 0.04)))))
    warned = []
    for one in (of, odd_under_one, both):
        series = one.pooled(under)
        tracked = advance("particle", series, under, None, len(CYCLES))
        said = predict("particle", series, under, tracked, CYCLES[-1], 0.5)
        warned.append("off_track" in {warning["code"] for warning in said["warnings"]})
    assert warned == [False, False, True]
