"""A long history with its older tests merged says nearly the same as all of its tests."""

from collections.abc import Iterator

import numpy as np
import pytest

from models.degradation.general_order import DegradationLaw, value
from models.prognosis.first_passage import ends_of_life, horizon_at, weighted_quantiles
from models.tracking.filters.grid import Grid, GridState
from models.tracking.history import History
from models.tracking.linear_model import EvaluationPoints, evidence, pointwise, tabulated
from models.tracking.merged_tests import MergedHistory, judged, merged
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior, weak
from models.tracking.sampling import spread_normals, spread_points, with_linear_terms
from tests.models.tracking.tracked_series import sent
from tests.support import one_quick

#: By how much the probability below a quantile may change, in the median of all looked at and in nine of ten: on more
#: laws and lives of 300 and 1,000 tests it is 0.01 to 0.02, and 0.03 to 0.07 (docs/appendix/scale.md, one life).
USUAL, MOST = 0.03, 0.1
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
SPAN, NOISE = 60_000.0, 4e-4
LAW = DegradationLaw(initial=0.134, change=-0.08, scale=0.5 * SPAN, exponent=0.7)
FAST = DegradationLaw(initial=0.134, change=-0.06, scale=SPAN / 400, exponent=0.6)


def history_of(law: str, tests: int, seed: int = 0) -> tuple[TrackPrior, History]:
    """A life of so many tests by a law, and its prior."""
    rng = np.random.default_rng(seed)
    progress = np.linspace(0.0, SPAN, tests)
    course, noise = value(progress, LAW), NOISE * rng.standard_normal(tests)
    pace = (course[0] - np.interp(0.7 * SPAN, progress, course)) / (0.7 * SPAN)
    values = {
        "eq. 6": course + noise,
        "fast start": value(progress, FAST) + noise,
        "knee": course - 3.0 * pace * np.maximum(progress - 0.7 * SPAN, 0.0) + noise,
        "late knee": course - 8.0 * pace * np.maximum(progress - 0.97 * SPAN, 0.0) + noise,
        "step": course + 0.002 * (progress >= 0.43 * SPAN) + noise,
        "event": course + 0.006 * (progress >= 0.43 * SPAN) + noise,
        "outlying": course + 0.0134 * (rng.random(tests) < 0.1) * rng.standard_normal(tests) + noise,
        "proportional": course * (1.0 + 0.005 * rng.standard_normal(tests)),
        "wander": course * (1.0 + 0.02 * np.sin(9.0 * progress / SPAN)) + noise,
    }[law]
    measurements = sent(progress, values, 1e-8, progress >= 0.43 * SPAN if law == "event" else 0)
    prior = weak(measurements[0], falling=True)
    return prior, History.of(measurements, prior)


LAWS = ("eq. 6", "fast start", "knee", "late knee", "step", "event", "outlying", "proportional", "wander")


def both(prior: TrackPrior, full: History, draws: int = 2_000) -> tuple[TrackPosterior, TrackPosterior]:
    """Draws by the merged history, and the same points by weights and linear terms of all its tests: what the lattices find
    is shared, so that only the merging makes a difference."""
    short = merged(full, prior)
    assert isinstance(short, MergedHistory)
    rng = np.random.default_rng(0)
    grid, state = Grid(nodes=17, rows=17, levels=9), GridState(prior=prior, history=short)
    uniform = spread_points(draws, rng.random(3))
    points, weight, solved = grid.points(state, grid.laid(state), uniform, 0.5)
    outlying = np.zeros((full.value.size, draws))
    outlying[judged(full.value, full.variance, full.epoch, prior)[2]] = 1.0
    for row in np.flatnonzero(short.single):
        at = (full.progress == short.progress[row]) & (full.value == short.value[row])
        outlying[at] = np.maximum(outlying[at], points.outlying[row])
    all_points = EvaluationPoints(
        log_scale=points.log_scale,
        log_exponent=points.log_exponent,
        log_scatter=points.log_scatter,
        form=points.form,
        outlying=outlying,
    )
    exact = pointwise(full, prior, all_points)
    change = evidence(exact[0], prior) - evidence(solved[0], prior)
    reweighted = weight * np.exp(change - change.max())
    normals = spread_normals(draws, rng.random(2))
    return (
        with_linear_terms(short, prior, points, solved, weight, normals, np.random.default_rng(1)),
        with_linear_terms(
            full, prior, all_points, exact, reweighted / reweighted.sum(), normals, np.random.default_rng(1)
        ),
    )


