"""Structure that nobody wrote down is seen by some smooth contrast, wherever in the speeds it lies."""

from collections.abc import Callable

import numpy as np
import pytest

from models.arrays import FloatArray
from models.diagnosis.design.design import Points
from models.diagnosis.explanations.contrasts import contrasts_of
from models.diagnosis.pooled_fit.projection import gram_of, project
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import Study, study

#: Where bands of speed lie, as shares of the highest: the worst of them counts.
PLACES, WIDE = np.linspace(0.25, 0.75, 21), 0.05


@pytest.fixture(scope="module")
def plain() -> Study:
    return study(campaign(4))


def off(rows: Points, at: float) -> FloatArray:
    return np.asarray((rows.velocity / rows.velocity.max() - at) / WIDE, dtype=np.float64)


def bump(rows: Points, at: float) -> FloatArray:
    return np.asarray(np.exp(-0.5 * off(rows, at) ** 2), dtype=np.float64)


def resonance(rows: Points, at: float) -> FloatArray:
    return np.asarray(off(rows, at) / (1 + off(rows, at) ** 2), dtype=np.float64)


def slowing(rows: Points, at: float) -> FloatArray:
    return np.asarray((rows.acceleration < 0) * np.exp(-(off(rows, at) ** 4)), dtype=np.float64)


@pytest.mark.parametrize(("shape", "least"), [(bump, 0.6), (resonance, 0.55), (slowing, 0.45)])
def test_a_contrast_sees_its_share_of_what_is_visible(
    plain: Study, shape: Callable[[Points, float], FloatArray], least: float
) -> None:
    """Of λ that is left of the structure beside the baseline, the best single contrast sees so much wherever it lies."""
    known, rows = plain.baseline, plain.design.rows
    contrasts = contrasts_of(plain.design, known.fit.prediction)
    structures = np.stack([shape(rows, at) for at in PLACES], axis=1) * known.fit.torque[:, None]
    columns = np.column_stack([structures, contrasts.columns])
    info = project(gram_of(plain.problem, known.fit, columns), plain.problem.noise.run_gain, 0.0).info
    scale = np.sqrt(np.maximum(np.diag(info), 1e-300))
    shares = (info / scale[:, None] / scale)[: PLACES.size, PLACES.size :] ** 2
    assert shares.max(axis=1).min() > least


@pytest.mark.parametrize("waves", [5.3, 8.4, 13.7])
def test_ripples_over_speed_are_seen_through_the_lag_of_loops(plain: Study, waves: float) -> None:
    """Half waves over the range of speeds, in between those that are looked for, and of any phase."""
    known, points = plain.baseline, plain.design.points
    contrasts = contrasts_of(plain.design, known.fit.prediction)
    unit = points.velocity / points.velocity.max()
    ripples = np.stack([np.cos(np.pi * waves * unit + phase) for phase in (0.0, 0.8, 1.6, 2.4)], axis=1)
    prediction = known.fit.prediction
    friction = prediction.scene.curve[:, None] * ripples
    structures = prediction.change_at_rows(plain.design, friction, before_lag=True)
    columns = np.column_stack([structures, contrasts.columns])
    info = project(gram_of(plain.problem, known.fit, columns), plain.problem.noise.run_gain, 0.0).info
    scale = np.sqrt(np.maximum(np.diag(info), 1e-300))
    shares = (info / scale[:, None] / scale)[:4, 4:] ** 2
    assert shares.max(axis=1).min() > 0.45
