"""The prognosis: the public names of quantities, what ends a life, how much of it remains, and under which planned duty.

Every answer names its assumptions: model, prior, severity.
"""

from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, model_validator

from service.schemas.base import (
    LARGEST_LIMIT,
    MAX_BLOCKS,
    MAX_CRITERION_PRESSURE_BAR,
    MAX_CYCLES,
    MAX_SPEED_RPM,
    MIN_BLOCK_CYCLES,
    MIN_PLANNED_KJ,
    Answer,
    ClutchName,
    NotNegativeNumber,
    Origin,
    PositiveNumber,
    Revision,
    Schema,
)
from service.schemas.run import EndReason, Warned

ParameterQuantity = Literal["static_torque_nm", "coulomb_ratio", "stribeck_velocity_m_s", "viscous_coefficient"]
LoopQuantity = Literal["attractor", "film_time", "loop_area"]
EngagementQuantity = Literal[
    "stop_time_s",
    "engagement_energy_kj",
    "peak_power_kw",
    "initial_cof",
    "midpoint_cof",
    "endpoint_cof",
    "breakaway_cof",
    "initial_cof_ratio",
    "endpoint_cof_ratio",
    "breakaway_cof_ratio",
    "torque_rise",
    "normalised_duration",
    "euclidean_distance",
    "spectral_angle_rad",
]
#: Other names of three of them, as a record's criteria and a query may have them.
ALIASES = {"static_ratio": "breakaway_cof_ratio", "stop_time": "stop_time_s", "energy": "engagement_energy_kj"}
#: Measured at a pressure level.
LevelQuantity = Literal[ParameterQuantity, "slope", LoopQuantity]
#: Tracked along a life.
QuantityName = Literal["mean_cof", LevelQuantity, EngagementQuantity]
#: Rows of `/series`.
SeriesQuantity = Literal[
    "mean_cof",
    LevelQuantity,
    EngagementQuantity,
    "health",
    "remaining_cycles",
    "at_least",
    "probability_of_reaching",
    "held_runs",
]


_Value = Annotated[float, Field(ge=-LARGEST_LIMIT, le=LARGEST_LIMIT, allow_inf_nan=False, strict=True)]


class CriterionIn(Schema):
    """A quantity that ends the life where it reaches a limit: a share of its initial value, or a value."""

    quantity: QuantityName = Field(description="The quantity, as in `/degradation`")
    fraction: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False, strict=True)] | None = Field(
        default=None, description="The life ends when the quantity has fallen to this share of its initial value"
    )
    below: _Value | None = Field(
        default=None, description="The life ends when it falls below this value; of a slope 0 where no limit is given"
    )
    above: _Value | None = Field(default=None, description="The life ends when it rises above this value")
    pressure_bar: Annotated[PositiveNumber, Field(le=MAX_CRITERION_PRESSURE_BAR)] | None = Field(
        default=None, description="Line pressure, bar: that of all but mean COF, which left out is the mean over all"
    )
    speed_rpm: Annotated[PositiveNumber, Field(le=MAX_SPEED_RPM)] | None = Field(
        default=None, description="Speed of a slope, rpm"
    )
    frequency_hz: PositiveNumber | None = Field(default=None, description="Frequency of a quantity of loops, Hz")

    @model_validator(mode="before")
    @classmethod
    def _has_a_limit(cls, given: Any) -> Any:
        """A slope's limit is 0, where friction begins to fall with speed, and mean COF's half of what it was."""
        if isinstance(given, dict) and isinstance(given.get("quantity"), str):
            given = given | {"quantity": ALIASES.get(given["quantity"], given["quantity"])}
        if not isinstance(given, dict) or any(given.get(name) is not None for name in ("fraction", "below", "above")):
            return given
        usual = {"slope": {"below": 0.0}, "mean_cof": {"fraction": 0.5}}
        quantity = given.get("quantity")
        return given | usual.get(quantity, {}) if isinstance(quantity, str) else given

    @model_validator(mode="after")
    def _is_one_limit_at_one_place(self) -> Self:
        limits = [name for name in ("fraction", "below", "above") if getattr(self, name) is not None]
        if len(limits) != 1:
            raise ValueError(
                f"exactly one of fraction, below and above must be given, got {', '.join(limits) or 'none'}"
            )
        if self.quantity == "slope" and self.fraction is not None:
            raise ValueError("a slope changes sign: its limit is below or above a value, not a fraction")
        if self.quantity != "mean_cof" and (self.pressure_bar is None) is (self.quantity in get_args(LevelQuantity)):
            given = "be given" if self.pressure_bar is None else "not be given"
            raise ValueError(f"pressure_bar must {given} for {self.quantity}")
        of_loops = self.quantity in get_args(LoopQuantity)
        for name, needed in (("speed_rpm", self.quantity == "slope"), ("frequency_hz", of_loops)):
            if (getattr(self, name) is not None) is not needed:
                raise ValueError(f"{name} must {'' if needed else 'not '}be given for {self.quantity}")
        return self


