"""One trial: a campaign whose law is not eq. 3 is diagnosed, and what was said stands beside what was true."""

from dataclasses import dataclass
from time import process_time

import numpy as np

from models.diagnosis.diagnose import diagnose
from models.diagnosis.explanations.verdict import Verdict
from tests.lab.law.worlds import FORMULAS, World, of_curves, of_formula

#: From this probability on a cause that is not there is a false one.
FALSE = 0.9


@dataclass(frozen=True)
class Said:
    """What a diagnosis said of a world."""

    kind: str
    seed: int
    cause: str | None
    verdict: str
    causes: list[str]
    probabilities: dict[str, float]
    like_the_law: list[str]
    size_right: bool | None  # whether the hidden cause's size has the right sign
    law_percent: float  # rms of the law's discrepancy
    seconds: float  # of one core

    @property
    def adequate(self) -> bool:
        return self.verdict == Verdict.MODEL_ADEQUATE

    @property
    def in_set(self) -> bool:
        """Whether the hidden cause is among those that the report gives."""
        return self.cause in self.causes

    @property
    def named_wrongly(self) -> bool:
        """Whether a cause is named that is not there."""
        return self.verdict == Verdict.CAUSE_NAMED and set(self.causes) != {self.cause}

    @property
    def falsely_sure(self) -> bool:
        """Whether a cause that is not there is named or has a probability of FALSE."""
        return self.named_wrongly or any(p >= FALSE for slug, p in self.probabilities.items() if slug != self.cause)


def world_of(kind: str, seed: int) -> World:
    """The world of a kind: a formula's name, or what `of_curves` knows."""
    return of_formula(kind, seed) if kind in FORMULAS else of_curves(kind, seed)


def diagnosed(job: tuple[str, int]) -> Said:
    """The diagnosis of the campaign of a kind and a seed."""
    kind, seed = job
    world, begun = world_of(kind, seed), process_time()
    report = diagnose(world.campaign, rng=np.random.default_rng(seed))
    seconds = process_time() - begun
    sizes = {c.effect: c.estimate.value for c in report.candidates if c.estimate.value != 0.0}
    sign = sizes.get(world.cause or "")
    return Said(
        kind=kind,
        seed=seed,
        cause=world.cause,
        verdict=str(report.verdict),
        causes=list(report.causes),
        probabilities={c.effect: c.probability for c in report.candidates},
        like_the_law=list(report.like_the_law),
        size_right=None if sign is None else bool(np.sign(sign) == np.sign(world.size)),
        law_percent=0.0 if report.friction_law is None else report.friction_law.rms_percent,
        seconds=seconds,
    )
