"""`make rivals`: plain rivals beside our filters on seven laws of degradation, with intervals over lives.

SIZE= scales the number of lives    SEED= other lives (2026)    ARGS=--write puts the tables into docs/appendix/prognosis.md
"""

import math
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from models.prognosis.first_passage import weighted_quantiles
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.prior import TrackPrior, weak
from tests.lab.measuring import Asked, publish, table
from tests.lab.rivals.plain import DRAWS, Ibis, LiuWest, PlainUkf, Sample, fitted
from tests.models.prognosis.sample_scores import crps_of_sample
from tests.statistical.forecasts import LAWS, SCATTER, TESTS, observed
from tests.statistical.lives import CAP, STAGES, ends

END = 10_000.0
STARTS = 8


class Ours:
    """One of our filters, carried on test by test."""

    def __init__(self, tracker: Any, prior: TrackPrior, rng: np.random.Generator) -> None:
        self.tracker, self.state, self.rng = tracker, tracker.start(prior), rng

    def update(self, measurement: Any) -> None:
        self.state = self.tracker.update(self.state, measurement, self.rng)

    def sample(self) -> Sample:
        posterior = self.tracker.posterior(self.state, DRAWS, self.rng)
        return ends(posterior), posterior.weight


class Fit:
    """A fit of all tests so far whenever a distribution is asked for."""

    def __init__(self, prior: TrackPrior, rng: np.random.Generator, starts: int) -> None:
        self.prior, self.rng, self.starts, self.seen = prior, rng, starts, list[Any]()

    def update(self, measurement: Any) -> None:
        self.seen.append(measurement)

    def sample(self) -> Sample:
        return fitted(self.seen, self.prior, self.rng, starts=self.starts)


def methods(prior: TrackPrior, scatter: float, rng: np.random.Generator) -> dict[str, Any]:
    """Every method at its start, by name. Those of eq. 6 alone know no other law, as the rivals."""
    alone = replace(prior, eq_6_share=1.0, law_share=1.0, outlying_share=0.0, proportional_share=0.0, knee_hazard=0.0)
    return {
        "`grid`": Ours(Grid(), prior, rng),
        "`particle`": Ours(Particle(), prior, rng),
        "`ukf`": Ours(Ukf(), prior, rng),
        "`grid`, eq. 6 alone": Ours(Grid(), alone, rng),
        "`particle`, eq. 6 alone": Ours(Particle(), alone, rng),
        "numpy IBIS": Ibis(prior, rng),
        "numpy Liu and West": LiuWest(prior, rng),
        "filterpy UKF, scatter given": PlainUkf(prior, scatter, rng),
        "scipy `curve_fit`, one start": Fit(prior, rng, 1),
        f"scipy `curve_fit`, {STARTS} starts": Fit(prior, rng, STARTS),
    }


class Tally:
    """By method: its times, how often it failed, and by law the mean CRPS and the share held of each life."""

    def __init__(self) -> None:
        self.update: dict[str, list[float]] = defaultdict(list)
        self.whole: dict[str, list[float]] = defaultdict(list)
        self.failed: dict[str, int] = defaultdict(int)
        self.crps: dict[tuple[str, str], list[float]] = defaultdict(list)
        self.held: dict[tuple[str, str], list[float]] = defaultdict(list)

    def life(self, law: str, course: Callable[[float], float], seed: list[int]) -> None:
        measurements = observed(course, np.random.default_rng(seed), END)
        prior = weak(measurements[0], falling=True)
        stages = {round(stage / 0.8 * (TESTS - 1)) for stage in STAGES[1:]}
        for name, method in methods(prior, SCATTER * measurements[0].value, np.random.default_rng([*seed, 1])).items():
            crps, held = [], []
            for index, measurement in enumerate(measurements):
                begun = time.process_time()
                method.update(measurement)
                self.update[name].append(time.process_time() - begun)
                if index in stages:
                    score = self._scored(name, method)
                    crps.append(score[0])
                    held.append(score[1])
            self.crps[name, law].append(float(np.mean(crps)))
            self.held[name, law].append(float(np.mean(held)))

    def _scored(self, name: str, method: Any) -> tuple[float, float]:
        """CRPS in lives, and whether the 90 % interval holds the end. What cannot be had counts as never."""
        begun = time.process_time()
        try:
            found, weight = method.sample()
        except (ValueError, RuntimeError, np.linalg.LinAlgError):
            self.failed[name] += 1
            found, weight = np.array([CAP]), np.ones(1)
        self.whole[name].append(time.process_time() - begun)
        found = np.nan_to_num(found, nan=CAP)
        low, high = weighted_quantiles(found, weight, (0.05, 0.95))
        return crps_of_sample(found, weight, END) / END, float(low <= END <= high)

    def tables(self) -> list[str]:
        titles = ["method", *LAWS]
        names = list(self.update)
        crps = [(name, *(_interval(self.crps[name, law], "{:.2f}") for law in LAWS)) for name in names]
        held = [(name, *(_interval(self.held[name, law], "{:.0f}", 100.0) for law in LAWS)) for name in names]
        times = [
            (name, *(f"{1e3 * np.mean(taken[name]):.2g}" for taken in (self.update, self.whole)), self.failed[name])
            for name in names
        ]
        return [
            *["CRPS in lives, mean ± 1.96 standard errors over lives:", "", *table(titles, crps), ""],
            *["Ends held by the 90 % interval, %, the same:", "", *table(titles, held), ""],
            *table(["method", "update, ms", "distribution, ms", "failed"], times),
        ]


def _interval(by_life: list[float], form: str, factor: float = 1.0) -> str:
    error = 1.96 * float(np.std(by_life, ddof=1)) / math.sqrt(len(by_life))
    return f"{form.format(factor * float(np.mean(by_life)))} ± {form.format(factor * error)}"


def main() -> None:
    asked, tally = Asked.here("full", 2026), Tally()
    count = max(4, round(100 * asked.size))
    for number in range(count):
        for law, course in LAWS.items():
            tally.life(law, course, [asked.seed, number])
    head = (
        f"`make rivals SIZE={asked.size:g} SEED={asked.seed}`: {count} lives a law, {TESTS} tests up to 80 % of life, "
        f"{100 * SCATTER:g} % scatter, at 40, 60 and 80 % of life; times of the processor, means"
    )
    publish("prognosis.md", "score rivals laws", [head, "", *tally.tables()])


if __name__ == "__main__":
    main()
