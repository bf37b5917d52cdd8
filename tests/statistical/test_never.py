"""The probability that the end is reached at all, on lives that end and on lives that do not."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from models.tracking.prior import TrackPrior
from tests.lab.score.off_prior import stated
from tests.statistical.lives import PRIOR

pytestmark = pytest.mark.slow

SEED = 9204


def off(count: int, believed: TrackPrior) -> list[float]:
    """How far what came lies from what was stated, by fifths of the stated probability [-]."""
    told, came = stated(count, SEED, whole=True, believed=believed)
    differences = []
    for low, high in itertools.pairwise((0.0, 0.2, 0.4, 0.6, 0.8, 1.0 + 1e-9)):
        here = (told >= low) & (told < high)
        differences.append(float(came[here].mean() - told[here].mean()))
        print(
            f"{low:.1f} to {high:.1f}: {here.sum()} lives, {told[here].mean():.3f} stated, {came[here].mean():.3f} came"
        )
    return differences


def test_lives_reach_their_end_as_often_as_is_stated() -> None:
    """2,400 lives leave three points in a fifth that has 280 of them; five are allowed. Three in four reach their end."""
    assert np.abs(off(2_400, PRIOR)).max() < 0.05


def test_a_filter_without_knees_is_found_out() -> None:
    """The negative control: a life that has worn evenly may fall faster from some day on."""
    assert max(off(400, replace(PRIOR, knee_hazard=0.0))) > 0.1
