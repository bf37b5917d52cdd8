"""The assumptions of a prediction: what counts as use, the prior, and what an adopted model adds.

Every prediction is made under assumptions, and every answer names its model, its prior and its severity.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np

from models.arrays import FloatArray
from models.degradation.severity import IDENTITY, Block, Severity, SeverityBasis, SeverityMap, severity_map
from models.prognosis.ended_lives import ObservedLife
from models.prognosis.fleet import FleetPrior
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior, weak
from service.api.clutch import ClutchIn
from service.api.fleet import Kind
from service.api.life import ModelName, PriorName, SeverityName

MEAN_COF: Final = "mean_cof"
#: The mean over the reference pressures stands under this pressure [Pa].
ALL_PRESSURES = 0.0

#: The priors of a series, by name: always the first, the second where a fleet has taught one.
WEAK: Final = "weak"
FLEET: Final = "fleet"
WEAK_PRIOR = PriorName(name=WEAK, version=None, clutches=0)
BASELINE = ModelName(name="baseline", effects=[])

#: Mean COF [d, m] that an adopted model's effects add under each of its draws at cycles since new [m], at a pressure [Pa] or
#: ALL_PRESSURES.
AddedCourse: TypeAlias = Callable[[FloatArray, float], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelInForce:
    """The model in force: its name in answers, the weights of its draws, its added course of mean COF (None: eq. 6
    alone), the exponent of an adopted load severity, and sentences on its corrections of measurements."""

    name: ModelName = BASELINE
    weights: tuple[float, ...] = (1.0,)
    course: AddedCourse | None = None
    severity_exponent: float | None = None
    corrected: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedPrior:
    """The prior learned from a fleet (None: the weak one alone), the fleet's ended lives, and the prior's name in
    answers."""

    fleet: FleetPrior | None = None
    ended: tuple[ObservedLife, ...] = ()
    name: PriorName = WEAK_PRIOR


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """The conversion between cycles since new and ζ, for a life that begins at `origin`."""

    origin: float
    severity: SeverityMap = IDENTITY

    def progress(self, cycles: FloatArray | float) -> FloatArray:
        """ζ at cycles since new, of any shape; 0 before the origin."""
        return self.severity.progress(np.maximum(np.asarray(cycles) - self.origin, 0.0))

    def cycles(self, progress: FloatArray | float) -> FloatArray:
        """Cycles since new at ζ; the inverse."""
        return self.origin + self.severity.cycles_at(progress)


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumptions:
    """The assumptions of tracking: the severity measure that ζ counts, the fleet's prior beside the weak one, and the
    model in force.

    The model's course is taken off measured mean COF before eq. 6 is tracked, and put back to look for the threshold.
    """

    severity: Severity = field(default_factory=Severity)
    prior: LearnedPrior = field(default_factory=LearnedPrior)
    model: ModelInForce = field(default_factory=ModelInForce)

    @property
    def counts_cycles(self) -> bool:
        """Whether ζ counts plain cycles, irrespective of duty."""
        return self.severity.basis is SeverityBasis.CYCLES

    def scale(self, origin: float, blocks: Sequence[Block]) -> Scale:
        """The scale between cycles since new and ζ of a life that began at `origin`, from its blocks of duty."""
        since = [] if self.counts_cycles else [block.since(origin) for block in blocks if block.end > origin]
        return Scale(origin=origin, severity=severity_map(self.severity, since))

    def priors(self, quantity: str, first: Measurement, scale: Scale) -> dict[str, TrackPrior]:
        """The priors of a series by name, scaled to its first measurement."""
        fleet = self.prior.fleet
        if fleet is None or quantity != MEAN_COF:
            return {WEAK: weak(first, falling=quantity == MEAN_COF)}
        return {WEAK: weak(first, falling=True), FLEET: fleet.in_unit(scale.severity.unit).prior_for(first)}

    def weighted_priors(self, quantity: str, first: Measurement, scale: Scale) -> tuple[tuple[float, TrackPrior], ...]:
        """The priors of a series, each with its prior probability."""
        priors, fleet = self.priors(quantity, first, scale), self.prior.fleet
        share = 0.0 if fleet is None or FLEET not in priors else fleet.share
        return tuple((share if name == FLEET else 1.0 - share, prior) for name, prior in priors.items())

    def pooled(self, posteriors: Mapping[str, TrackPosterior], first: Measurement, scale: Scale) -> TrackPosterior:
        """The mixture of the posteriors under each of `priors`, weighted by their evidence."""
        fleet = self.prior.fleet
        if fleet is None or FLEET not in posteriors:
            return posteriors[WEAK]
        return fleet.in_unit(scale.severity.unit).together(posteriors[WEAK], posteriors[FLEET], first)

    def ended(self, series_of: tuple[str, float], fraction: float, scale: Scale) -> list[ObservedLife]:
        """The fleet's ended lives for this criterion; there are some only for mean COF over all pressures."""
        if series_of != (MEAN_COF, ALL_PRESSURES):
            return []
        return [life.in_unit(scale.severity.unit) for life in self.prior.ended if life.fraction == fraction]

    def corrects_oil(self, quantity: str) -> bool:
        """Whether the model in force corrects a quantity for the oil temperature of its measurement."""
        return quantity == MEAN_COF and "oil_temperature" in self.model.name.effects

    def offsets(self, quantity: str, pressure: float, cycles: FloatArray) -> FloatArray:
        """The model's additive correction of a quantity at cycles since new [m], under each of its draws [d, m]; zeros
        [1, m] if it has none."""
        if self.model.course is None or quantity != MEAN_COF:
            return np.zeros((1, *cycles.shape))
        return self.model.course(cycles, pressure)

    def offset(self, quantity: str, pressure: float, cycles: FloatArray) -> FloatArray:
        """The mean of `offsets` [m]."""
        offsets = self.offsets(quantity, pressure, cycles)
        return np.asarray(offsets[0] if len(offsets) == 1 else np.array(self.model.weights) @ offsets)


def severity_name(severity: Severity) -> SeverityName:
    """The severity measure that eq. 6 counts, as named in answers."""
    return SeverityName(basis=severity.basis.value, exponent=severity.exponent)


def severity_under(record: ClutchIn, exponent: float | None) -> Severity:
    """The severity measure that ζ counts: of the clutch's record, or with the exponent of an adopted load severity."""
    if exponent is None:
        return record.severity.to_model()
    return Severity(basis=SeverityBasis.DISSIPATED_ENERGY, exponent=exponent)


def kind_of(record: ClutchIn, severity: Severity) -> Kind:
    """The properties that clutches must share to learn from each other; simulated and measured clutches never do."""
    return Kind(
        friction_material=record.friction_material,
        reaction_plate=record.reaction_plate,
        fluid=record.fluid,
        origin=record.origin,
        severity=severity_name(severity),
    )


def may_be_of(record: ClutchIn, kind: Kind) -> bool:
    """Whether a clutch is of that kind, disregarding its severity measure, which also depends on adopted models."""
    return kind_of(record, Severity()).model_copy(update={"severity": kind.severity}) == kind
