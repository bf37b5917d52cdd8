"""Remaining useful life, and the assumptions that every answer names: model, prior, severity."""

from typing import Annotated, Literal

from pydantic import Field

from service.schemas.base import Answer, ClutchName, Origin, Revision
from service.schemas.prognosis.quantities import QuantityName
from service.schemas.run import EndReason, Warned

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
        description="When these have been run, at the pace that the `started_at` of the present life's runs show; UTC, ISO "
        "8601; null where they show none, or for an earlier time"
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
