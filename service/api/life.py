"""The prognosis: the public names of quantities, what ends a life, how much of it remains, and under which planned duty.

Every answer names its assumptions: model, prior, severity.
"""

from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, model_validator

from service.api import base
from service.api.base import Answer, ClutchName, NotNegativeNumber, Origin, PositiveNumber, Real, Revision, Schema
from service.api.run import EndReason, Warned

ParameterQuantity = Literal["static_torque_nm", "coulomb_ratio", "stribeck_velocity_m_s", "viscous_coefficient"]
LoopQuantity = Literal["attractor", "film_time", "loop_area"]
EngagementQuantity = Literal[
    "stop_time_s", "engagement_energy_kj", "peak_power_kw", "initial_cof", "midpoint_cof", "endpoint_cof",
    "breakaway_cof", "initial_cof_ratio", "endpoint_cof_ratio", "breakaway_cof_ratio", "torque_rise",
    "normalised_duration", "euclidean_distance", "spectral_angle_rad",
]  # fmt: skip
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


_Value = Annotated[float, Field(ge=-base.LARGEST_LIMIT, le=base.LARGEST_LIMIT, allow_inf_nan=False, strict=True)]


class CriterionIn(Schema):
    """A quantity that ends the life when it reaches a limit: a share of its initial value, or a value."""

    quantity: QuantityName = Field(description="The quantity, as in `/degradation`")
    fraction: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False, strict=True)] | None = Field(
        default=None, description="The life ends when the quantity has fallen to this share of its initial value"
    )
    below: _Value | None = Field(
        default=None, description="The life ends when it falls below this value; the default for a slope is 0"
    )
    above: _Value | None = Field(default=None, description="The life ends when it rises above this value")
    pressure_bar: Annotated[PositiveNumber, Field(le=base.MAX_CRITERION_PRESSURE_BAR)] | None = Field(
        default=None,
        description="Line pressure, bar; required, except for mean COF: there the default is the mean over all pressures",
    )
    speed_rpm: Annotated[PositiveNumber, Field(le=base.MAX_SPEED_RPM)] | None = Field(
        default=None, description="Speed of a slope, rpm"
    )
    frequency_hz: PositiveNumber | None = Field(default=None, description="Frequency of a quantity of loops, Hz")

    @model_validator(mode="before")
    @classmethod
    def _has_a_limit(cls, given: Any) -> Any:
        """The criterion with a default limit: 0 for a slope, where friction begins to fall with speed; half of its
        initial value for mean COF."""
        if not isinstance(given, dict) or not isinstance(given.get("quantity"), str):
            return given
        named: str = given["quantity"]
        quantity = ALIASES.get(named, named)
        limits = [given.get(name) for name in ("fraction", "below", "above")]
        usual = {"slope": {"below": 0.0}, "mean_cof": {"fraction": 0.5}} if limits == [None] * 3 else {}
        return given | {"quantity": quantity} | usual.get(quantity, {})

    @model_validator(mode="after")
    def _is_one_limit_at_one_place(self) -> Self:
        """Refuses a criterion without exactly one limit, or without the pressure, speed or frequency that its quantity
        needs."""
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
Quantiles = dict[str, Real | None]


_Limited = Annotated[QuantityName, Field(description="The quantity that is compared with the limit")]
_Fraction = Annotated[Real | None, Field(description="Limit over initial value; null where the limit is a value")]
_Below = Annotated[Real | None, Field(description="The value below which the life ends")]
_Above = Annotated[Real | None, Field(description="The value above which the life ends")]
_Pressure = Annotated[Real | None, Field(description="Line pressure, bar; null: the mean over the reference pressures")]
_Speed = Annotated[Real | None, Field(description="Speed of a slope, rpm")]
_Frequency = Annotated[Real | None, Field(description="Frequency of a quantity of loops, Hz")]
_Initial = Annotated[Real | None, Field(description="The quantity when new, as tracked")]
_LimitValue = Annotated[Real | None, Field(description="The value of the quantity that ends the life")]


