"""Scores of predictions by stage of life, and how they are written down."""

import math
from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np

from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.scoring import crps_of_sample, pit_histogram, pit_of_sample
from models.tracking.posterior import Posterior
from tests.statistical.lives import ends


@dataclass(frozen=True)
class Score:
    """One prediction: CRPS as a share of the life and of the logarithm of the end, the width of the 90 % interval as a
    share of the life, whether it held, whether it began after the truth, and the truth's place in it."""

    crps: float
    log_crps: float
    width: float
    held: bool
    late: bool
    pit: float


def score(sample: np.ndarray, weight: np.ndarray, end: float) -> Score:
    low, high = weighted_quantiles(sample, weight, (0.05, 0.95)).tolist()
    return Score(
        crps=crps_of_sample(sample, weight, end) / end,
        log_crps=crps_of_sample(np.log(np.maximum(sample, 1.0)), weight, math.log(end)),
        width=(high - low) / end,
        held=low <= end <= high,
        late=low > end,
        pit=pit_of_sample(sample, weight, end),
    )


@dataclass
class Scores:
    """Scores by who predicted and at what stage."""

    kept: dict[tuple[str, float], list[Score]] = field(default_factory=lambda: defaultdict(list))

    def add(self, name: str, stage: float, posterior: Posterior, end: float) -> None:
        self.add_sample(name, stage, ends(posterior), posterior.weight, end)

    def add_sample(self, name: str, stage: float, sample: np.ndarray, weight: np.ndarray, end: float) -> None:
        self.kept[name, stage].append(score(sample, weight, end))

    def column(self, name: str, stage: float, what: str) -> np.ndarray:
        return np.array([getattr(each, what) for each in self.kept[name, stage]], dtype=float)

    def ratio(self, name: str, other: str, stages: tuple[float, ...], what: str = "crps") -> tuple[float, float]:
        """The ratio of mean scores, and its standard error by the jackknife over lives."""
        ours = np.sum([self.column(name, stage, what) for stage in stages], axis=0)
        theirs = np.sum([self.column(other, stage, what) for stage in stages], axis=0)
        left = (ours.sum() - ours) / (theirs.sum() - theirs)
        return float(ours.sum() / theirs.sum()), float(left.std() * np.sqrt(max(ours.size - 1, 1)))

    def typical_ratio(self, name: str, other: str, stage: float, what: str) -> float:
        """The median of the ratios, life by life."""
        return float(np.median(self.column(name, stage, what) / self.column(other, stage, what)))

    def histogram(self, name: str, stages: tuple[float, ...]) -> str:
        pits = np.concatenate([self.column(name, stage, "pit") for stage in stages])
        return "/".join(f"{100 * share:.0f}" for share in pit_histogram(pits.tolist()))


def percents(numbers: list[float]) -> str:
    return "/".join(f"{100 * number:.0f}" for number in numbers)


def shares(numbers: list[float]) -> str:
    return " | ".join(f"{100 * number:.1f}" for number in numbers)
