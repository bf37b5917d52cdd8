"""The closed form of ξ0, Δ and the further terms, against the whole normal distribution of the data."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from models.degradation.general_order import Degradation, value
from models.tracking import linear_model, sampling
from models.tracking.courses import basis
from models.tracking.discrepancy import smooth
from models.tracking.history import History
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests import dense

PROGRESS = np.linspace(0.0, 12_000.0, 13)


VALUES = value(PROGRESS, Degradation(initial=0.134, change=-0.1, scale=5_000.0, exponent=0.7))


CAMPAIGN = [
    Measurement(progress=float(z), value=float(y), variance=1e-8) for z, y in zip(PROGRESS, VALUES, strict=True)
]


PRIOR = weak(CAMPAIGN[0], falling=True)


#: Three of eq. 6, with q of 0, 0.03 and 0.1, and one of every other course; of two the scatter is a share of the value.
POINTS = linear_model.Points(
    log_scale=np.array([8.5, 7.0, 10.0, 9.6, 8.0, 9.9, 8.5, 7.5]),
    log_exponent=np.array([-0.3, 0.4, -1.0, -0.7, 0.5, 0.1, 0.0, 0.0]),
    log_scatter=np.array([-8.0, -6.5, -9.0, -8.0, -7.5, -8.5, -8.0, -8.0]),
    form=np.array([0, 2, 3, 5, 10 + 24, 12, 19 + 24, 21]),
    outlying=np.eye(13)[:, [4, 4, 12, 4, 5, 4, 3, 6]] * [0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0],
)
COUNT = POINTS.form.size


#: The last four runs come after an event.
EPOCHS = [replace(each, epoch=int(index > 8)) for index, each in enumerate(CAMPAIGN)]


def normal(point: int, measurements: list[Measurement]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the measurements at one of POINTS, all linear terms integrated out."""
    means, covariances = dense.normal(PRIOR, measurements, POINTS)
    return means[point], covariances[point]


@pytest.mark.parametrize("measurements", [CAMPAIGN, EPOCHS], ids=["one epoch", "two epochs"])
def test_evidence_is_that_of_the_whole_normal(measurements: list[Measurement]) -> None:
    """All linear terms integrated out, the data are normal; δ's covariance comes from quadrature here."""
    history = History.of(measurements, PRIOR)
    found = linear_model.evidence(linear_model.pointwise(history, PRIOR, POINTS)[0], PRIOR)
    for point, log_probability in enumerate(found):
        mean, covariance = normal(point, measurements)
        expected = multivariate_normal(mean, covariance).logpdf(history.value)
        assert log_probability == pytest.approx(expected, abs=2e-3)


def test_conditional_is_that_of_the_whole_normal() -> None:
    """(ξ0, Δ) and the data are jointly normal: condition on the data."""
    history = History.of(EPOCHS, PRIOR)
    given = linear_model.conditional(linear_model.pointwise(history, PRIOR, POINTS)[0], PRIOR)
    for point in range(COUNT):
        mean, covariance = normal(point, EPOCHS)
        b = (mean - PRIOR.initial_mean) / PRIOR.change_mean
        prior = np.diag([PRIOR.initial_sd**2, PRIOR.change_sd**2])
        cross = prior @ np.stack([np.ones_like(b), b])
        gain = np.linalg.solve(covariance, cross.T).T
        expected = np.array([PRIOR.initial_mean, PRIOR.change_mean]) + gain @ (history.value - mean)
        spread = prior - gain @ cross.T
        np.testing.assert_allclose([given.initial[point], given.change[point]], expected, rtol=1e-4)
        found = [given.initial_variance[point], given.covariance[point], given.change_variance[point]]
        np.testing.assert_allclose(found, spread[[0, 0, 1], [0, 1, 1]], rtol=2e-3)


def test_the_table_and_the_points_are_one_sum() -> None:
    history = History.of(EPOCHS, PRIOR)
    table = basis(history.progress[:, None], POINTS.log_scale, POINTS.log_exponent, POINTS.course)
    levels = np.array([-8.0, -7.0])
    forms, outlying = np.array([0, 2 + 24]), np.eye(13)[:, [0, 5]]
    tabled = linear_model.evidence(
        linear_model.tabulated(history, PRIOR, table, np.stack([levels, levels]), forms, outlying), PRIOR
    )
    for kind, level in np.ndindex(2, 2):
        points = replace(
            POINTS,
            log_scatter=np.full(COUNT, levels[level]),
            form=np.full(COUNT, forms[kind]),
            outlying=np.repeat(outlying[:, kind : kind + 1], COUNT, axis=1),
        )
        pointed = linear_model.evidence(linear_model.pointwise(history, PRIOR, points, table)[0], PRIOR)
        np.testing.assert_allclose(tabled[kind, level], pointed, rtol=1e-9)


@pytest.mark.parametrize("measurements", [CAMPAIGN, EPOCHS], ids=["one epoch", "two epochs"])
def test_the_last_run_turned_outlying_is_that_of_all_sums_anew(measurements: list[Measurement]) -> None:
    """With one epoch the first point has no further terms, with two all have."""
    history = History.of(measurements, PRIOR)
    sound = replace(POINTS, outlying=POINTS.outlying * (np.arange(13) < 12)[:, None])
    outlying = replace(sound, outlying=sound.outlying + (np.arange(13) == 12)[:, None])
    sums, terms = linear_model.pointwise(history, PRIOR, sound)
    last = basis(history.progress[-1], POINTS.log_scale, POINTS.log_exponent, POINTS.course)
    turned = linear_model.last_outlying(history, PRIOR, sound, sums, terms, last)
    anew = linear_model.pointwise(history, PRIOR, outlying)[0]
    for name, found in asdict(turned).items():
        np.testing.assert_allclose(found, getattr(anew, name), rtol=1e-9, err_msg=name)


def test_drawn_terms_have_the_posterior_of_the_discrepancy() -> None:
    """Mean and variance of δ at the last run given the data, from 20,000 draws, against conditioning the joint normal."""
    history = History.of(CAMPAIGN, PRIOR)
    count = 20_000
    points = linear_model.Points(
        log_scale=np.full(count, 7.0),
        log_exponent=np.full(count, 0.4),
        log_scatter=np.full(count, -6.5),
        form=np.full(count, 2),
        outlying=np.repeat(POINTS.outlying[:, 1:2], count, axis=1),
    )
    sums, terms = linear_model.pointwise(history, PRIOR, points)
    given = linear_model.conditional(sums, PRIOR)
    rng = np.random.default_rng(0)
    pair = sampling.correlated_pair(
        rng.standard_normal((count, 2)), given.initial_variance, given.change_variance, given.covariance
    )
    initial, change = given.initial + pair[:, 0], given.change + pair[:, 1]
    drawn = linear_model.drawn_terms(terms, initial - PRIOR.initial_mean, change, rng.standard_normal((count, 6)))
    at_end = drawn @ smooth(history.progress, history.span, 6)[-1]
    mean, covariance = normal(1, CAMPAIGN)
    cross = (0.03 * 0.134) ** 2 * dense.integrated(PROGRESS)[-1]
    gain = np.linalg.solve(covariance, cross)
    sd = math.sqrt((0.03 * 0.134) ** 2 * dense.integrated(PROGRESS)[-1, -1] - gain @ cross)
    assert at_end.mean() == pytest.approx(gain @ (history.value - mean), abs=4.0 * sd / math.sqrt(count))
    assert at_end.std() == pytest.approx(sd, rel=0.03)