class Criterion(Answer):
    """The criterion that will most probably end the life; null before the first measurement."""

    quantity: _Limited
    fraction: _Fraction
    below: _Below = None
    above: _Above = None
    initial: _Initial = None
    limit: _LimitValue = None
    initial_mean_cof: Real | None = Field(description="Mean COF when new, as tracked; null for other quantities")
    threshold_mean_cof: Real | None = Field(description="Mean COF at the end of life; null for other quantities")
    pressure_bar: _Pressure
    speed_rpm: _Speed = None
    frequency_hz: _Frequency = None


class CriterionValue(Answer):
    """The present value of a quantity; with too few tests the last measured value, or null."""

    value: Real | None = Field(description="Its mean, as tracked")
    sd: Real | None = Field(description="Its standard deviation")


class CriterionOutcome(Answer):
    """One of the criteria: when it would end the life by itself, and the probability that it is reached first."""

    quantity: _Limited
    pressure_bar: _Pressure
    speed_rpm: _Speed = None
    frequency_hz: _Frequency = None
    fraction: _Fraction
    below: _Below = None
    above: _Above = None
    initial: _Initial = None
    limit: _LimitValue = None
    end_of_life_cycles: Quantiles = Field(description="Quantiles of the duty cycles since new at its limit")
    remaining_cycles: Quantiles = Field(description="Quantiles of the remaining duty cycles, by probability")
    probability_of_reaching: Real | None = Field(description="Probability that the limit is reached by the horizon")
    current: CriterionValue = Field(description="The present value of the quantity")
    probability_first: Real = Field(description="Probability that this limit is reached before the others")
    tests: int = Field(description="Number of tests that measured the quantity there")


class LifeNumber(Answer):
    """The life that an answer concerns. A rebuild begins a new life."""

    number: int = Field(description="Its number, from 1 on")
    of: int = Field(description="How many lives the clutch has had")
    from_cycles: Real | None = Field(description="Duty cycles since new at which it began; null before the first run")
    rebuild: str | None = Field(description="The run_id of the rebuild that began it; null for the first")


class Current(Answer):
    """The clutch's present state; null before the first measurement. With too few tests, it holds only the last
    measured mean COF.
    """

    mean_cof: Real | None = Field(description="Mean COF, as tracked")
    mean_cof_sd: Real | None = Field(description="Its standard deviation")
    measured_at_cycles: Real | None = Field(description="Duty cycles since new at which it was measured last")
    fraction_of_initial: Real | None = Field(description="Mean COF over its value when new")
    health: Real | None = Field(
        description="Remaining share of the way to the limit, for the worst criterion: 1 when new, 0 at the end of life"
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
        description="What eq. 6 counts: duty cycles, sliding distance or dissipated energy"
    )
    exponent: Real = Field(description="Exponent of a duty cycle's distance or energy")


Model = Annotated[ModelName, Field(description="The model that the answer was computed with")]
Prior = Annotated[PriorName, Field(description="The prior that the answer was computed with")]
SeverityUsed = Annotated[SeverityName, Field(description="The argument of eq. 6")]


class CourseShare(Answer):
    """A kind of course that mean COF may take, by the order n of its kinetics dD/dζ = ∓k Dⁿ."""

    name: Literal["eq6", "slowing", "accelerating"] = Field(
        description="`eq6` (order above 1), `slowing` in another way, or `accelerating`"
    )
    probability: Real = Field(description="Its probability")
    order: Real | None = Field(description="The median of its order n; null for a logarithm alone")


