"""Lives that are not drawn from the prior: other laws, the simulated rig, and lives that never reach the threshold."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from models.prognosis.first_passage import ends_of_life, predict_first_passage
from models.rig.truth import draw
from models.tracking.courses import (
    FORM_COURSE,
    FORM_PROPORTIONAL,
    FORM_SIZE,
    UNIT_OF_CHANGE,
    coefficients_at,
    log_form_weight,
)
from models.tracking.criteria import KNEE_HAZARD, KNEE_PACE, KNEE_REACH, LOG_KNEE_PACE_SD, UNSEEN_WEAR
from models.tracking.discrepancy import FUTURE, PAST, CourseDiscrepancy
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior, weak
from tests.lab.score.table import joined, percents, written
from tests.models.tracking.tracked_series import sent
from tests.statistical.forecasts import LAWS, STAGES, TESTS, followed
from tests.statistical.lives import CAP, PRIOR


def laws(count: int, seed: int) -> str:
    """By law: how often the interval holds the truth, begins after it, and how wide it is; of the filter, and as stated."""
    rows = []
    cases: dict[str, list[tuple[Callable[[float], float], float]]] = {
        name: [(course, 10_000.0)] * count for name, course in LAWS.items()
    }
    cases["the simulated rig: four parameters, an eq. 6 each"] = rig_lives(count, seed)
    for name, each in cases.items():
        found = [
            followed(course, np.random.default_rng([seed, index]), end) for index, (course, end) in enumerate(each)
        ]
        told = np.array([[by_stage[stage] for stage in STAGES] for by_stage in found])
        means, medians = told.mean(axis=0).T.tolist(), np.median(told, axis=0).T.tolist()
        cells = [(percents(means[k]), percents(means[k + 1]), joined("{:.2f}", medians[k + 2])) for k in (0, 3)]
        rows.append((name, *cells[0], *cells[1]))
    return written(
        f"{count} lives a law, seed {seed}, {TESTS} tests, 0.3 % scatter; held, beginning after the end and median width in "
        "lives at 20/40/60/80 % of life",
        "law | held, % | begins after it, % | width | as stated: held, % | begins after it, % | width",
        rows,
    )


def rig_lives(count: int, seed: int) -> list[tuple[Callable[[float], float], float]]:
    """Mean COF over the share of life of clutches around the nominal one, and their end of life."""
    found = []
    for index in range(count):
        clutch = draw(np.random.default_rng([seed, index]))
        end = clutch.end_of_life()
        if end is not None:
            fresh = clutch.mean_cof(0.0)
            found.append((lambda x, c=clutch, e=end, f=fresh: c.mean_cof(x * e) / f, end))
    return found


def never(count: int, seed: int) -> str:
    """Lives from the prior, whether they ever reach half of their COF or not: is the stated probability right? Once for
    lives of eq. 6 alone, and once for lives of all that is believed: some with a discrepancy or a knee, some runs
    outlying."""
    found = {"eq. 6 alone": stated(count, seed, whole=False), "the whole prior": stated(count, seed + 100, whole=True)}
    shares = ", ".join(f"{100 * np.mean(came):.0f} % of those of {name}" for name, (_, came) in found.items())
    edges, rows = np.array([0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0 + 1e-9]), []
    for low, high in itertools.pairwise(edges.tolist()):
        cells = [f"{low:.2f} to {min(high, 1.0):.2f}"]
        for told, came in found.values():
            here = (told >= low) & (told < high)
            due = math.sqrt(float((told[here] * (1.0 - told[here])).mean()) / max(1, int(here.sum())))
            mean, share = 100 * told[here].mean(), 100 * came[here].mean()
            cells += [str(here.sum()), f"{mean:.1f} ± {100 * due:.1f}", f"{share:.1f}"]
        rows.append(cells)
    return written(
        f"{count} lives each, seeds {seed} and {seed + 100}; half of the COF is reached within a million cycles by "
        f"{shares}; no prediction was infinite",
        "stated probability | " + " | ".join(f"{name}: lives | mean stated, % | reached it, %" for name in found),
        rows,
    )


def stated(count: int, seed: int, *, whole: bool, believed: TrackPrior = PRIOR) -> tuple[np.ndarray, np.ndarray]:
    """The probability stated for each of `count` lives [n] by a prior, and whether it came [n]."""
    rng, told, came, grid = np.random.default_rng(seed), [], [], Grid()
    while len(told) < count:
        truth = TrackPosterior(
            weight=np.ones(1),
            initial=rng.normal(PRIOR.initial_mean, PRIOR.initial_sd, 1),
            change=rng.normal(PRIOR.change_mean, PRIOR.change_sd, 1),
            scale=np.exp(rng.normal(PRIOR.log_scale_mean, PRIOR.log_scale_sd, 1)),
            exponent=np.exp(rng.normal(PRIOR.log_exponent_mean, PRIOR.log_exponent_sd, 1)),
            scatter=np.exp(rng.normal(PRIOR.log_scatter_mean, PRIOR.log_scatter_sd, 1)),
        )
        last, runs = math.exp(rng.uniform(math.log(300.0), math.log(30_000.0))), int(rng.integers(4, 20))
        if truth.initial[0] <= 0.0:
            continue
        noise = truth.scatter * rng.standard_normal(runs)
        if whole:
            form = rng.choice(FORM_SIZE.size, p=np.exp(log_form_weight(PRIOR)))
            size, course = FORM_SIZE[form], FORM_COURSE[[form]]
            scale, exponent = coefficients_at(np.log(truth.scale), np.log(truth.exponent), course)
            if scale[0] < 0.0 and -scale[0] <= last:  # ended before it was measured
                continue
            truth = replace(truth, change=truth.change / UNIT_OF_CHANGE[course], scale=scale, exponent=exponent)
            course = size * PRIOR.size * rng.standard_normal((1, PAST + FUTURE))
            unworn = truth.initial[0] - truth.values(np.array([last]))[0, 0] < UNSEEN_WEAR * truth.initial[0]
            times = (1.0 - rng.random()) ** (-1.0 / KNEE_HAZARD)
            knee = size > 0.0 or (unworn and times < KNEE_REACH)
            beside = CourseDiscrepancy(
                span=last,
                size=np.full(1, size),
                curvature=course,
                at=np.zeros(0),
                height=np.zeros((1, 0)),
                knee=np.full(1, last * times if knee else np.inf),
                steepening=KNEE_PACE * np.exp(LOG_KNEE_PACE_SD * rng.standard_normal(1)),
            )
            truth = replace(truth, discrepancy=beside)
            if FORM_PROPORTIONAL[form]:
                noise *= np.abs(truth.values(np.linspace(0.0, last, runs))[:, 0]) / PRIOR.size
            outlying = rng.random(runs) < PRIOR.outlying_share
            noise += outlying * PRIOR.outlying_size * PRIOR.size * rng.standard_normal(runs)
        zeta = np.linspace(0.0, last, runs)
        values = truth.values(zeta)[:, 0] + noise
        drawn = grid.posterior(grid.from_history(believed, sent(zeta, values)), 1_000, rng)
        passage = predict_first_passage(drawn, fraction=0.5, as_of=last)
        assert all(x is None or math.isfinite(x) for x in passage.end_of_life.values())
        told.append(passage.probability_of_reaching)
        came.append(float(ends_of_life(truth, 0.5)[0]) <= CAP)
    return np.array(told), np.array(came)


def after_event(count: int, seed: int) -> str:
    """An oil change at half of life that shifts the level by a normal 5 %: the width of the forecast, and coverage, by
    the number of tests since, with the event made known to the filter and without."""
    tallies: dict[tuple[bool, int], list[tuple[bool, float]]] = {}
    grid, law = Grid(), LAWS["one eq. 6 (Δ = -0.75, ε = 0.8)"]
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        shift = 0.05 * rng.standard_normal()
        share = np.linspace(0.0, 0.75, 16)
        level = np.array([law(x) for x in share.tolist()]) + shift * (share > 0.5)
        values = 0.1 * level * (1 + 0.003 * rng.standard_normal(16))
        fine = np.linspace(0.5, 20.0, 20_000)
        below = np.flatnonzero(np.array([law(x) for x in fine.tolist()]) + shift <= 0.5)
        end = 10_000.0 * fine[below[0]] if below.size else math.inf
        for known in (True, False):
            seen = [
                Measurement(progress=1e4 * x, value=y, variance=1e-8, epoch=int(known and x > 0.5))
                for x, y in zip(share.tolist(), values.tolist(), strict=True)
            ]
            for since in (1, 2, 5):
                some = seen[: 11 + since]
                posterior = grid.posterior(grid.from_history(weak(some[0], falling=True), some), 1_000, rng)
                found = predict_first_passage(posterior, fraction=0.5, as_of=some[-1].progress).end_of_life
                low, high = found[0.05] or math.inf, found[0.95] or math.inf
                tallies.setdefault((known, since), []).append((low <= end <= high, min(high, CAP) - min(low, CAP)))
    rows = []
    for (known, since), told in tallies.items():
        held, width = np.array(told, dtype=float).T
        rows.append(("known" if known else "not known", since, f"{100 * held.mean():.0f}", f"{np.median(width):.0f}"))
    return written(
        f"{count} lives, seed {seed}",
        "the event is | tests since | 90 % interval holds the truth, % | median width, cycles",
        rows,
    )
