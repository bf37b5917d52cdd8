"""The record of a clutch: geometry, oil, end of life. Everything but the name defaults to the reference's clutch."""

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, JsonValue, model_validator

from models.clutch import Geometry
from models.degradation.severity import Severity, SeverityBasis
from service.api import base, life
from service.api.alarm import EventOut
from service.channels import whole

#: 2.0 is the whole number 2.
WholeNumber = Annotated[
    int, Field(strict=True), BeforeValidator(lambda sent: whole(sent) if isinstance(sent, float) else sent)
]
TorqueFilter = Annotated[
    Annotated[base.NotNegativeNumber, Field(le=base.MAX_TORQUE_FILTER_MS)] | None,
    Field(
        description="Time constant of the torque channel's first-order low-pass, ms; null: not known. In sampled "
        "tests, pressure and speed are filtered in the same way"
    ),
]
Length = Annotated[base.PositiveNumber, Field(ge=base.MIN_LENGTH_MM, le=base.MAX_LENGTH_MM)]
PressureFactor = Annotated[base.PositiveNumber, Field(ge=base.MIN_PRESSURE_FACTOR, le=base.MAX_PRESSURE_FACTOR)]


class GeometryIn(base.Schema):
    """The friction disc."""

    inner_diameter_mm: Length = Field(default=99.0, description="Inner diameter of the lining, mm")
    outer_diameter_mm: Length = Field(default=133.0, description="Outer diameter of the lining, mm")
    friction_faces: Annotated[WholeNumber, Field(ge=1, le=base.MAX_FRICTION_FACES)] = Field(
        default=2, description="Number of friction faces"
    )
    mean_radius_mm: Length | None = Field(
        default=None, description="Mean radius, mm; default: a quarter of the sum of both diameters"
    )
    pressure_factor: PressureFactor = Field(default=1.0, description="Lining pressure divided by line pressure")

    @model_validator(mode="after")
    def _has_width(self) -> Self:
        if self.outer_diameter_mm < self.inner_diameter_mm + base.MIN_WIDTH_MM:
            raise ValueError(
                f"outer_diameter_mm must exceed inner_diameter_mm {self.inner_diameter_mm} by {base.MIN_WIDTH_MM} or more"
                f", got {self.outer_diameter_mm}"
            )
        return self

    def to_model(self) -> Geometry:
        """The geometry in SI units."""
        return Geometry(
            inner_diameter=self.inner_diameter_mm / 1000,
            outer_diameter=self.outer_diameter_mm / 1000,
            friction_faces=self.friction_faces,
            mean_radius_override=None if self.mean_radius_mm is None else self.mean_radius_mm / 1000,
            pressure_factor=self.pressure_factor,
        )


class OilIn(base.Schema):
    """The oil's kinematic viscosity."""

    kinematic_viscosity_40c_cst: base.PositiveNumber = Field(
        default=56.0, description="Kinematic viscosity at 40 °C, cSt"
    )
    kinematic_viscosity_100c_cst: base.PositiveNumber = Field(
        default=9.3, description="Kinematic viscosity at 100 °C, cSt"
    )

    @model_validator(mode="after")
    def _thins_when_warm(self) -> Self:
        if self.kinematic_viscosity_100c_cst >= self.kinematic_viscosity_40c_cst:
            raise ValueError(
                "kinematic_viscosity_100c_cst must be below kinematic_viscosity_40c_cst "
                f"{self.kinematic_viscosity_40c_cst}, got {self.kinematic_viscosity_100c_cst}"
            )
        return self


class EndOfLifeIn(base.Schema):
    """The end-of-life criterion."""

    cof_fraction: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False, strict=True)] = Field(
        default=0.5, description="The life ends when mean COF has fallen to this fraction of its initial value"
    )

    criteria: Annotated[tuple[life.CriterionIn, ...], Field(max_length=base.MAX_CRITERIA)] = Field(
        default=(),
        description="Limits that end the life, in place of `cof_fraction`: the one that is reached first counts",
    )


