"""`make rivals`: the same lives predicted by other packages of prognosis, in one run: CRPS and time beside ours. What numpy
and scipy give without them is in `laws`.

SIZE= scales the number of lives    SEED= other lives (2026)    ARGS=--write puts the table into docs/appendix/prognosis.md
"""

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.prior import weak
from tests.lab.measuring import Asked, publish, table
from tests.lab.rivals.others import Progpy, Surpyval
from tests.lab.rivals.plain import DRAWS, Sample
from tests.models.prognosis.sample_scores import crps_of_sample
from tests.statistical.lives import CAP, STAGES, ends, typical

#: Inspections in a life, and the scatter of each as a share of COF when new.
INSPECTIONS, SCATTER = 60, 0.01
#: Of so many lives progpy simulates its own distribution, for the time that it takes.
SIMULATED = 1
PACKAGES = ("numpy", "progpy", "surpyval", "scipy")


class Tally:
    def __init__(self) -> None:
        self.crps: dict[str, list[float]] = defaultdict(list)
        self.update: dict[str, list[float]] = defaultdict(list)
        self.whole: dict[str, list[float]] = defaultdict(list)
        self.failed: dict[str, int] = defaultdict(int)

    def scored(self, name: str, sample: Callable[[], Sample], end: float) -> None:
        """A distribution's time and score; one that cannot be had counts as never."""
        begun = time.process_time()
        try:
            found, weight = sample()
        except (ValueError, RuntimeError, np.linalg.LinAlgError):
            self.failed[name] += 1
            found, weight = np.array([CAP]), np.ones(1)
        self.whole[name].append(time.process_time() - begun)
        self.crps[name].append(crps_of_sample(np.nan_to_num(found, nan=CAP), weight, end) / end)

    def carried(self, name: str, update: Callable[[], Any]) -> Any:
        """An update's time and what it leads to."""
        begun = time.process_time()
        try:
            return update()
        except (ValueError, np.linalg.LinAlgError):
            self.failed[name] += 1
            return None
        finally:
            self.update[name].append(time.process_time() - begun)

    def table(self) -> list[str]:
        mean, middle = float(np.mean(self.crps["`grid`"])), float(np.median(self.crps["`grid`"]))
        rows = []
        for name in self.whole:
            scores = ["-"] * 3
            if column := self.crps[name]:
                scores = [
                    f"{np.mean(column):.3f}",
                    f"{np.mean(column) / mean:.2f}",
                    f"{np.median(column) / middle:.2f}",
                ]
            times = (
                f"{1e3 * np.median(each[name]):.3g}" if name in each else "-" for each in (self.update, self.whole)
            )
            rows.append((name, *scores, *times, self.failed[name]))
        titles = (
            "method | CRPS, mean, lives | over `grid`'s | median over `grid`'s | update, ms | distribution, ms | failed"
        )
        return table(titles.split(" | "), rows)


def sampled(tracker: Any, state: Any, rng: np.random.Generator) -> Sample:
    posterior = tracker.posterior(state, DRAWS, rng)
    return ends(posterior), posterior.weight


def compared(count: int, seed: int) -> tuple[Tally, int]:
    """Lives like the reference's, predicted at 40, 60 and 80 % by every method."""
    tally = Tally()
    lives = [replace(life, scatter=SCATTER * life.truth.initial) for life, _ in typical(count, seed)]
    for number, life in enumerate(lives):
        rng = np.random.default_rng([seed, number])
        measurements = life.measured(0.8, round(0.8 * INSPECTIONS) + 1, rng)
        prior, gap = weak(measurements[0], falling=True), measurements[1].progress
        ours: dict[str, tuple[Any, Any]] = {
            f"`{tracker.name}`": (tracker, tracker.start(prior)) for tracker in (Grid(), Particle(), Ukf())
        }
        theirs = {
            "progpy `UnscentedKalmanFilter`": Progpy("UnscentedKalmanFilter", prior, life.scatter, gap, rng),
            "progpy `ParticleFilter`": Progpy("ParticleFilter", prior, life.scatter, gap, rng),
        }
        unit = Surpyval(prior, life.scatter)
        for index, measurement in enumerate(measurements):
            for name, (tracker, state) in ours.items():
                ours[name] = (tracker, tally.carried(name, partial(tracker.update, state, measurement, rng)))
            for name, rival in theirs.items():
                tally.carried(name, partial(rival.update, measurement, index))
            if index + 1 not in [round(stage * INSPECTIONS) + 1 for stage in STAGES[1:]]:
                continue
            for name, (tracker, state) in ours.items():
                tally.scored(name, partial(sampled, tracker, state, rng), life.end)
            for name, rival in theirs.items():
                tally.scored(name, partial(rival.sample, rng), life.end)
                if number < SIMULATED and isinstance(rival, Progpy):
                    begun = time.process_time()
                    rival.simulated()
                    tally.whole[f"{name} and `MonteCarlo`, its own simulation"].append(time.process_time() - begun)
            seen = measurements[: index + 1]
            tally.scored("surpyval `predict_rul`", partial(unit.sample, seen, rng), life.end)
    return tally, len(lives)


def main() -> None:
    asked = Asked.here("full", 2026)
    np.random.seed(asked.seed)  # noqa: NPY002 # progpy draws from the global generator
    tally, done = compared(max(4, round(40 * asked.size)), asked.seed)
    releases = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    head = (
        f"{done} lives like the reference's, {INSPECTIONS} inspections in a life, {100 * SCATTER:.0f} % scatter, at 40, 60 "
        f"and 80 % of life, seed {asked.seed}; {releases}"
    )
    command = f"`make rivals SIZE={asked.size:g} SEED={asked.seed}`"
    publish("prognosis.md", "score rivals", [f"{command}: {head}", "", *tally.table()])


if __name__ == "__main__":
    main()