MethodName = Literal["particle", "ukf", "grid"]
Method = Annotated[
    MethodName,
    Field(description="The filter: Rao-Blackwellised particles, unscented Kalman filter, or exact posterior on a grid"),
]
#: By probability, as text: "0.05", ..., "0.95"; null beyond the horizon or where nothing is predicted.
Quantiles = dict[str, float | None]


class CriterionPlace(Answer):
    """A quantity at a place, and the limit that ends the life."""

    quantity: QuantityName = Field(description="The quantity that is compared with the limit")
    fraction: float | None = Field(description="Limit over initial value; null where the limit is a value")
    below: float | None = Field(default=None, description="The value below which the life ends")
    above: float | None = Field(default=None, description="The value above which the life ends")
    pressure_bar: float | None = Field(description="Line pressure, bar; null: the mean over the reference pressures")
    speed_rpm: float | None = Field(default=None, description="Speed of a slope, rpm")
    frequency_hz: float | None = Field(default=None, description="Frequency of a quantity of loops, Hz")
    initial: float | None = Field(default=None, description="The quantity when new, as tracked")
    limit: float | None = Field(default=None, description="The value of the quantity that ends the life")


class Criterion(CriterionPlace):
    """The criterion that ends the life, most probably; null before the first measurement."""

    initial_mean_cof: float | None = Field(description="Mean COF when new, as tracked; null of another quantity")
    threshold_mean_cof: float | None = Field(description="Mean COF at the end of life; null of another quantity")


class CriterionValue(Answer):
    """A quantity as it is now; with too few tests as it was measured last, null before."""

    value: float | None = Field(description="Its mean, as tracked")
    sd: float | None = Field(description="Its standard deviation")


class CriterionOutcome(CriterionPlace):
    """One of the criteria: when it would end the life by itself, and how probably it is the first."""

    current: CriterionValue = Field(description="The quantity as it is now")
    remaining_cycles: Quantiles = Field(description="Quantiles of the remaining duty cycles, by probability")
    end_of_life_cycles: Quantiles = Field(description="Quantiles of the duty cycles since new at its limit")
    probability_of_reaching: float | None = Field(description="Probability that the limit is reached by the horizon")
    probability_first: float = Field(description="Probability that this limit is reached before the others")
    tests: int = Field(description="How many tests measured the quantity there")


class LifeNumber(Answer):
    """The life that an answer is about; a rebuild begins a new one."""

    number: int = Field(description="Its number, from 1 on")
    of: int = Field(description="How many lives the clutch has had")
    from_cycles: float | None = Field(description="Duty cycles since new at which it began; null before the first run")
    rebuild: str | None = Field(description="The run_id of the rebuild that began it; null for the first")


class Current(Answer):
    """The clutch's present state; null before the first measurement. With too few tests for a prediction mean COF is the
    last one as it was measured, and the others are null."""

    mean_cof: float | None = Field(description="Mean COF, as tracked")
    mean_cof_sd: float | None = Field(description="Its standard deviation")
    measured_at_cycles: float | None = Field(description="Duty cycles since new at which it was measured last")
    fraction_of_initial: float | None = Field(description="Mean COF over its value when new")
    health: float | None = Field(
        description="1 when new, 0 at the end of life: the share that is left of the way to the limit, the least by any "
        "criterion"
    )


class ModelName(Answer):
    """The model that an answer was computed with."""

    name: str = Field(description="`baseline`, or the extended model's name")
    effects: list[str] = Field(description="The effects that extend the baseline, by their slugs")


class PriorName(Answer):
    """The prior that an answer was computed with."""

    name: Literal["weak", "fleet"] = Field(
        description="The weak prior, or one learned from a fleet of earlier clutches"
    )
    version: int | None = Field(description="The fleet prior's version; null for the weak prior")
    clutches: int = Field(description="Number of clutches that the prior was learned from")