class SeverityIn(base.Schema):
    """How much a duty cycle ages the clutch: the argument of eq. 6."""

    basis: Literal["cycles", "sliding_distance", "dissipated_energy"] = Field(
        default="cycles", description="What eq. 6 counts: duty cycles, sliding distance or dissipated energy"
    )
    exponent: Annotated[base.NotNegativeNumber, Field(le=base.MAX_SEVERITY_EXPONENT)] = Field(
        default=1.0, description="Exponent of a duty cycle's distance or energy"
    )

    def to_model(self) -> Severity:
        return Severity(basis=SeverityBasis(self.basis), exponent=self.exponent)


class ClutchIn(base.Schema):
    """A clutch as it is registered."""

    clutch_id: base.Identifier = Field(description="The clutch's name; safe in an address, 128 characters at most")
    geometry: GeometryIn = Field(default=GeometryIn(), description="The friction disc")
    oil: OilIn = Field(default=OilIn(), description="The oil")
    end_of_life: EndOfLifeIn = Field(default=EndOfLifeIn(), description="The end-of-life criterion")
    friction_material: base.Name = Field(default="paper", description="The friction material")
    reaction_plate: base.Name = Field(default="steel", description="The reaction plate's material")
    fluid: base.Name = Field(default="ATF", description="The fluid")
    severity: SeverityIn = Field(default=SeverityIn(), description="How much a duty cycle ages the clutch")
    torque_filter_ms: TorqueFilter = None
    origin: base.Origin = "measured"
    note: base.Reason = Field(default="", description="A remark, such as where the clutch comes from")

    @property
    def torque_filter(self) -> float:
        """The time constant of the torque channel's low-pass [s], 0 if none is declared."""
        return 0.0 if self.torque_filter_ms is None else self.torque_filter_ms / 1000


#: The default of a field that may be left out and may not be null.
_STAYS: Any = None


class ClutchEdit(base.Schema):
    """The fields of a clutch's record to change. Each is replaced as a whole; omitted fields stay."""

    reason: base.Reason = Field(default="", description="Reason; required if the record changes")
    archived: bool = Field(default=_STAYS, strict=True, description="Whether the clutch is archived: lists omit it")
    geometry: GeometryIn = Field(default=_STAYS, description="The friction disc")
    oil: OilIn = Field(default=_STAYS, description="The oil")
    end_of_life: EndOfLifeIn = Field(default=_STAYS, description="The end-of-life criterion")
    friction_material: base.Name = Field(default=_STAYS, description="The friction material")
    reaction_plate: base.Name = Field(default=_STAYS, description="The reaction plate's material")
    fluid: base.Name = Field(default=_STAYS, description="The fluid")
    severity: SeverityIn = Field(default=_STAYS, description="How much a duty cycle ages the clutch")
    torque_filter_ms: TorqueFilter = None
    origin: base.Origin = Field(default=_STAYS)
    note: base.Reason = Field(default=_STAYS, description="A remark, such as where the clutch comes from")

    @model_validator(mode="after")
    def _says_why(self) -> Self:
        if self.fields() and not self.reason:
            raise ValueError("reason must say why the record changes")
        return self

    def fields(self) -> dict[str, JsonValue]:
        """The given fields of the record, as JSON."""
        sent = self.model_fields_set - {"reason", "archived"}
        return self.model_dump(mode="json", include=sent)


class ClutchSummary(base.Answer):
    """Current health and remaining life, as lists show them; null while unknown."""

    status: str = Field(description="The status of `/remaining-useful-life`")
    as_of_cycles: base.Real | None = Field(description="Duty cycles since new of the latest run")
    runs_used: int = Field(description="Number of stationary tests that the prediction uses")
    current: life.Current = Field(description="The clutch's present state")
    criterion: life.Criterion = Field(description="The end-of-life criterion that will most probably be reached first")
    remaining_cycles: life.Quantiles = Field(description="Quantiles of the remaining duty cycles, by probability")
    at_least: life.AtLeast
    probability_of_reaching: base.Real | None = Field(
        description="Probability that the end of life is reached by the horizon"
    )
    model: life.ModelName = Field(description="The model that the clutch is tracked under")
    ended: life.DeclaredEnd | None = Field(description="The declared end of the present life; null while it goes on")
    at_least_at: life.AtLeastAt
    counted_from: life.CountedFrom
    held_runs: life.Held
    statement: life.Statement


