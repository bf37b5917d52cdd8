"""Quantities whose measurements err together: what only their sum knows is not lost."""

import numpy as np
import pytest

from models.degradation.general_order import Degradation, value
from models.prognosis.from_parameters import draw_jointly, paired, shrunk_correlation
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior
from models.tracking.prior import weak

TRUTHS = (
    Degradation(initial=20.0, change=-9.0, scale=5000.0, exponent=0.8),
    Degradation(initial=5.0, change=3.0, scale=9000.0, exponent=0.5),
)
AT = np.linspace(0.0, 12_000.0, 14)
#: One errs by +1 where the other errs by -1: their sum is known a hundred times better.
COVARIANCE = np.array([[0.25, -0.24998], [-0.24998, 0.25]])


def measured(rng: np.random.Generator) -> np.ndarray:
    errors = rng.multivariate_normal(np.zeros(2), COVARIANCE, AT.size)
    return np.stack([value(AT, truth) for truth in TRUTHS], axis=1) + errors


def own(values: np.ndarray, rng: np.random.Generator) -> list[Posterior]:
    """Each quantity's track by itself."""
    grid, found = Grid(), []
    for column in values.T:
        seen = [Measurement(progress=float(z), value=float(v), variance=0.25) for z, v in zip(AT, column, strict=True)]
        found.append(grid.posterior(grid.from_history(weak(seen[0], falling=False), seen), 1000, rng))
    return found


def test_the_sum_is_known_as_well_as_it_was_measured() -> None:
    rng = np.random.default_rng(1)
    values = measured(rng)
    tracks = own(values, rng)
    together = draw_jointly(AT, values, np.repeat(COVARIANCE[None], AT.size, axis=0), tracks, 300, rng)
    end = AT[-1:]
    sums = sum(each.values(end)[0] for each in together)
    true = float(sum(value(AT[-1], truth) for truth in TRUTHS))
    assert abs(sums.mean() - true) < 0.05
    assert sums.std() < 0.05
    # the negative control: side by side, the two tracks know their sum no better than each knows itself
    alone = tracks[0].values(end)[0] + tracks[1].values(end)[0]
    assert alone.std() > 5.0 * sums.std()


def test_without_correlation_each_track_is_as_it_was() -> None:
    rng = np.random.default_rng(2)
    values = np.stack([value(AT, truth) for truth in TRUTHS], axis=1) + 0.5 * rng.standard_normal((AT.size, 2))
    tracks = own(values, rng)
    scatter = [float(each.weight @ each.scatter**2) for each in tracks]
    together = draw_jointly(
        AT, values, np.repeat(np.diag(0.25 + np.array(scatter))[None], AT.size, axis=0), tracks, 1000, rng
    )
    for track, each in zip(tracks, together, strict=True):
        mean, sd = track.moments(track.values(AT[-1:])[0])
        found = each.values(AT[-1:])[0]
        assert found.mean() == pytest.approx(mean, abs=0.35 * sd)
        assert found.std() == pytest.approx(sd, rel=0.35)


def test_pairs_have_the_wanted_correlation_and_the_same_values() -> None:
    rng = np.random.default_rng(3)
    values = np.stack([rng.standard_normal(2000), np.exp(rng.standard_normal(2000))], axis=1)
    index = paired(values, np.array([[1.0, 0.9], [0.9, 1.0]]), rng)
    found = np.take_along_axis(values, index, axis=0)
    assert np.sort(found, axis=0) == pytest.approx(np.sort(values, axis=0))
    assert np.corrcoef(found[:, 0], np.log(found[:, 1]))[0, 1] == pytest.approx(0.9, abs=0.03)


def test_correlation_shrinks_where_few_tests_tell_it() -> None:
    rng = np.random.default_rng(4)
    common = rng.standard_normal(60)
    residuals = np.stack([common, common + 0.1 * rng.standard_normal(60)], axis=1)
    many, few = shrunk_correlation(residuals), shrunk_correlation(residuals[:4])
    assert 0.85 < many[0, 1] < 1.0
    assert abs(few[0, 1]) < 0.5
    assert (shrunk_correlation(residuals[:1]) == np.eye(2)).all()