class BackCastCount(Answer):
    """How well earlier forecasts predicted the later tests, and what follows for this forecast."""

    held: int = Field(description="Number of tests within the 90 % interval of their forecast")
    of: int = Field(description="Number of tests with an earlier forecast")
    widening: Real = Field(
        description="How much the interval below the median was widened because tests lay below earlier forecasts "
        "(exponent of remaining life over its median); 1: not at all"
    )
    widening_later: Real = Field(
        description="The same of the interval above the median, because tests lay above earlier forecasts; it does not "
        "change the safe bound"
    )


class SampleQuality(Answer):
    """The weighted draws that a prediction is made of."""

    effective_draws: Real = Field(description="Effective number of draws")
    status: Literal["sound", "few_draws"] = Field(
        description="`few_draws`: fewer than 100 draws count, the outer quantiles are rough; compare with `grid`"
    )


class Course(CourseShare):
    """The most probable kind of course, and the others."""

    alternatives: list[CourseShare] = Field(description="The other kinds, most probable first")


class HeldRuns(Answer):
    """The remaining life with the held runs."""

    count: int = Field(description="Number of held runs of the clutch")
    status: str = Field(description="The status of the prediction with them")
    remaining_cycles: Quantiles = Field(description="Quantiles of the remaining duty cycles with them, by probability")


#: The safe bound.
AtLeast = Annotated[
    Real | None,
    Field(
        description="Safe bound: with a probability of 95 % the clutch lasts this number of duty cycles or more. The "
        "lower of the values with and without held runs, at most up to the horizon; null before the "
        "first test"
    ),
]
AtLeastAt = Annotated[
    str | None,
    Field(
        description="Date of the safe bound at the requested pace, or at the pace that `started_at` of the "
        "present life's runs shows, counted from the last run: it may be past. UTC, ISO 8601; null without a pace, or "
        "for an earlier time"
    ),
]
CountedFrom = Annotated[
    str | None, Field(description="Date of the last run, from which `at_least_at` counts; null where that is null")
]
Held = Annotated[
    HeldRuns | None,
    Field(description="What held runs of that life by then would make of the remaining life; null where none is held"),
]


Statement = Annotated[str, Field(description="The remaining life in a sentence")]


Status = Literal["predicted", "reached", "may_never_reach", "insufficient_data", "ended"]


class DeclaredEnd(Answer):
    """The declared end of a life (maintenance with the event `end_of_life`)."""

    cycles: Real = Field(description="Duty cycles since new at the end")
    reason: EndReason = Field(description="`worn`: nothing remains; `other`: it was taken out before its end")
    run_id: str = Field(description="The run that declares it; if you withdraw this run, the life goes on")


class LifePrediction(Answer):
    """What is predicted of a life at some cycles; stored after every run."""

    as_of_cycles: Real | None = Field(description="Duty cycles since new at which the remaining cycles begin")
    runs_used: int = Field(description="Number of stationary tests that the prediction uses")
    status: Status = Field(
        description="`predicted`; `reached` (more likely than not); `may_never_reach` (a quantile lies beyond the"
        " horizon); `insufficient_data`; `ended` (declared)"
    )
    criterion: Criterion = Field(description="The end-of-life criterion")
    current: Current = Field(description="The clutch's present state")
    remaining_cycles: Quantiles = Field(description="Quantiles of the remaining duty cycles, by probability")
    end_of_life_cycles: Quantiles = Field(description="Quantiles of the duty cycles since new at the end of life")
    at_least: AtLeast
    probability_of_reaching: Real | None = Field(description="Probability that the threshold is reached by the horizon")
    course: Course | None = Field(
        default=None,
        description="The most probable course of mean COF; null without a prediction or a criterion on mean COF",
    )
    back_cast: BackCastCount | None = Field(
        default=None, description="How well earlier forecasts of this clutch predicted the later tests"
    )
    ended_lives: int = Field(
        default=0, description="Number of ended lives of the same kind that calibrated the predicted end"
    )
    ended: DeclaredEnd | None = Field(default=None, description="The declared end of the life; null while it goes on")
    sample: SampleQuality | None = Field(
        default=None, description="The draws behind the prediction; null without a prediction"
    )
    horizon_cycles: Real = Field(
        description="The prediction goes no further than this many duty cycles since new: a million, or ten times "
        "its age if that is more"
    )
    warnings: list[Warned] = Field(description="Warnings, such as a last test far off its prediction")
    model: Model
    prior: Prior
    severity: SeverityUsed