class LastRun(base.Answer):
    """The run that was made last."""

    run_id: base.RunName
    kind: str = Field(description="The kind of run")
    cycles: base.RunCycles
    at: str = Field(description="When it was made, or received if that is unknown; UTC, ISO 8601")


class Recent(base.Answer):
    """The recent history of a clutch."""

    last_run: LastRun = Field(description="The run that was made last")
    mean_cof: list[base.Real] = Field(description="Mean COF of the present life, thinned to at most 32 values")


class AdvisedTest(base.Answer):
    """The most informative next test."""

    test: str = Field(description="The test in a sentence")
    separates: list[str] = Field(description="The two effects that it distinguishes; `baseline` stands for none")


class LatestDiagnosis(base.Answer):
    """The newest finished diagnosis."""

    diagnosis_id: str = Field(description="The diagnosis' name")
    verdict: str | None = Field(description="Its verdict")
    causes: list[str] = Field(description="The causes it names, by their slugs")
    advice: AdvisedTest | None = Field(description="The most informative next test; null if none is advised")
    adoptable: bool = Field(description="Whether it has an extended model to adopt")
    adopted: bool = Field(description="Whether its model is the current one")
    earlier_life: bool = Field(description="Whether a rebuild has ended the life that it diagnosed")


class ClutchState(base.Answer):
    """The state of a clutch after NAMUR NE 107."""

    name: base.StateName = Field(
        description="`failure`: a criterion is reached. `maintenance`: at the safe bound less than a fifth of the"
        " life is left, or a quantity is near its limit. `check`: runs are held, or there are too few"
        " tests. `out_of_specification`: data and model disagree. `normal`: none of these. If several"
        " apply, the first counts"
    )
    why: str = Field(description="The reason as a clause; if the state needs none, the statement of the remaining life")


class ClutchOut(base.Answer):
    """A registered clutch."""

    clutch_id: base.ClutchName
    geometry: GeometryIn = Field(description="The friction disc")
    oil: OilIn = Field(description="The oil")
    end_of_life: EndOfLifeIn = Field(description="The end-of-life criterion")
    friction_material: str = Field(description="The friction material")
    reaction_plate: str = Field(description="The reaction plate's material")
    fluid: str = Field(description="The fluid")
    severity: SeverityIn = Field(description="How much a duty cycle ages the clutch")
    torque_filter_ms: TorqueFilter
    origin: base.Origin
    note: str = Field(description="A remark, such as where the clutch comes from")
    archived: bool = Field(description="Whether the clutch is archived: lists omit it, and it takes no more runs")
    created_at: str = Field(description="When it was registered; UTC, ISO 8601")
    revision: base.Revision
    state: ClutchState = Field(description="What the state demands")
    headline: str = Field(
        description="One line: the state in words, the safe bound in cycles and in days at the pace so far, and the median"
    )
    action: str = Field(description="One sentence: what to do now")
    runs: int = Field(description="Number of runs that count, without held and withdrawn ones")
    held: int = Field(description="Number of held runs, which wait to be confirmed, corrected or withdrawn")
    alarms: list[EventOut] = Field(description="Its alarms that nobody has acknowledged, newest first")
    what_to_do: str = Field(description="The same as `action`")
    open_alarms: int = Field(description="Number of alarms that nobody has acknowledged")
    summary: ClutchSummary | None = Field(description="Health and remaining life; null before the first run")
    recent: Recent | None = Field(description="The recent history; null before the first run")
    diagnosis: LatestDiagnosis | None = Field(description="The newest finished diagnosis; null without one")


class ClutchPage(base.Page[ClutchOut]):
    """Clutches, what needs somebody first or by name."""

    items: list[ClutchOut] = Field(description="The clutches of this page")
