"""Which course the data speak for: ageing as eq. 6, slowing down otherwise, or accelerating, each with its probability.

The rate of a course of general order (`models.tracking.courses`) changes as (1 + ζ/φ)^-(ε + 1): it falls where (ε + 1)/φ is
positive and grows where it is negative.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from models.prognosis.first_passage import weighted_quantiles
from models.tracking.courses import CourseForm
from models.tracking.posterior import TrackPosterior


class CourseName(StrEnum):
    """The names of the kinds of course; eq. 6's levels off, with an order above 1."""

    EQ_6 = "eq6"
    SLOWING = "slowing"
    ACCELERATING = "accelerating"


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseProbability:
    """A kind of course, its probability, and the median order n = 1 + 1/ε [-] of its kinetics; None for a logarithm
    alone, which has no order."""

    name: CourseName
    probability: float
    order: float | None


def course_shares(posterior: TrackPosterior) -> list[CourseProbability]:
    """The kinds of course of non-zero probability, most probable first."""
    accelerates = (posterior.exponent + 1.0) / posterior.scale < 0.0
    kinds = {
        CourseName.EQ_6: posterior.course == CourseForm.EQ_6,
        CourseName.SLOWING: (posterior.course != CourseForm.EQ_6) & ~accelerates,
        CourseName.ACCELERATING: (posterior.course != CourseForm.EQ_6) & accelerates,
    }
    shares = []
    for name, kinds_here in kinds.items():
        probability = float(posterior.weight[kinds_here].sum())
        if probability > 0.0:
            shares.append(
                CourseProbability(name=name, probability=min(probability, 1.0), order=_order(posterior, kinds_here))
            )
    return sorted(shares, key=lambda share: share.probability, reverse=True)


def _order(posterior: TrackPosterior, here: NDArray[np.bool_]) -> float | None:
    """The median order 1 + 1/ε of the draws of these courses; None if none has an order."""
    ordered = here & (posterior.course != CourseForm.LOGARITHM)
    if not posterior.weight[ordered].any():
        return None
    return float(weighted_quantiles(1.0 + 1.0 / posterior.exponent[ordered], posterior.weight[ordered], (0.5,))[0])