def quantities(posterior: TrackPosterior) -> Iterator[np.ndarray]:
    """The coefficients, the course now and ahead, the scatter and the end of life of every draw."""
    yield from (posterior.initial, posterior.change, posterior.log_scale, posterior.log_exponent, posterior.scatter)
    yield from posterior.values(np.array([SPAN, 1.5 * SPAN]))
    horizon = SPAN + horizon_at(SPAN)
    yield np.minimum(ends_of_life(posterior, 0.5, horizon=horizon), horizon)


def below(sample: np.ndarray, weight: np.ndarray, at: float) -> float:
    return 0.5 * float(weight[sample < at].sum() + weight[sample <= at].sum())


@pytest.mark.parametrize("law", one_quick(LAWS))
def test_quantiles_of_coefficients_and_of_remaining_life_are_those_of_all_tests(law: str) -> None:
    changes = []
    for tests, seed in ((300, 1), (300, 2), (1_000, 3)):
        short, full = both(*history_of(law, tests, seed))
        for by_bins, by_all in zip(quantities(short), quantities(full), strict=True):
            changes += [
                abs(below(by_bins, short.weight, at) - below(by_all, full.weight, at))
                for at in weighted_quantiles(by_all, full.weight, QUANTILES).tolist()
            ]
    assert np.median(changes) < USUAL
    assert np.quantile(changes, 0.9) < MOST


@pytest.mark.parametrize("law", LAWS)
def test_rows_do_not_grow_with_the_number_of_tests(law: str) -> None:
    rows = [merged(history_of(law, tests)[1], history_of(law, tests)[0]).value.size for tests in (1_000, 8_000)]
    assert rows[0] <= 140
    assert rows[1] <= 170


def test_up_to_a_hundred_tests_nothing_is_merged() -> None:
    prior, history = history_of("eq. 6", 100)
    assert merged(history, prior) is history


def test_what_stays_apart_stays_as_it_was_measured() -> None:
    prior, history = history_of("event", 400)
    short = merged(history, prior)
    assert isinstance(short, MergedHistory)
    assert short.span == history.span
    assert short.count.sum() == history.value.size
    assert np.array_equal(short.steps, history.steps)
    assert np.array_equal(short.value[-6:], history.value[-6:])
    assert set(short.value[short.single]) <= set(history.value)


def test_tests_at_one_progress_merge_without_any_loss() -> None:
    """The witness: b, Z and the variance are the same for all of a bin, so that the closed form is, up to a constant."""
    rng = np.random.default_rng(5)
    places = np.repeat(np.linspace(0.0, SPAN, 12), 15)
    measurements = sent(places, value(places, LAW) + NOISE * rng.standard_normal(places.size), 1e-8)
    prior = weak(measurements[0], falling=True)
    full = History.of(measurements, prior)
    of = np.repeat(np.arange(12), 15)
    level = np.bincount(of, full.value) / 15
    short = MergedHistory(
        progress=places[::15],
        value=level,
        variance=full.variance[::15],
        epoch=full.epoch[::15],
        new_levels=full.new_levels[::15],
        sensor=full.sensor[::15],
        count=np.full(12, 15.0),
        within=np.bincount(of, np.square(full.value - level[of])),
    )
    forms = np.arange(24)  # where scatter is a share of the value, that of the mean stands for all
    points = {
        "log_scale": rng.normal(np.log(SPAN), 0.5, 24) + 1.0,
        "log_exponent": rng.normal(-0.3, 0.3, 24),
        "log_scatter": rng.normal(np.log(NOISE), 0.3, 24),
        "form": forms,
    }
    logs = [
        evidence(
            pointwise(history, prior, EvaluationPoints(outlying=np.zeros((history.value.size, 24)), **points))[0], prior
        )
        for history in (full, short)
    ]
    np.testing.assert_allclose(logs[1] - logs[0], (logs[1] - logs[0])[0], atol=1e-5)
    table = EvaluationPoints(outlying=np.zeros((12, 24)), **points).basis(short.progress).T[:, :, None]
    sums = tabulated(short, prior, table, points["log_scatter"][:, None], forms, np.zeros((12, 24)))
    np.testing.assert_allclose(evidence(sums, prior)[:, 0, 0], logs[1], atol=1e-5)


def test_a_bin_without_its_squares_would_shift_the_scatter() -> None:
    """The negative control: the means alone make tests seem to scatter less."""
    prior, history = history_of("eq. 6", 600)
    short = merged(history, prior)
    assert isinstance(short, MergedHistory)
    means = MergedHistory(
        **{name: getattr(short, name) for name in History.__slots__}, count=short.count, within=0.0 * short.within
    )
    scatter = []
    for each in (history, short, means):
        posterior = Grid().posterior(GridState(prior=prior, history=each), 500, np.random.default_rng(0))
        scatter.append(float(posterior.weight @ posterior.scatter))
    assert abs(scatter[1] / scatter[0] - 1.0) < 0.03
    assert scatter[2] < 0.8 * scatter[0]