class SeverityName(Answer):
    """The argument of eq. 6."""

    basis: Literal["cycles", "sliding_distance", "dissipated_energy"] = Field(
        description="What eq. 6 counts: duty cycles, or their sliding distance or dissipated energy"
    )
    exponent: float = Field(description="Exponent of a duty cycle's distance or energy")


Model = Annotated[ModelName, Field(description="The model that the answer was computed with")]
Prior = Annotated[PriorName, Field(description="The prior that the answer was computed with")]
SeverityUsed = Annotated[SeverityName, Field(description="The argument of eq. 6")]


class CourseShare(Answer):
    """A kind of course that mean COF may take, by the order n of its kinetics dD/dζ = ∓k Dⁿ."""

    name: Literal["eq6", "slowing", "accelerating"] = Field(
        description="As eq. 6, whose order is above 1; slowing down otherwise; accelerating"
    )
    probability: float = Field(description="Its probability")
    order: float | None = Field(description="The median of its order n; null for a logarithm alone")


class BackCastCount(Answer):
    """How earlier forecasts of a clutch fared with the tests since, and what follows for this one."""

    held: int = Field(description="Tests that lay within the 90 % interval forecast for them")
    of: int = Field(description="Tests that a forecast was kept for")
    widening: float = Field(
        description="The power to which remaining life was raised, as a multiple of its median; 1: not widened"
    )


class SampleQuality(Answer):
    """The weighted draws that a prediction is made of."""

    effective_draws: float = Field(description="How many draws of equal weight would be worth as much")
    status: Literal["sound", "few_draws", "forced"] = Field(
        description="`forced`: the last test came as more of a surprise than the particles could follow; ask `grid`"
    )


class Course(CourseShare):
    """The most probable kind of course, and the others."""

    alternatives: list[CourseShare] = Field(description="The other kinds, the more probable first")


class HeldRuns(Answer):
    """What the runs that are held would make of the remaining life."""

    count: int = Field(description="How many runs of the clutch are held")
    status: str = Field(description="The status of the prediction with them")
    remaining_cycles: Quantiles = Field(description="Quantiles of the remaining duty cycles with them, by probability")


#: The safe bound.
AtLeast = Annotated[
    float | None,
    Field(
        description="Duty cycles that are left with a probability of 95 %, the lower of those with and without held runs; "
        "up to the horizon where the end of life lies beyond it; null before the first test"
    ),
]
AtLeastAt = Annotated[
    str | None,
    Field(
        description="When these have been run, at the pace that was asked for, else that the `started_at` of the present "
        "life's runs show; UTC, ISO 8601; null where they show none, or for an earlier time"
    ),
]
Held = Annotated[
    HeldRuns | None,
    Field(
        description="What held runs would make of the remaining life; null where none is held, or for an earlier time"
    ),
]


Statement = Annotated[str, Field(description="What is known of the remaining life, as a sentence")]


class DeclaredEnd(Answer):
    """The end of a life as it was declared, by maintenance with the event `end_of_life`."""

    cycles: float = Field(description="Duty cycles since new at the end")
    reason: EndReason = Field(
        description="`worn`: nothing remains; `other`: it was taken out before, and would have ended later"
    )
    run_id: str = Field(description="The run that declares it: withdrawn, the life goes on")


class RemainingLife(Answer):
    """The duty cycles that remain until mean COF has fallen to the criterion's fraction of its initial value."""

    clutch_id: ClutchName
    method: Method
    as_of_cycles: float | None = Field(description="Duty cycles since new from which the remaining ones count")
    runs_used: int = Field(description="Number of stationary tests that the prediction uses")
    revision: Revision
    status: Literal["predicted", "reached", "may_never_reach", "insufficient_data", "ended"] = Field(
        description="Predicted; reached already, more likely than not; some quantile is beyond the horizon; too few tests; "
        "declared ended"
    )
    ended: DeclaredEnd | None = Field(default=None, description="The declared end of the life; null while it goes on")
    criterion: Criterion = Field(description="The end-of-life criterion")
    current: Current = Field(description="The clutch's present state")
    remaining_cycles: Quantiles = Field(description="Quantiles of the remaining duty cycles, by probability")
    end_of_life_cycles: Quantiles = Field(description="Quantiles of the duty cycles since new at the end of life")
    at_least: AtLeast
    at_least_at: AtLeastAt
    held_runs: Held
    statement: Statement
    probability_of_reaching: float | None = Field(
        description="Probability that the threshold is reached by the horizon"
    )
    course: Course | None = Field(
        default=None,
        description="The course of mean COF that the tests speak for; null without a prediction or a criterion on it",
    )
    back_cast: BackCastCount | None = Field(
        default=None, description="What earlier forecasts of this clutch said about the tests since"
    )
    ended_lives: int = Field(
        default=0,
        description="Lives of the same kind that have ended, by whose ends and courses the end was calibrated",
    )
    sample: SampleQuality | None = Field(
        default=None, description="The draws behind the prediction; null where nothing is predicted"
    )
    criteria: list[CriterionOutcome] = Field(
        default=[], description="All criteria, each with its own end and the probability of being reached first"
    )
    life: LifeNumber | None = Field(
        default=None, description="The life that the answer is about, where one or other criteria were asked for"
    )
    horizon_cycles: float = Field(description="The prediction goes no further than this many duty cycles")
    model: Model
    prior: Prior
    severity: SeverityUsed
    warnings: list[Warned] = Field(description="Warnings, such as a last test far off its prediction")
    origin: Origin


