"""The fleet's priors and scores as they go out."""

from service.schemas.base import Answer, Origin
from service.schemas.life import Method, ModelName, PriorName, Quantiles, SeverityName


class Kind(Answer):
    """What clutches have in common that teach each other."""

    friction_material: str
    reaction_plate: str
    fluid: str
    origin: Origin
    severity: SeverityName


class Share(Answer):
    """Δ as a share of ξ0 among the clutches of a fleet."""

    median: float
    sd: float


class Factor(Answer):
    """A positive coefficient among the clutches of a fleet; `log_sd` is the deviation of its logarithm."""

    median: float
    log_sd: float


class Population(Answer):
    """Eq. 6's coefficients among the clutches of a fleet: change and scatter as shares of ξ0, scale in cycles."""

    change: Share
    scale_cycles: Factor
    exponent: Factor
    scatter: Factor


class FleetPriorOut(Answer):
    """What clutches of one kind have taught; a clutch among `members` is tracked under what the others taught."""

    kind: Kind
    version: int
    created_at: str
    clutches: int
    members: list[str]
    population: Population


class FleetPriorPage(Answer):
    """The newest version of every kind."""

    items: list[FleetPriorOut]
    next: str | None


class ScoreSummary(Answer):
    """Means over predictions, shares of the whole life; coverage is of the 5 to 95 % interval, nominally 0.9."""

    predictions: int
    crps_share: float | None
    interval_share: float | None
    coverage: float | None
    alpha_lambda: float | None


class ScoredPrediction(Answer):
    """What was said at one test, and how right it was; `alpha_lambda`: the median within 20 % of what remained."""

    cycles: float
    runs_used: int
    share_of_life: float
    true_remaining_cycles: float
    remaining_cycles: Quantiles
    crps_cycles: float
    crps_share: float
    interval_share: float
    covered: bool
    pit: float
    alpha_lambda: bool


class ScoredLife(Answer):
    """A life that came to its end; the prognostic horizon is the remaining life from which on all was within 10 % of it."""

    origin_cycles: float
    end_of_life_cycles: float
    prognostic_horizon_cycles: float | None
    summary: ScoreSummary
    pit_histogram: list[float]
    predictions: list[ScoredPrediction]
    model: ModelName
    prior: PriorName
    severity: SeverityName


class Scores(Answer):
    """The lives of a clutch that came to their end."""

    clutch_id: str
    method: Method
    revision: int
    items: list[ScoredLife]
    next: str | None


class EndedLife(Answer):
    """A life that was scored."""

    clutch_id: str
    origin_cycles: float
    end_of_life_cycles: float


class StageSummary(ScoreSummary):
    """Predictions at about this share of life."""

    share_of_life: float


class FleetScores(Answer):
    """All lives that came to their end, together and by stage of life; ten equal bins of PIT."""

    method: Method
    lives: list[EndedLife]
    overall: ScoreSummary
    stages: list[StageSummary]
    pit_histogram: list[float]
