"""The clutch record: geometry, oil, end of life. Everything but the name has the reference's clutch as default."""

from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from models.clutch import Geometry
from models.degradation.severity import Severity, SeverityBasis
from service.schemas.base import Answer, Identifier, NotNegativeNumber, Origin, PositiveNumber, Schema
from service.schemas.life import Current, ModelName

Name = Annotated[str, StringConstraints(min_length=1, max_length=200)]


#: A ring narrower than this is a slip of the pen.
_LEAST_WIDTH_MM = 0.1


class GeometryIn(Schema):
    """The friction disc, lengths in mm."""

    inner_diameter_mm: Annotated[PositiveNumber, Field(ge=0.1, le=1e5)] = 99.0
    outer_diameter_mm: Annotated[PositiveNumber, Field(ge=0.1, le=1e5)] = 133.0
    friction_faces: Annotated[int, Field(ge=1, le=1000, strict=True)] = 2
    mean_radius_mm: Annotated[PositiveNumber, Field(ge=0.1, le=1e5)] | None = None
    pressure_factor: Annotated[PositiveNumber, Field(ge=1e-6, le=1e6)] = 1.0

    @model_validator(mode="after")
    def _has_width(self) -> Self:
        if self.outer_diameter_mm < self.inner_diameter_mm + _LEAST_WIDTH_MM:
            raise ValueError(
                f"outer_diameter_mm must exceed inner_diameter_mm {self.inner_diameter_mm} by {_LEAST_WIDTH_MM} or more, "
                f"got {self.outer_diameter_mm}"
            )
        return self

    def to_model(self) -> Geometry:
        """In SI units."""
        return Geometry(
            inner_diameter=self.inner_diameter_mm / 1000,
            outer_diameter=self.outer_diameter_mm / 1000,
            friction_faces=self.friction_faces,
            mean_radius_override=None if self.mean_radius_mm is None else self.mean_radius_mm / 1000,
            pressure_factor=self.pressure_factor,
        )


class OilIn(Schema):
    """Kinematic viscosity at two temperatures, cSt."""

    kinematic_viscosity_40c_cst: PositiveNumber = 56.0
    kinematic_viscosity_100c_cst: PositiveNumber = 9.3

    @model_validator(mode="after")
    def _thins_when_warm(self) -> Self:
        if self.kinematic_viscosity_100c_cst >= self.kinematic_viscosity_40c_cst:
            raise ValueError(
                "kinematic_viscosity_100c_cst must be below kinematic_viscosity_40c_cst "
                f"{self.kinematic_viscosity_40c_cst}, got {self.kinematic_viscosity_100c_cst}"
            )
        return self


class EndOfLifeIn(Schema):
    """End of life: mean COF has fallen to this fraction of what it was when new."""

    cof_fraction: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False, strict=True)] = 0.5


class SeverityIn(Schema):
    """What eq. 6 counts: duty cycles, or their sliding distance or dissipated energy to the power of `exponent`."""

    basis: Literal["cycles", "sliding_distance", "dissipated_energy"] = "cycles"
    exponent: Annotated[NotNegativeNumber, Field(le=10)] = 1.0

    def to_model(self) -> Severity:
        """As the models take it."""
        return Severity(basis=SeverityBasis(self.basis), exponent=self.exponent)


class ClutchIn(Schema):
    """A clutch as it is registered."""

    clutch_id: Identifier
    geometry: GeometryIn = GeometryIn()
    oil: OilIn = OilIn()
    end_of_life: EndOfLifeIn = EndOfLifeIn()
    friction_material: Name = "paper"
    reaction_plate: Name = "steel"
    fluid: Name = "ATF"
    severity: SeverityIn = SeverityIn()
    origin: Origin = "measured"


class ClutchSummary(Answer):
    """Current health and remaining life, as lists show them; null before anything is known."""

    status: str
    as_of_cycles: float | None
    current: Current
    remaining_cycles: dict[str, float | None]
    model: ModelName


class LastRun(Answer):
    """The run that was made last; `at` is when, UTC, ISO 8601."""

    run_id: str
    kind: str
    cycles: float
    at: str


class Recent(Answer):
    """The latest past: the last run, and mean COF of the present life as a short line of at most 32 values."""

    last_run: LastRun
    mean_cof: list[float]


class LatestDiagnosis(Answer):
    """The newest finished diagnosis; `adopted` where its model is in force, `earlier_life` where a rebuild came since."""

    diagnosis_id: str
    verdict: str | None
    causes: list[str]
    adopted: bool
    earlier_life: bool


class ClutchOut(Answer):
    """A registered clutch."""

    clutch_id: str
    geometry: GeometryIn
    oil: OilIn
    end_of_life: EndOfLifeIn
    friction_material: str
    reaction_plate: str
    fluid: str
    severity: SeverityIn
    origin: Origin
    created_at: str
    revision: int
    runs: int
    summary: ClutchSummary | None
    recent: Recent | None
    diagnosis: LatestDiagnosis | None


class ClutchPage(Answer):
    """Clutches, worst first."""

    items: list[ClutchOut]
    next: str | None
