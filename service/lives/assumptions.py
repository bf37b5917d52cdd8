"""What a clutch's life is tracked under: what ζ counts, what is believed beforehand, and what an adopted model adds.

Every prediction is made under a basis, and every answer names its model and its prior.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from sqlalchemy import Connection

from models.arrays import FloatArray
from models.degradation.severity import IDENTITY, Block, Severity, SeverityBasis, SeverityMap, severity_map
from models.prognosis.fleet import FleetPrior
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior
from models.tracking.prior import Prior, weak
from service.lives.adopted_model import BASELINE, Adopted, Course, adopted_of
from service.schemas.clutch import ClutchIn
from storage import fleet_priors
from storage.clutches import ClutchRow

MEAN_COF = "mean_cof"
#: The mean over the reference pressures stands under this pressure.
ALL_PRESSURES = 0.0

#: What is believed of a series, by name: always the first, the second where there is a fleet.
WEAK, FLEET = "weak", "fleet"
WEAK_PRIOR: Mapping[str, Any] = {"name": WEAK, "version": None, "clutches": 0}


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
class Basis:
    """`severity` is what ζ counts; `fleet` None leaves the weak prior alone; `course` None is eq. 6 alone.

    `prior` and `model` are what answers name. The course is taken off measured mean COF before eq. 6 is tracked and put back
    when the threshold is looked for.
    """

    severity: Severity = field(default_factory=Severity)
    fleet: FleetPrior | None = None
    prior: Mapping[str, Any] = field(default_factory=lambda: WEAK_PRIOR)
    course: Course | None = None
    model: Mapping[str, Any] = field(default_factory=lambda: BASELINE)

    @property
    def counts_cycles(self) -> bool:
        """Whether ζ is the count of cycles, whatever the duty."""
        return self.severity.basis is SeverityBasis.CYCLES

    def scale(self, origin: float, blocks: Sequence[Block]) -> Scale:
        """ζ over cycles since new for a life that began at `origin`, by its blocks of duty."""
        since = [block.since(origin) for block in blocks if block.end > origin]
        return Scale(origin=origin, severity=severity_map(self.severity, since))

    def beliefs(self, quantity: str, first: Measurement, scale: Scale) -> dict[str, Prior]:
        """What is believed of a series before it is measured, by name; `first` gives its size."""
        if self.fleet is None or quantity != MEAN_COF:
            return {WEAK: weak(first, falling=quantity == MEAN_COF)}
        return {WEAK: weak(first, falling=True), FLEET: self.fleet.in_unit(scale.severity.unit).prior_for(first)}

    def together(self, found: Mapping[str, Posterior], first: Measurement, scale: Scale) -> Posterior:
        """Samples under each of `beliefs` as one, put together as the measurements have it."""
        if self.fleet is None or FLEET not in found:
            return found[WEAK]
        return self.fleet.in_unit(scale.severity.unit).together(found[WEAK], found[FLEET], first)

    def offset(self, quantity: str, pressure: float, cycles: FloatArray) -> FloatArray:
        """What the adopted model adds to a quantity at cycles since new [m]; [m]."""
        if self.course is None or quantity != MEAN_COF:
            return np.zeros(cycles.shape)
        return self.course(cycles, pressure)


def basis_of(connection: Connection, clutch: ClutchRow) -> Basis:
    """The basis of a stored clutch under the model that is adopted for it."""
    return basis_under(connection, clutch, adopted_of(connection, clutch.clutch_id))


def basis_under(connection: Connection, clutch: ClutchRow, adopted: Adopted) -> Basis:
    """The basis of a stored clutch under a model: severity by its record or the model, the fleet's prior, the course."""
    record = ClutchIn.model_validate(clutch.record)
    severity = record.severity.to_model()
    if adopted.severity_exponent is not None:
        severity = Severity(basis=SeverityBasis.DISSIPATED_ENERGY, exponent=adopted.severity_exponent)
    fleet, prior = _fleet_of(connection, record, severity)
    return Basis(severity=severity, fleet=fleet, prior=prior, course=adopted.course, model=adopted.model)


def kind_of(record: ClutchIn, severity: Severity) -> dict[str, Any]:
    """What clutches must have in common to teach each other; a simulated one teaches no measured one."""
    return {
        "friction_material": record.friction_material,
        "reaction_plate": record.reaction_plate,
        "fluid": record.fluid,
        "origin": record.origin,
        "severity": {"basis": severity.basis.value, "exponent": severity.exponent},
    }


def _fleet_of(
    connection: Connection, record: ClutchIn, severity: Severity
) -> tuple[FleetPrior | None, Mapping[str, Any]]:
    """The newest prior of the clutch's kind that was not learned from it, and its public name."""
    row = fleet_priors.current(connection, kind_of(record, severity))
    if row is not None and record.clutch_id in row.members:
        row = fleet_priors.without(connection, row, record.clutch_id)
    if row is None:
        return None, WEAK_PRIOR
    fleet = FleetPrior.from_dict(row.content)
    return fleet, {"name": FLEET, "version": row.version, "clutches": fleet.clutches}
