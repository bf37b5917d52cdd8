"""The three filters: coverage, sharpness and CRPS on lives drawn from the prior, and what they say once an end is passed."""

import numpy as np

from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.prior import weak
from tests.lab.score.off_prior import rig_lives
from tests.lab.score.table import EVERY, Scores, joined, percents, written
from tests.models.tracking.tracked_series import sent
from tests.statistical.lives import PRIOR, STAGES, at_stages, exact, lives, upto

RUNS, DRAWS = 25, 1_000
FILTERS = (Grid(), Particle(), Ukf())
#: Of lives past their end: stages, tests, and scatter from run to run, most of it a gain: fresh tests scatter the most.
PAST, TESTS, GAIN, NOISE = (0.9, 1.0, 1.2, 1.4), 43, 0.003, 0.001


def calibration(count: int, seed: int, outlying: float = 0.0) -> str:
    """How often the 90 % interval holds the end of life, by stage, and how wide it is."""
    scores = Scores()
    for life, rng in lives(count, seed):
        measurements = life.measured(0.8, RUNS, rng, outlying)
        for tracker in FILTERS:
            for stage, state in at_stages(tracker, PRIOR, measurements, rng):
                scores.add(tracker.name, stage, tracker.posterior(state, DRAWS, rng), life.end)
    among = f", of the runs {100 * outlying:.0f} % outlying (gain off by 10 %)" if outlying else ""
    rows = (
        (
            f"`{name}`",
            *(f"{100 * held:.1f}" for held in scores.means(name, "held")),
            *(f"{crps:.4f}" for crps in scores.medians(name, "crps")),
            scores.histogram(name),
        )
        for name in (tracker.name for tracker in FILTERS)
    )
    return written(
        f"{count} lives, seed {seed}{among}",
        "filter | holds the truth at 20 | 40 | 60 | 80 % of life | CRPS, median at 20 | 40 | 60 | 80 % | PIT in tenths, %",
        rows,
    )


def beside_exact(count: int, seed: int) -> str:
    """CRPS and width relative to the exact posterior under the same prior, by importance sampling of the density written
    out in full."""
    scores, counts = Scores(), []
    for life, rng in lives(count, seed):
        measurements = life.measured(0.8, RUNS, rng)
        states = {tracker.name: dict(at_stages(tracker, PRIOR, measurements, rng)) for tracker in FILTERS}
        for stage in STAGES:
            reference, effective = exact(states["particle"][stage], upto(measurements, stage), 5_000, rng)
            counts.append(effective)
            scores.add("exact", stage, reference, life.end)
            for tracker in FILTERS:
                scores.add(tracker.name, stage, tracker.posterior(states[tracker.name][stage], DRAWS, rng), life.end)
    means = written(
        f"{count} lives, seed {seed}; the exact sample counts for {np.median(counts):.0f} draws in the median, "
        f"{np.quantile(counts, 0.05):.0f} at the 5 % quantile",
        "filter | CRPS over exact, all stages | 20 % | 40 % | 60 % | 80 % of life | of the end's logarithm, all stages "
        "| 20 % | 40 % | 60 % | 80 %",
        (
            (
                f"`{tracker.name}`",
                *(
                    "{:.3f} ± {:.3f}".format(*scores.ratio(tracker.name, "exact", stages, what))
                    for what in ("crps", "log_crps")
                    for stages in EVERY
                ),
            )
            for tracker in FILTERS
        ),
    )
    medians = written(
        "",
        "filter | CRPS over exact, life by life, median at 20 | 40 | 60 | 80 % | width over exact, median at 20 | 40 | 60 "
        "| 80 %",
        (
            (
                f"`{tracker.name}`",
                *(
                    f"{scores.typical_ratio(tracker.name, 'exact', stage, what):.3f}"
                    for what in ("crps", "width")
                    for stage in STAGES
                ),
            )
            for tracker in FILTERS
        ),
    )
    return means + medians


def after_end(count: int, seed: int) -> str:
    """Of the simulated rig's lives: intervals that hold the end, begin after it and end before it, and how far off their
    medians."""
    scores = Scores()
    for index, (course, end) in enumerate(rig_lives(count, seed)):
        rng = np.random.default_rng([seed, index])
        shares = np.linspace(0.0, PAST[-1], TESTS)
        cofs = 0.1 * np.array([course(share) for share in shares.tolist()])
        values = cofs * (1.0 + GAIN * rng.standard_normal(TESTS)) + 0.1 * NOISE * rng.standard_normal(TESTS)
        tests = sent(shares * end, values, (0.1 * NOISE) ** 2)
        for tracker in FILTERS:
            state, seen = tracker.start(weak(tests[0], falling=True)), 0
            for stage in PAST:
                runs = sum(test.progress <= (stage + 1e-6) * end for test in tests)
                for test in tests[seen:runs]:
                    state = tracker.update(state, test, rng)
                seen = runs
                scores.add(tracker.name, stage, tracker.posterior(state, DRAWS, rng), end)
    rows = []
    for name in (tracker.name for tracker in FILTERS):
        shares_of = (scores.means(name, what, PAST) for what in ("held", "late", "early"))
        off = joined("{:+.2f}", (100 * (median - 1.0) for median in scores.means(name, "median", PAST)))
        rows.append((f"`{name}`", *(f"{percents(which)} %" for which in shares_of), off))
    return written(
        f"{count} lives, seed {seed}, {TESTS} tests, scatter {GAIN:.1%} of the value",
        "filter | holds the end at 90/100/120/140 % of life | begins after it | ends before it | median off, % of life",
        rows,
    )
