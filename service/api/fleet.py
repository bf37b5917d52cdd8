"""The fleet's priors, and the scores of predictions."""

from pydantic import Field

from service.api.base import Answer, ClutchName, Next, Origin, Page, Real, Revision
from service.api.life import Method, Model, Prior, Quantiles, SeverityUsed


class Kind(Answer):
    """The fields that clutches with a common prior share."""

    friction_material: str = Field(description="The friction material")
    reaction_plate: str = Field(description="The reaction plate's material")
    fluid: str = Field(description="The fluid")
    origin: Origin
    severity: SeverityUsed


class Share(Answer):
    """Δ over ξ0 among the clutches of a fleet."""

    median: Real = Field(description="Median")
    sd: Real = Field(description="Standard deviation")


class Factor(Answer):
    """A positive coefficient among the clutches of a fleet."""

    median: Real = Field(description="Median")
    log_sd: Real = Field(description="Standard deviation of its logarithm")


class Population(Answer):
    """The coefficients of eq. 6 among the clutches of a fleet."""

    change: Share = Field(description="Change Δ as a share of ξ0")
    scale_cycles: Factor = Field(description="Scale φ, duty cycles")
    exponent: Factor = Field(description="Exponent ε")
    scatter: Factor = Field(description="Scatter from run to run as a share of ξ0")


class SeverityEstimate(Answer):
    """The exponent of a duty cycle's energy, estimated from ended lives."""

    value: Real = Field(description="Estimate")
    sd: Real = Field(description="Its standard deviation")


class FleetPriorOut(Answer):
    """The prior learned from clutches of one kind. Each member is tracked under the prior of the others."""

    kind: Kind = Field(description="The kind of clutch")
    version: int = Field(description="Increases whenever the prior changes")
    created_at: str = Field(description="When this version was learned; UTC, ISO 8601")
    clutches: int = Field(description="Number of clutches that it was learned from")
    members: list[str] = Field(description="Their names")
    population: Population = Field(description="The coefficients among them")
    ended_lives: int = Field(description="Number of their lives that have ended; these calibrate later predictions")
    censored_lives: int = Field(description="Number of their lives that were taken out before their end")
    severity_exponent: SeverityEstimate | None = Field(
        description="Exponent by which the energy of a duty cycle shortened these lives; null if they do not determine it"
    )


class FleetPriorPage(Page[FleetPriorOut]):
    """The newest version of every kind's prior."""

    items: list[FleetPriorOut] = Field(description="The priors of this page")


class ScoreSummary(Answer):
    """Means over predictions; null without any."""

    predictions: int = Field(description="Number of predictions")
    crps_share: Real | None = Field(description="Continuous ranked probability score, as a share of the whole life")
    interval_share: Real | None = Field(description="Width of the 5 to 95 % interval, as a share of the whole life")
    coverage: Real | None = Field(description="Share of 5 to 95 % intervals that hold the truth; nominally 0.9")
    alpha_lambda: Real | None = Field(description="Share of medians within 20 % of the true remaining life")


class ScoredPrediction(Answer):
    """The prediction at one test, and its scores."""

    cycles: Real = Field(description="Duty cycles since new at the test")
    runs_used: int = Field(description="Number of stationary tests that the prediction uses")
    share_of_life: Real = Field(description="Share of the whole life at the test")
    true_remaining_cycles: Real = Field(description="True remaining duty cycles")
    remaining_cycles: Quantiles = Field(description="Quantiles of the remaining duty cycles as predicted")
    crps_cycles: Real = Field(description="Continuous ranked probability score, duty cycles")
    crps_share: Real = Field(description="The same as a share of the whole life")
    interval_share: Real = Field(description="Width of the 5 to 95 % interval, as a share of the whole life")
    covered: bool = Field(description="Whether the 5 to 95 % interval holds the truth")
    pit: Real = Field(description="Predicted probability that the life is at most as long as it was")
    alpha_lambda: bool = Field(description="Whether the median is within 20 % of the true remaining life")


class ScoredLife(Answer):
    """A life that has ended."""

    origin_cycles: Real = Field(description="Duty cycles since new at its start")
    end_of_life_cycles: Real = Field(description="Duty cycles since new at its end")
    prognostic_horizon_cycles: Real | None = Field(
        description="Remaining life from which on all medians were within 10 % of the whole life; null if none was"
    )
    summary: ScoreSummary = Field(description="Means over its predictions")
    pit_histogram: list[Real] = Field(description="Shares of predictions in ten equal bins of `pit`")
    predictions: list[ScoredPrediction] = Field(description="Its predictions, by cycles")
    model: Model
    prior: Prior
    severity: SeverityUsed


class Scores(Answer):
    """The lives of a clutch that have ended."""

    clutch_id: ClutchName
    method: Method
    revision: Revision
    items: list[ScoredLife] = Field(description="The lives of this page")
    next: Next


class EndedLife(Answer):
    """A life that was scored."""

    clutch_id: ClutchName
    origin_cycles: Real = Field(description="Duty cycles since new at its start")
    end_of_life_cycles: Real = Field(description="Duty cycles since new at its end")


class Stage(Answer):
    """A stage of life."""

    share_of_life: Real = Field(description="The middle of the stage, as a share of the whole life")


class StageSummary(ScoreSummary, Stage):
    """Means over predictions at one stage of life."""


class FleetScores(Answer):
    """All lives that have ended, together and by stage of life."""

    method: Method
    lives: list[EndedLife] = Field(description="The lives that were scored")
    overall: ScoreSummary = Field(description="Means over all predictions")
    stages: list[StageSummary] = Field(description="Means by stage of life")
    pit_histogram: list[Real] = Field(description="Shares of predictions in ten equal bins of `pit`")


class StateCounts(Answer):
    """Clutches by their state after NAMUR NE 107."""

    failure: int = Field(description="At their end of life")
    maintenance: int = Field(description="Near the end of their lives")
    check: int = Field(description="Clutches with held runs, or without a prognosis yet")
    out_of_specification: int = Field(description="Data and model disagree")
    normal: int = Field(description="None of these")


class FleetTotals(Answer):
    """The number of clutches, by state."""

    all: int = Field(description="Clutches in use, or archived ones if requested")
    archived: int = Field(description="Archived clutches")
    held: int = Field(description="Those of `all` that have runs that are held")
    alarms: int = Field(description="Alarms that nobody has acknowledged")
    states: StateCounts = Field(description="Those of `all` by their states")
    scale_cycles: Real = Field(
        description="End of the common scale for bars of remaining cycles (1, 2 or 5 times a power of ten). Nine "
        "of ten clutches with a prediction lie below it"
    )
