"""The unscented filters: domain, scatter, and starting anew."""

import math
from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from models.arrays import FloatArray
from models.degradation.general_order import Degradation, progress_fraction, value
from models.prognosis.first_passage import PassageStatus, predict_first_passage
from models.tracking.courses import FORM_COURSE, SCALE_SIGN
from models.tracking.filters.grid import Grid
from models.tracking.filters.ukf import DOMAIN, Ukf, UkfState, Way, measured, predicted, scatter_learnt, unscaled
from models.tracking.history import History
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.models.tracking.tracked_series import CAMPAIGN, PRIOR, WEIRD, followed, same


def test_the_ukf_stays_in_its_domain_and_definite() -> None:
    for measurements in WEIRD.values():
        state = followed(Ukf(), weak(measurements[0], falling=True), measurements)
        if len(measurements) < Ukf().together:
            assert state.form.size == 0
            continue
        assert np.abs(state.mean).max() <= 6.0
        np.testing.assert_array_equal(state.covariance, np.swapaxes(state.covariance, 1, 2))
        assert np.linalg.eigvalsh(state.covariance).min() > 0.0


def test_the_ukf_learns_the_scatter_from_its_innovations() -> None:
    """Innovations of a scatter three times as large as believed, beside fits as uncertain as that belief: after 600
    the scatter is known to 15 % (their number alone leaves 6 %)."""
    believed, truth, rng = 3e-4, 9e-4, np.random.default_rng(0)
    scatter, unit = np.array([believed**2, 2.0]), PRIOR.initial_sd
    for _ in range(600):
        variance = (scatter[0] + believed**2) / unit**2
        off = rng.normal(0.0, math.hypot(truth, believed)) / unit
        scatter = scatter_learnt(PRIOR, scatter, off**2 / variance, variance, 1.0)
    assert math.sqrt(scatter[0]) == pytest.approx(truth, rel=0.15)
    assert scatter[1] == 602.0


def test_no_innovation_teaches_the_ukf_more_than_five_deviations_do() -> None:
    start = np.array([9e-8, 20.0])
    learnt = [
        float(scatter_learnt(PRIOR, start, surprise, 1.1 * 9e-8 / PRIOR.initial_sd**2, 1.0)[0])
        for surprise in (9.0, 25.0, 1e4)
    ]
    assert learnt[1] == learnt[2] > learnt[0] > 9e-8
    assert scatter_learnt(PRIOR, start, 1e4, 1.0, 0.0)[0] == start[0]


def test_a_lost_ukf_starts_anew_from_the_whole_history() -> None:
    """After runs that the filter cannot explain (a life that all at once falls twice as fast) it is where the grid is."""
    progress = np.concatenate([np.linspace(0.0, 9e3, 10), np.linspace(9.3e3, 1.6e4, 20)])
    values = [0.13 - 2e-6 * z - 6e-6 * max(0.0, z - 9e3) for z in progress]
    bent = [
        Measurement(progress=float(z), value=float(y), variance=1e-8) for z, y in zip(progress, values, strict=True)
    ]
    assert followed(Ukf(), PRIOR, CAMPAIGN[:11]).reference == CAMPAIGN[7].progress
    assert followed(Ukf(), PRIOR, bent).reference > 1e4