class PlannedBlock(Schema):
    """Duty cycles that are planned alike. What states no severity is as severe as recent duty."""

    cycles: Annotated[PositiveNumber, Field(ge=MIN_BLOCK_CYCLES, le=MAX_CYCLES)] = Field(
        description="Duty cycles in the block"
    )
    energy_per_cycle_kj: Annotated[PositiveNumber, Field(ge=MIN_PLANNED_KJ)] | None = Field(
        default=None, description="Energy to be dissipated in a duty cycle, kJ"
    )
    sd: NotNegativeNumber = Field(
        default=0.0, description="Standard deviation of that energy, kJ: how sure the plan is"
    )
    initial_speed_rpm: PositiveNumber | None = Field(
        default=None, description="Sliding speed at the start of an engagement, rpm"
    )
    engagement_duration_s: PositiveNumber | None = Field(default=None, description="Time from contact to standstill, s")
    maximum_pressure_bar: PositiveNumber | None = Field(
        default=None,
        description="Line pressure of an engagement, bar: with a speed it gives the energy where none is stated",
    )

    @model_validator(mode="after")
    def _complete(self) -> "PlannedBlock":
        """What says nothing without another field is refused with a reason, rather than left out in silence."""
        if self.sd > 0.0 and self.energy_per_cycle_kj is None:
            raise ValueError("sd is the deviation of energy_per_cycle_kj, which is missing")
        if self.sd > (self.energy_per_cycle_kj or 0.0):
            raise ValueError("sd is larger than energy_per_cycle_kj: a plan that open predicts nothing")
        if self.initial_speed_rpm is None and (self.engagement_duration_s or self.maximum_pressure_bar):
            raise ValueError("engagement_duration_s and maximum_pressure_bar say nothing without initial_speed_rpm")
        return self


class ProgrammeIn(Schema):
    """Blocks that are run one after the other, and from the first one again until the end of life."""

    programme: Annotated[tuple[PlannedBlock, ...], Field(min_length=1, max_length=MAX_BLOCKS)] = Field(
        description="The blocks of duty"
    )
    pace_cycles_per_hour: PositiveNumber | None = Field(
        default=None, description="Duty cycles an hour, idle hours included; left out, that of the dated runs"
    )
    counted_by: Literal["dissipated_energy", "cycles"] | None = Field(
        default=None,
        description="On a clutch whose record counts cycles: whether a planned cycle counts by its energy beside that of "
        "recent duty, or as one cycle; left out, by its energy where blocks and duty runs state one",
    )


class PlannedLife(RemainingLife):
    """Remaining life under planned duty: `remaining_cycles` and `end_of_life_cycles` are those of the programme."""

    recent_duty_cycles: Quantiles = Field(description="Quantiles of the remaining cycles were recent duty to go on")
    remaining_blocks: Quantiles = Field(
        description="Quantiles of the blocks until the end, the last one in part; the programme begins again after its last"
    )
    block_severity: list[float | None] = Field(
        description="How many cycles of recent duty a cycle of each block is worth, the median; null without a prediction"
    )
    end_of_life_at: dict[str, str | None] | None = Field(
        description="Quantiles of the date of the end, UTC, ISO 8601; null where no pace is known"
    )
    counted_by: Literal["cycles", "sliding_distance", "dissipated_energy"] = Field(
        description="What a planned cycle was counted by"
    )
    pace_cycles_per_hour: float | None = Field(description="Duty cycles an hour that dates were computed with")
    pace_from: Literal["request", "runs"] | None = Field(
        description="Whose pace it is: the request's, or that of the present life's dated runs"
    )
