"""Diagnoses and adopted models as they go out; what is not known, or not yet, is null or empty."""

from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from service.schemas.base import Answer, Schema
from service.schemas.life import ModelName

Number = float | None
Numbers = list[float | None]
Table = list[list[float | None]]


class DiagnosisIn(Schema):
    """What is asked: whether an extended model is to be adopted where one is found."""

    adopt: Annotated[bool, Field(strict=True)] = False


class ModelIn(Schema):
    """The diagnosis whose extended model is adopted; null returns to the baseline."""

    diagnosis_id: Annotated[str, StringConstraints(min_length=1, max_length=64)] | None


class Amplitude(Answer):
    """An effect's amplitude in engineering units."""

    name: str
    value: Number
    sd: Number
    unit: str


class CandidateOut(Answer):
    """An effect that competed, its probability and its gain in log evidence over the baseline [nats]; evidence and estimate
    are of the fit together with the effects `beside` it."""

    effect: str
    title: str
    probability: Number
    log_evidence_gain: Number
    estimate: Amplitude
    beside: list[str] = Field(default_factory=list)


class WhereOut(Answer):
    """An axis on which structure lives, its strength in nats."""

    axis: str
    strength: Number
    p_value: Number


class MisfitOut(Answer):
    """How well a model fits; `unexplained_share` of the variance is beyond noise."""

    rmse_nm: Number
    noise_nm: Number
    unexplained_share: Number
    where: list[WhereOut]


class BeforeAndAfter(Answer):
    """Remaining useful life, as `/remaining-useful-life` says it, under the baseline and under the extension."""

    before: dict[str, object]
    after: dict[str, object]


class GainOut(Answer):
    """What the extension gains on runs held out; `excess` is the error beyond noise.

    Log scores are in nats, the last one in foretelling the last states from the first.
    """

    held_out_runs: list[str]
    rmse_before_nm: Number
    rmse_after_nm: Number
    reduction_percent: Number
    reduction_percent_sd: Number
    excess_before_nm: Number
    excess_after_nm: Number
    mse_percent_before: Number
    mse_percent_after: Number
    log_score_gain: Number
    foretelling_log_score_gain: Number
    remaining_useful_life: BeforeAndAfter


class AdviceOut(Answer):
    """A test that would decide between two effects, or an effect and the baseline; `nats` is what it is to bring."""

    key: str
    test: str
    separates: list[str]
    nats: Number


class VisibleOut(Answer):
    """The smallest amplitude of an effect that these data would have shown with 90 % power in its middle shape."""

    effect: str
    amplitude: Number
    unit: str


class Axes(Answer):
    """The axes of the residual maps."""

    pressure_bar: list[float]
    speed_rpm: list[float]
    cycles: list[float]


class ResidualMap(Answer):
    """Mean residuals in deviations: a row a pressure and a column a speed; a row a count of cycles, a column a pressure."""

    speed_pressure: Table
    pressure_cycles: Table


class MapsOut(Answer):
    """Residuals under the baseline and under the extension."""

    axes: Axes
    before: ResidualMap
    after: ResidualMap


class LoopTraceOut(Answer):
    """A friction loop over one period: measured, and what the two models give."""

    pressure_bar: float
    cycles: float
    frequency_hz: Number
    speed_rpm: Numbers
    measured_nm: Numbers
    baseline_nm: Numbers
    extended_nm: Numbers


class DiagnosisListed(Answer):
    """A diagnosis without its maps and loops. While it runs, and where it failed, it has no verdict."""

    diagnosis_id: str
    clutch_id: str
    status: Literal["running", "finished", "failed"]
    created_at: str
    finished_at: str | None
    revision: int
    as_of_cycles: Number
    stale: bool
    earlier_life: bool
    adoptable: bool
    adopted: bool
    problem: str | None
    code_version: str
    verdict: (
        Literal["model_adequate", "cause_named", "cause_ambiguous", "unexplained_structure", "insufficient_data"] | None
    )
    causes: list[str]
    summary: str
    candidates: list[CandidateOut]
    baseline: MisfitOut
    extended: MisfitOut
    gain: GainOut
    advice: list[AdviceOut]
    visible: list[VisibleOut]
    notes: list[str]
    statistics: dict[str, Number]


class DiagnosisOut(DiagnosisListed):
    """A diagnosis with its residual maps and loops."""

    maps: MapsOut | None
    loops: list[LoopTraceOut]


class DiagnosisPage(Answer):
    """Diagnoses, newest first."""

    items: list[DiagnosisListed]
    next: str | None


class ModelVersion(Answer):
    """A model that was adopted; `diagnosis_id` null is the baseline."""

    version: int
    diagnosis_id: str | None
    adopted_at: str
    model: ModelName


class ModelOut(Answer):
    """The model that tracking and remaining life use now, and all that were adopted, newest first.

    A rebuild ends the life that was diagnosed: from then on the baseline is in force, whatever version is the last.
    """

    clutch_id: str
    model: ModelName
    version: int
    diagnosis_id: str | None
    versions: list[ModelVersion]
