"""What no test has seen is not safe: the bound after the first tests of a life that show no wear.

`make score PARTS=starts` prints how often it is late, by kind of start.
"""

from dataclasses import replace

import numpy as np
import pytest

from models.prognosis.criteria import HORIZON
from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.stated_end import stated_end
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.lab.score.starts import bounds, real_starts, safe_bound, simulated_starts
from tests.models.tracking.tracked_series import NAMES, followed, sent


def measured(cycles: np.ndarray, share_of_new: np.ndarray) -> list[Measurement]:
    """Tests of a clutch of COF 0.1 when new, which scatter by 0.2 %."""
    noise = 1.0 + 0.002 * np.random.default_rng(3).standard_normal(cycles.size)
    return sent(cycles, 0.1 * share_of_new * noise, 1e-9)


RUN_IN = np.linspace(0.0, 2_500.0, 6)
FLAT = np.linspace(0.0, 1_500.0, 4)
WORN = np.linspace(0.0, 8_000.0, 9)
#: What was said to be safe for 990,000, 290,000 and 410,000 more cycles.
STARTS = {
    "runs in by a tenth": measured(RUN_IN, 1.1 - 0.1 * np.exp(-RUN_IN / 600.0)),
    "flat": measured(FLAT, np.ones(4)),
    "flat at 85 % and then 3 % lower": measured(WORN, np.where(WORN == 0.0, 1.0, np.where(WORN < 8_000.0, 0.85, 0.82))),
}


@pytest.mark.parametrize("name", STARTS)
@pytest.mark.parametrize("tracker", [Grid(), Particle(), Ukf()], ids=NAMES)
def test_a_clutch_that_shows_no_wear_is_safe_for_about_as_long_as_it_was_tested(tracker, name: str) -> None:
    tests = STARTS[name]
    now, rng = tests[-1].progress, np.random.default_rng(1)
    drawn = tracker.posterior(followed(tracker, weak(tests[0], falling=True), tests, rng), 1_000, rng)
    end = stated_end(drawn, fraction=0.5, as_of=now, horizon=HORIZON, tests=tests)
    left = float(weighted_quantiles(np.minimum(end.ends, HORIZON), end.weight, (0.05,))[0]) - now
    assert 0.2 * now < left < 3.0 * now


def test_the_bound_is_that_of_the_knee_that_may_come() -> None:
    """The control: where no knee may come the bound after four flat tests is many times the cycles that were tested."""
    tests = STARTS["flat"]
    prior, now = weak(tests[0], falling=True), tests[-1].progress
    believed, without = (
        safe_bound(tests, np.random.default_rng(1), replace(prior, knee_hazard=hazard))
        for hazard in (prior.knee_hazard, 0.0)
    )
    assert believed < 4.0 * now < 0.5 * without


def late(count: int, seed: int) -> tuple[float, int]:
    """The share of starts whose safe bound lies beyond the end, and how many there are."""
    found = bounds([*simulated_starts(count, seed), *real_starts(count, seed)], seed)
    outcomes = [bound > end for each in found.values() for bound, _, end in each]
    print(f"seed {seed}: {sum(outcomes)} of {len(outcomes)} late")
    return float(np.mean(outcomes)), len(outcomes)


def test_one_safe_bound_in_twenty_is_late_at_most() -> None:
    """40 simulated starts; all kinds are in the slow test."""
    found = bounds(simulated_starts(40, 4115), 4115)
    assert {name: len(each) for name, each in found.items()} == {"level": 20, "runs in": 20}
    assert np.mean([bound > end for each in found.values() for bound, _, end in each]) <= 0.05


@pytest.mark.slow
def test_of_three_hundred_starts_of_real_and_simulated_lives_one_in_twenty_is_late_at_most() -> None:
    share, count = late(200, 4115)
    assert count >= 200
    assert share <= 0.05