class PredictionOf(Answer):
    """Of which clutch a prediction is, and by which filter."""

    clutch_id: ClutchName
    method: Method
    revision: Revision
    origin: Origin


class RemainingLife(LifePrediction, PredictionOf):
    """The remaining duty cycles until mean COF has fallen to the criterion's fraction of its initial value."""

    life: LifeNumber | None = Field(
        default=None, description="The life that the answer concerns, if a life or criterion was requested"
    )
    at_least_at: AtLeastAt
    counted_from: CountedFrom
    held_runs: Held
    statement: Statement
    criteria: list[CriterionOutcome] = Field(
        default=[], description="All criteria, each with its own end and the probability of being reached first"
    )


class PlannedBlock(Schema):
    """A block of planned duty cycles. Without a stated severity it counts as recent duty."""

    cycles: Annotated[PositiveNumber, Field(ge=base.MIN_BLOCK_CYCLES, le=base.MAX_CYCLES)] = Field(
        description="Duty cycles in the block"
    )
    energy_per_cycle_kj: Annotated[PositiveNumber, Field(ge=base.MIN_PLANNED_KJ)] | None = Field(
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
        """The block; ValueError with a reason if a field has no effect without another field."""
        if self.sd > 0.0 and self.energy_per_cycle_kj is None:
            raise ValueError("sd needs energy_per_cycle_kj: it is the standard deviation of this energy")
        if self.sd > (self.energy_per_cycle_kj or 0.0):
            raise ValueError("sd must not be larger than energy_per_cycle_kj")
        if self.initial_speed_rpm is None and (self.engagement_duration_s or self.maximum_pressure_bar):
            raise ValueError("engagement_duration_s and maximum_pressure_bar need initial_speed_rpm")
        return self


class ProgrammeIn(Schema):
    """Blocks of duty, which are repeated until the end of life."""

    programme: Annotated[tuple[PlannedBlock, ...], Field(min_length=1, max_length=base.MAX_BLOCKS)] = Field(
        description="The blocks of duty"
    )
    pace_cycles_per_hour: PositiveNumber | None = Field(
        default=None, description="Duty cycles per hour, idle hours included; default: the pace of the dated runs"
    )
    counted_by: Literal["dissipated_energy", "cycles"] | None = Field(
        default=None,
        description="For a clutch whose record counts cycles: whether a planned cycle counts by its energy "
        "relative to recent duty, or as one cycle; default: by energy if blocks and duty runs state "
        "it",
    )


class PlannedLife(RemainingLife):
    """Remaining life under planned duty: `remaining_cycles` and `end_of_life_cycles` are those of the programme."""

    recent_duty_cycles: Quantiles = Field(description="Quantiles of the remaining cycles if recent duty goes on")
    remaining_blocks: Quantiles = Field(
        description="Quantiles of the blocks until the end, the last one in part; the programme begins again after its last"
    )
    block_severity: list[Real | None] = Field(
        description="Cycles of recent duty that one cycle of each block is worth (median); null without a prediction"
    )
    end_of_life_at: dict[str, str | None] | None = Field(
        description="Quantiles of the date of the end, UTC, ISO 8601; null if no pace is known"
    )
    counted_by: Literal["cycles", "sliding_distance", "dissipated_energy"] = Field(
        description="What a planned cycle was counted by"
    )
    pace_cycles_per_hour: Real | None = Field(description="Duty cycles per hour, from which the dates were computed")
    pace_from: Literal["request", "runs"] | None = Field(
        description="Origin of the pace: the request, or the dated runs of the present life"
    )