def test_the_ukf_books_the_step_of_each_event_on_that_event() -> None:
    """A life whose level steps up by 0.02 at 12,000 cycles, and an event without effect at 29,000. Booked on the last event,
    the step was missing between the two, and an end of life was reported that had not come."""
    progress, rng = np.linspace(0.0, 40_000.0, 31), np.random.default_rng(0)
    truth = Degradation(initial=0.134, change=-0.1, scale=5_000.0, exponent=0.7)
    cof = value(progress, truth) + 0.02 * (progress >= 12_000.0) + 0.0004 * rng.standard_normal(31)
    runs = [
        Measurement(progress=z, value=y, variance=1e-8, epoch=int(z >= 12_000) + int(z >= 29_000))
        for z, y in zip(progress.tolist(), cof.tolist(), strict=True)
    ]
    prior = weak(runs[0], falling=True)
    posterior = Ukf().posterior(followed(Ukf(), prior, runs), 1_000, rng)
    exact = Grid().posterior(Grid().from_history(prior, runs), 1_000, rng)
    assert posterior.discrepancy is not None
    assert posterior.discrepancy.height.mean(axis=0) == pytest.approx([0.02, 0.0], abs=0.002)
    ends = [predict_first_passage(found, fraction=0.5, as_of=40_000.0) for found in (posterior, exact)]
    assert [end.status for end in ends] == [PassageStatus.PREDICTED] * 2
    assert ends[0].end_of_life[0.5] == pytest.approx(ends[1].end_of_life[0.5], rel=0.05)


def test_the_ukf_bears_more_events_than_anyone_logs() -> None:
    """A sensor is zeroed before each of 60 tests: each begins an epoch, and has a step of its own."""
    rng = np.random.default_rng(5)
    progress = np.linspace(0.0, 20_000.0, 60)
    cof = value(progress, Degradation(initial=0.134, change=-0.1, scale=5_000.0, exponent=0.7))
    runs = [
        Measurement(progress=z, value=y + 0.0004 * rng.standard_normal(), variance=1e-8, epoch=place)
        for place, (z, y) in enumerate(zip(progress.tolist(), cof.tolist(), strict=True))
    ]
    prior = weak(runs[0], falling=True)
    state = Ukf().update(replace(Ukf().start(prior), history=History.of(runs[:-1], prior)), runs[-1])
    assert state.mean.shape[1] == 6 + 59
    posterior = Ukf().posterior(state, 500, rng)
    now, deviation = posterior.moments(posterior.values(np.array([20_000.0]))[0])
    assert abs(now - cof[-1]) < 4.0 * deviation + 0.01
    assert posterior.weight.size == 500


def test_a_step_of_all_filters_at_once_is_filterpys_step_of_each() -> None:
    """Two filters of eq. 6, one with a discrepancy beside it, led on a fifth of their progress: means, covariances and
    the measurement's moments are those of filterpy, filter by filter."""
    state = followed(Ukf(), PRIOR, CAMPAIGN[:9])
    of = np.flatnonzero(np.isin(state.form, state.form[:2]))
    normals = replace(
        state.normals, form=np.array([0, 2]), **{n: getattr(state, n)[of] for n in ("mean", "covariance", "scatter")}
    )
    assert normals.mean.shape == (2, 6)
    last, reference, unit = CAMPAIGN[8].progress, state.reference, PRIOR.initial_sd
    way = Way(
        reference=reference,
        before=last,
        after=1.2 * last,
        steps=np.zeros(0),
        progress=1.2 * last,
        value=0.1,
        variance=0.0,
        relative=1.0,
    )

    def moved(x: FloatArray, _: float) -> FloatArray:
        return x + np.eye(6)[4] * x[5] * 0.2 * last / reference

    def seen(x: FloatArray) -> FloatArray:
        initial, at_reference, log_scale, log_exponent, beside, _ = unscaled(PRIOR, x)
        share, whole = progress_fraction(np.array([way.progress, reference]), np.exp(log_scale), np.exp(log_exponent))
        return np.array([(initial + (at_reference - initial) * share / whole + beside) / unit])

    mean, covariance = predicted(PRIOR, normals, way)
    noise = covariance - predicted(PRIOR, replace(normals, form=np.zeros(2, dtype=np.intp)), way)[1]
    assert noise[0].max() == 0.0 < noise[1].max()
    expected, variance, across = measured(PRIOR, normals.form, mean, covariance, way)
    for one in range(2):
        theirs = UnscentedKalmanFilter(
            dim_x=6,
            dim_z=1,
            dt=1.0,
            hx=seen,
            fx=moved,
            points=MerweScaledSigmaPoints(n=6, alpha=1.0, beta=0.0, kappa=0.0),
        )
        theirs.x, theirs.P = normals.mean[one], normals.covariance[one]
        theirs.Q, theirs.R = noise[one] + 1e-9 * np.eye(6), np.array([[0.0]])
        theirs.predict()
        theirs.update(np.array([0.1 / unit]))
        np.testing.assert_allclose(mean[one], theirs.x_prior, rtol=0, atol=1e-12)
        np.testing.assert_allclose(covariance[one], theirs.P_prior, rtol=0, atol=1e-12)
        assert expected[one] == pytest.approx(0.1 / unit - theirs.y[0], rel=1e-12)
        assert variance[one] == pytest.approx(theirs.S[0, 0], rel=1e-9)
        np.testing.assert_allclose(across[one], theirs.K[:, 0] * theirs.S[0, 0], rtol=0, atol=1e-12)


