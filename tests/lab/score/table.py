"""Scores of predictions by stage of life, and how they are written down."""

import math
from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from models.prognosis.criteria import HORIZON
from models.prognosis.ended_lives import ObservedLife
from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.scoring import pit_histogram
from models.prognosis.stated_end import stated_end
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from tests.lab.measuring import table
from tests.models.prognosis.sample_scores import crps_of_sample, pit_of_sample
from tests.statistical.lives import STAGES, ends

#: All stages together, then each alone.
EVERY = (STAGES, *((stage,) for stage in STAGES))


@dataclass(frozen=True)
class Score:
    """One prediction: CRPS as a share of the life and of the logarithm of the end, median and width of the 90 % interval as
    shares of the life, whether it held, began after the truth or ended before it, and the truth's place in it."""

    crps: float
    log_crps: float
    median: float
    width: float
    held: bool
    late: bool
    early: bool
    pit: float


def score(sample: np.ndarray, weight: np.ndarray, end: float) -> Score:
    low, median, high = weighted_quantiles(sample, weight, (0.05, 0.5, 0.95)).tolist()
    return Score(
        crps=crps_of_sample(sample, weight, end) / end,
        log_crps=crps_of_sample(np.log(np.maximum(sample, 1.0)), weight, math.log(end)),
        median=median / end,
        width=(high - low) / end,
        held=low <= end <= high,
        late=low > end,
        early=high < end,
        pit=pit_of_sample(sample, weight, end),
    )


def score_of_stated(
    drawn: TrackPosterior, seen: Sequence[Measurement], ended: Sequence[ObservedLife], end: float
) -> Score:
    """The score of what is stated after the tests seen, with ended lives of the kind."""
    now = seen[-1].progress
    stated = stated_end(drawn, fraction=0.5, as_of=now, horizon=HORIZON, ended=ended, tests=seen)
    return score(np.minimum(stated.ends, HORIZON), stated.weight, end)


@dataclass
class Scores:
    """Scores by who predicted and at what stage."""

    kept: dict[tuple[Hashable, float], list[Score]] = field(default_factory=lambda: defaultdict(list))

    def add(self, name: Hashable, stage: float, posterior: TrackPosterior, end: float) -> None:
        self.add_sample(name, stage, ends(posterior), posterior.weight, end)

    def add_sample(self, name: Hashable, stage: float, sample: np.ndarray, weight: np.ndarray, end: float) -> None:
        self.kept[name, stage].append(score(sample, weight, end))

    def column(self, name: Hashable, stage: float, what: str) -> np.ndarray:
        return np.array([getattr(each, what) for each in self.kept[name, stage]], dtype=float)

    def means(self, name: Hashable, what: str, stages: Sequence[float] = STAGES) -> list[float]:
        return [float(self.column(name, stage, what).mean()) for stage in stages]

    def medians(self, name: Hashable, what: str) -> list[float]:
        return [float(np.median(self.column(name, stage, what))) for stage in STAGES]

    def ratio(
        self, name: Hashable, other: Hashable, stages: Sequence[float] = STAGES, what: str = "crps"
    ) -> np.ndarray:
        """The ratio of mean scores, and its standard error by the jackknife over lives [2]."""
        ours = np.sum([self.column(name, stage, what) for stage in stages], axis=0)
        theirs = np.sum([self.column(other, stage, what) for stage in stages], axis=0)
        left = (ours.sum() - ours) / (theirs.sum() - theirs)
        return np.array([ours.sum() / theirs.sum(), left.std() * np.sqrt(max(ours.size - 1, 1))])

    def typical_ratio(self, name: Hashable, other: Hashable, stage: float, what: str) -> float:
        """The median of the ratios, life by life."""
        return float(np.median(self.column(name, stage, what) / self.column(other, stage, what)))

    def histogram(self, name: Hashable) -> str:
        pits = np.concatenate([self.column(name, stage, "pit") for stage in STAGES])
        return percents(pit_histogram(pits.tolist()))


def joined(form: str, numbers: Iterable[float]) -> str:
    """The numbers of all stages in one cell."""
    return "/".join(form.format(number) for number in numbers)


def percents(shares: Iterable[float]) -> str:
    return joined("{:.0f}", (100 * share for share in shares))


def written(head: str, titles: str, rows: Iterable[Sequence[object]]) -> str:
    """A part's sentence and table; `titles` with bars between them."""
    return "\n".join([head, "", *table(titles.split(" | "), rows)])
