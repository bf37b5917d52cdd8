"""Which course the data speak for: named where it is clear, and held where the filters would otherwise come too late."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from models.prognosis.course_shares import CourseName, course_shares
from models.prognosis.first_passage import ends_of_life, predict_first_passage
from models.tracking.courses import CourseForm
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import weak
from tests.models.tracking.tracked_series import CAMPAIGN, NAMES, PRIOR, followed, sent

TRACKERS = pytest.mark.parametrize("tracker", [Grid(), Particle(), Ukf()], ids=NAMES)


def accelerating(share: float) -> list[Measurement]:
    """A life of 10,000 cycles whose COF falls by 0.75 (1 - √(1 - x/1.125)), 0.3 % scatter, up to a share of it."""
    rng = np.random.default_rng(8)
    x = np.linspace(0.0, share, 1 + round(30 * share))
    values = 0.1 * (1.0 - 0.75 * (1.0 - np.sqrt(1.0 - x / 1.125))) * (1.0 + 0.003 * rng.standard_normal(x.size))
    return sent(1e4 * x, values, 1e-8)


def posterior_of(tracker: Any, seen: list[Measurement]) -> TrackPosterior:
    found: TrackPosterior = tracker.posterior(
        followed(tracker, weak(seen[0], falling=True), seen), 1_000, np.random.default_rng(2)
    )
    return found


@TRACKERS
def test_a_life_that_accelerates_is_said_to_and_held_and_one_of_eq_6_too(tracker: Any) -> None:
    posterior = posterior_of(tracker, accelerating(0.6))
    assert course_shares(posterior)[0].name is CourseName.ACCELERATING
    assert course_shares(posterior)[0].probability > 0.8
    found = predict_first_passage(posterior, fraction=0.5, as_of=6_000.0).end_of_life
    assert found[0.05] < 10_000.0 < (found[0.95] or math.inf)
    # a life of eq 6 is said to be
    shares = course_shares(posterior_of(tracker, CAMPAIGN))
    assert shares[0].name is CourseName.EQ_6
    assert (shares[0].order or 0.0) > 1.0
    assert sum(share.probability for share in shares) == pytest.approx(1.0)


def test_no_course_is_lost_while_the_data_say_nothing_of_it() -> None:
    """The particle filter keeps some particles of each, whatever their weight: later tests may speak for them."""
    state = followed(Particle(), PRIOR, CAMPAIGN)
    counts = np.bincount(state.cloud.course, minlength=len(CourseForm))
    assert counts.min() > 0.02 * counts.sum()


def test_a_straight_line_is_neither() -> None:
    share = np.linspace(0, 0.6, 19)
    seen = sent(1e4 * share, 0.1 * (1 - 0.5 * share), 1e-8)
    shares = {share.name: share for share in course_shares(posterior_of(Grid(), seen))}
    assert CourseName.EQ_6 not in shares or shares[CourseName.EQ_6].probability < 0.1
    assert min(shares[CourseName.SLOWING].probability, shares[CourseName.ACCELERATING].probability) > 0.1


@TRACKERS
def test_what_rises_faster_and_faster_is_no_end(tracker: Any) -> None:
    """The accelerating life upside down: its cliff leads away from the threshold. Only wear that begins ahead ends it."""
    fresh, *rest = accelerating(0.8)
    rising = [fresh, *(replace(each, value=2.0 * fresh.value - each.value) for each in rest)]
    posterior = posterior_of(tracker, rising)
    assert predict_first_passage(posterior, fraction=0.5, as_of=8_000.0).end_of_life[0.5] is None
    no_knee = replace(posterior.discrepancy, knee=np.full(posterior.weight.size, np.inf))
    ends = ends_of_life(replace(posterior, discrepancy=no_knee), 0.5)
    assert posterior.weight[np.isfinite(ends)].sum() < 0.1