def wandering() -> list[Measurement]:
    """A quantity that wanders until no course fits."""
    progress = np.arange(4.0, 200.0, 4.0)
    values = 0.05 + 0.003 * np.sin(progress / 14.0) + 0.005 * (progress / 160.0) ** 6 * (progress < 165.0)
    return [Measurement(progress=z, value=y, variance=1e-8) for z, y in zip(progress, values, strict=True)]


def test_no_course_that_the_ukf_draws_ended_before_the_last_test() -> None:
    """Where no course fits: one that grows without bounds at an end behind would be thousands of times the quantity."""
    measurements, ended = wandering(), 0.0
    state = followed(Ukf(), weak(measurements[0], falling=True), measurements[:20])
    for measurement in measurements[20:]:
        state = Ukf().update(state, measurement)
        draws = Ukf().posterior(state, 2_000, np.random.default_rng(7))
        behind = (draws.scale < 0.0) & (-draws.scale <= state.history.span)
        ended = max(ended, float(behind.mean()))
        assert float(draws.weight @ behind) == 0.0
        assert abs(float(draws.weight @ draws.values(np.array([measurement.progress]))[0]) - measurement.value) < 0.02
    assert ended > 0.0, "the case shows nothing: no course was drawn beyond its end"


def test_where_every_drawn_course_has_ended_all_are_kept_alike() -> None:
    """Normals of growing courses whose end is just beyond the reference, and a last measurement at twice that."""
    measurements = wandering()
    state = followed(Ukf(), weak(measurements[0], falling=True), measurements[:20])
    growing = SCALE_SIGN[FORM_COURSE[state.form.astype(np.intp)]] < 0.0
    assert growing.any()
    mean = state.mean[growing]
    mean[:, 2] = -DOMAIN
    state = replace(
        state,
        form=state.form[growing],
        log_weight=state.log_weight[growing],
        mean=mean,
        covariance=1e-12 * state.covariance[growing],
        scatter=state.scatter[growing],
        history=state.history.append(replace(measurements[20], progress=2.0 * state.reference), state.prior),
    )
    drawn = Ukf().posterior(state, 500, np.random.default_rng(0))
    assert (-drawn.scale <= state.history.span).all(), "the case shows nothing: a course has not ended"
    np.testing.assert_array_equal(drawn.weight, 1.0 / 500)


def test_before_the_first_measurement_the_ukf_draws_from_the_prior_and_has_no_normals() -> None:
    """They would be thrown away with the first measurement, from which the filter starts whatever was before it."""
    state = Ukf().start(PRIOR)
    assert state.mean.shape == (0, 6)
    drawn = Ukf().posterior(state, 4_000, np.random.default_rng(0))
    mean, deviation = drawn.moments(drawn.initial)
    assert mean == pytest.approx(PRIOR.initial_mean, abs=0.05 * PRIOR.initial_sd)
    assert deviation == pytest.approx(PRIOR.initial_sd, rel=0.05)
    assert same(UkfState.from_arrays(state.to_arrays()), state)
