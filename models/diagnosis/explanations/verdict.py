"""Alternatives, verdict, explanations and judgement, as values; `posterior` weighs the first, `decide` makes the others.

An alternative is a set of catalogued causes, and at most one thing beside them that has no name.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from models.diagnosis.design.design import CLOCK, CYCLES, FREQUENCY
from models.diagnosis.effects.faults import FAULT_BY_SLUG
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.pooled_fit.gauss_newton import PooledFit
from models.diagnosis.raw_records.evidence import FIXED_LINE

#: A line over the tests' clock; lines, with the axes on which they lie. One run that is not like the others.
LINE = "line"
LINES = {LINE: CLOCK, FIXED_LINE: FREQUENCY}
OUTLIER = "outlying run"
_AXES = {**LINES, OUTLIER: CYCLES}


class Alternative(NamedTuple):
    """A set of causes, slugs in alphabetical order, and at most one unknown beside them: an axis of structure
    (`design.design`), the slug of an uncatalogued fault, a line, an outlying run, or nothing (empty)."""

    causes: tuple[str, ...] = ()
    unknown: str = ""

    @property
    def named(self) -> tuple[str, ...]:
        """Slugs of the causes, and of the uncatalogued fault if there is one."""
        return (*self.causes, *((self.unknown,) if self.unknown in FAULT_BY_SLUG else ()))

    def and_effect(self, slug: str) -> "Alternative | None":
        """The alternative with one effect more, a cause or an uncatalogued fault; None where the list has no such
        alternative."""
        if len(self.causes) > 1 or self.unknown or slug in self.causes:
            return None
        if slug in FAULT_BY_SLUG:
            return Alternative(self.causes, slug)
        return Alternative(tuple(sorted((*self.causes, slug))))

    def without(self, slug: str) -> "Alternative":
        """The alternative without one effect."""
        return Alternative(tuple(c for c in self.causes if c != slug), "" if self.unknown == slug else self.unknown)


NOTHING = Alternative()


def is_axis(unknown: str) -> bool:
    """Whether an alternative's unknown part is smooth structure on an axis."""
    return bool(axis_of(unknown)) and axis_of(unknown) == unknown


def axis_of(unknown: str) -> str:
    """The axis on which an alternative's unknown part lies; empty where there is none."""
    if unknown in FAULT_BY_SLUG:
        return FAULT_BY_SLUG[unknown].axis
    return _AXES.get(unknown, unknown)


class Verdict(StrEnum):
    """The possible answers of a diagnosis: nothing beyond noise, these causes, one of several causes, structure without
    a name, too little data."""

    MODEL_ADEQUATE = "model_adequate"
    CAUSE_NAMED = "cause_named"
    CAUSE_AMBIGUOUS = "cause_ambiguous"
    UNEXPLAINED_STRUCTURE = "unexplained_structure"
    INSUFFICIENT_DATA = "insufficient_data"


#: Stands for something that no effect of the catalogue is.
UNCATALOGUED = "uncatalogued"


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """One of the mutually exclusive explanations, with its probability."""

    effects: tuple[str, ...]  # slugs of those at work (UNCATALOGUED among them), or none
    probability: float  # that these and no others are
    sign_probability: float | None = None  # that the estimated amplitudes have the right signs; None where nothing was


def probabilities_by_slug(explanations: Iterable[Explanation]) -> dict[str, float]:
    """The probability that each effect of the catalogue is at work, alone or beside others; largest first, by slug where
    they are equal."""
    shares: dict[str, float] = {}
    for explanation in explanations:
        for slug in set(explanation.effects) - {UNCATALOGUED}:
            shares[slug] = min(shares.get(slug, 0.0) + explanation.probability, 1.0)
    return dict(sorted(shares.items(), key=lambda item: (-item[1], item[0])))


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """An axis on which structure lies (`design.design`), and the evidence of it [nats]."""

    axis: str
    strength: float

    @property
    def p_value(self) -> float:
        """Upper bound e^-strength of the p-value: a likelihood ratio of `strength` nats is at most as probable by
        chance."""
        return float(np.exp(-np.clip(self.strength, 0.0, 700.0)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """Causes that were fitted together."""

    slugs: tuple[str, ...]  # in the order of the fit's effects
    fit: PooledFit
    evidence: float  # [nats] over nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """The verdict, the explanations it is read off, and the fits behind them."""

    verdict: Verdict
    causes: tuple[str, ...] = ()
    explanations: tuple[Explanation, ...] = ()  # that it is read off, most probable first
    stand: tuple[Fitted, ...] = ()  # the causes that stand, best first
    others: tuple[Fitted, ...] = ()
    where: tuple[Where, ...] = ()  # the axes on which structure lies, most evidence first
    left: tuple[Where, ...] = ()  # the same beside the best that stands
    likest: FittedEffect | None = None  # the fault that is the likeliest of all that has no name, if one is
    evidence: Mapping[str, float]  # [nats] by slug of effects alone

    @property
    def probabilities(self) -> dict[str, float]:
        """The probability of each effect of the catalogue, largest first."""
        return probabilities_by_slug(self.explanations)
