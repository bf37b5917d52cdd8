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
Course: TypeAlias = Callable[[FloatArray, float], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelInForce:
    """The model as answers name it, the weights of its draws, its course (None: eq. 6 alone), the exponent of an adopted
    load severity, and in sentences what it takes off the measurements."""

    name: ModelName = BASELINE
    weights: tuple[float, ...] = (1.0,)
    course: Course | None = None
    severity_exponent: float | None = None
    corrected: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedPrior:
    """The prior that a fleet has taught (None: the weak one alone), its lives that have ended, and its public name."""

    fleet: FleetPrior | None = None
    ended: tuple[ObservedLife, ...] = ()
    name: PriorName = WEAK_PRIOR


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """ζ over cycles since new: a life begins at `origin`, and `severity` leads on from the cycles since."""

    origin: float
    severity: SeverityMap = IDENTITY

    def progress(self, cycles: FloatArray | float) -> FloatArray:
        """ζ at cycles since new, any shape; 0 before the origin."""
        return self.severity.progress(np.maximum(np.asarray(cycles) - self.origin, 0.0))

    def cycles(self, progress: FloatArray | float) -> FloatArray:
        """Cycles since new at ζ; the inverse."""
        return self.origin + self.severity.cycles_at(progress)


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumptions:
    """What ζ counts (`severity`), the fleet's prior beside the weak one, and the model in force.

    The model's course is taken off measured mean COF before eq. 6 is tracked, and put back to look for the threshold.
    """

    severity: Severity = field(default_factory=Severity)
    prior: LearnedPrior = field(default_factory=LearnedPrior)
    model: ModelInForce = field(default_factory=ModelInForce)

    @property
    def counts_cycles(self) -> bool:
        """Whether ζ is the count of cycles, whatever the duty."""
        return self.severity.basis is SeverityBasis.CYCLES

    def scale(self, origin: float, blocks: Sequence[Block]) -> Scale:
        """ζ over cycles since new for a life that began at `origin`, by its blocks of duty."""
        since = [] if self.counts_cycles else [block.since(origin) for block in blocks if block.end > origin]
        return Scale(origin=origin, severity=severity_map(self.severity, since))

    def priors(self, quantity: str, first: Measurement, scale: Scale) -> dict[str, TrackPrior]:
        """The priors of a series by name; its first measurement gives their size."""
        fleet = self.prior.fleet
        if fleet is None or quantity != MEAN_COF:
            return {WEAK: weak(first, falling=quantity == MEAN_COF)}
        return {WEAK: weak(first, falling=True), FLEET: fleet.in_unit(scale.severity.unit).prior_for(first)}

    def weighted_priors(self, quantity: str, first: Measurement, scale: Scale) -> tuple[tuple[float, TrackPrior], ...]:
        """The priors of a series, each with its share."""
        priors, fleet = self.priors(quantity, first, scale), self.prior.fleet
        share = 0.0 if fleet is None or FLEET not in priors else fleet.share
        return tuple((share if name == FLEET else 1.0 - share, prior) for name, prior in priors.items())

    def pooled(self, posteriors: Mapping[str, TrackPosterior], first: Measurement, scale: Scale) -> TrackPosterior:
        """The posteriors under each of `priors` as one, weighted by their evidence."""
        fleet = self.prior.fleet
        if fleet is None or FLEET not in posteriors:
            return posteriors[WEAK]
        return fleet.in_unit(scale.severity.unit).together(posteriors[WEAK], posteriors[FLEET], first)

    def ended(self, series_of: tuple[str, float], fraction: float, scale: Scale) -> list[ObservedLife]:
        """The fleet's ended lives by the same criterion: of mean COF over all pressures, none of another quantity."""
        if series_of != (MEAN_COF, ALL_PRESSURES):
            return []
        return [life.in_unit(scale.severity.unit) for life in self.prior.ended if life.fraction == fraction]

    def corrects_oil(self, quantity: str) -> bool:
        """Whether the model in force frees a quantity of the temperature of the oil that it was measured in."""
        return quantity == MEAN_COF and "oil_temperature" in self.model.name.effects

    def offsets(self, quantity: str, pressure: float, cycles: FloatArray) -> FloatArray:
        """What the model in force adds to a quantity under each of its draws at cycles since new [m]; [d, m], [1, m] where
        it adds nothing."""
        if self.model.course is None or quantity != MEAN_COF:
            return np.zeros((1, *cycles.shape))
        return self.model.course(cycles, pressure)

    def offset(self, quantity: str, pressure: float, cycles: FloatArray) -> FloatArray:
        """The mean of `offsets` [m]."""
        offsets = self.offsets(quantity, pressure, cycles)
        return np.asarray(offsets[0] if len(offsets) == 1 else np.array(self.model.weights) @ offsets)


def severity_name(severity: Severity) -> SeverityName:
    """What eq. 6 counts, as answers name it."""
    return SeverityName(basis=severity.basis.value, exponent=severity.exponent)


def severity_under(record: ClutchIn, exponent: float | None) -> Severity:
    """What ζ counts: by the clutch's record, or by the exponent of an adopted load severity."""
    if exponent is None:
        return record.severity.to_model()
    return Severity(basis=SeverityBasis.DISSIPATED_ENERGY, exponent=exponent)


def kind_of(record: ClutchIn, severity: Severity) -> Kind:
    """What clutches must have in common to teach each other; a simulated one teaches no measured one."""
    return Kind(
        friction_material=record.friction_material,
        reaction_plate=record.reaction_plate,
        fluid=record.fluid,
        origin=record.origin,
        severity=severity_name(severity),
    )


def may_be_of(record: ClutchIn, kind: Kind) -> bool:
    """Whether a clutch is of that kind but for its severity, which follows from what was adopted, too."""
    return kind_of(record, Severity()).model_copy(update={"severity": kind.severity}) == kind
