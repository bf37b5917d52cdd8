"""Diagnoses, the jobs that make them, and adopted models; fields that are not known, or not yet, are null or empty."""

from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from service.schemas.base import LONGEST_DIAGNOSIS_ID, Answer, ClutchName, Identifier, Revision, Schema, page_of
from service.schemas.life import ModelName

Number = float | None
Numbers = list[float | None]
Table = list[list[float | None]]
JobState = Literal["waiting", "running", "finished", "failed", "cancelled"]
DiagnosisName = Annotated[str, Field(description="The diagnosis' name")]


class DiagnosisIn(Schema):
    """A request for a diagnosis."""

    adopt: Annotated[bool, Field(strict=True)] = Field(
        default=False, description="Whether to adopt the extended model, if there is one"
    )
    isolability: Annotated[bool, Field(strict=True)] = Field(
        default=False, description="Whether to say which causes these tests could tell apart"
    )


class ModelIn(Schema):
    """A request to adopt a model."""

    diagnosis_id: Annotated[str, StringConstraints(min_length=1, max_length=LONGEST_DIAGNOSIS_ID)] | None = Field(
        description="The diagnosis whose extended model is adopted; null returns to the baseline"
    )


class Amplitude(Answer):
    """An effect's amplitude in engineering units."""

    name: str = Field(description="What the amplitude is")
    value: Number = Field(description="Estimate")
    sd: Number = Field(description="Its standard deviation")
    unit: str = Field(description="Its unit")
    interval: list[Number] = Field(default_factory=list, description="Its 90 % interval, lower and upper end")


class ExplanationOut(Answer):
    """What may be at work, all of it: explanations exclude each other, and their probabilities sum to one."""

    effects: list[str] = Field(
        description="Slugs of the effects; `uncatalogued` for something that no effect of the catalogue is; empty: nothing"
    )
    probability: Number = Field(description="Probability that these and no others are at work")
    sign_probability: Number = Field(
        default=None,
        description="Probability that the signs of the estimated amplitudes are right; null where there is none",
    )


class CandidateOut(Answer):
    """An effect that competed with the others and with the baseline."""

    effect: str = Field(description="The effect's slug")
    title: str = Field(description="The effect in a few words")
    probability: Number = Field(description="Probability that the effect is at work")
    log_evidence_gain: Number = Field(description="Gain in log evidence over the baseline, nats")
    estimate: Amplitude = Field(description="Its amplitude")
    beside: list[str] = Field(
        default_factory=list,
        description="Effects fitted together with it; evidence and estimate are of that fit",
    )
    fit: str | None = Field(
        default=None,
        description="How that fit ended: `converged`, `stalled`, or `out_of_steps` (not at its end); null if there is none",
    )


class WhereOut(Answer):
    """An axis over which residuals have structure."""

    axis: str = Field(description="A channel, or `test_clock_s`, `cycles` or `loop_phase`")
    strength: Number = Field(description="Log evidence for structure over this axis, nats")
    p_value: Number = Field(description="Probability of as much structure by chance")


class MisfitOut(Answer):
    """The error of a model."""

    rmse_nm: Number = Field(description="Root mean square of the residuals, Nm")
    noise_nm: Number = Field(description="What noise and run-to-run scatter alone would give, Nm")
    unexplained_share: Number = Field(description="Share of the residuals' variance beyond noise")
    where: list[WhereOut] = Field(description="The axes over which residuals have structure, strongest first")


class BeforeAndAfter(Answer):
    """Remaining useful life under both models, in the form of `/remaining-useful-life`."""

    before: dict[str, object] = Field(description="Under the baseline")
    after: dict[str, object] = Field(description="Under the extended model")


class GainOut(Answer):
    """What the extended model gains on held-out runs."""

    held_out_runs: list[str] = Field(description="The runs that were held out")
    rmse_before_nm: Number = Field(description="The baseline's error, RMS, Nm")
    rmse_after_nm: Number = Field(description="The extended model's error, RMS, Nm")
    reduction_percent: Number = Field(description="Reduction of the error, %")
    reduction_percent_sd: Number = Field(description="Its standard deviation, paired by points")
    excess_before_nm: Number = Field(description="The baseline's error beyond noise, Nm")
    excess_after_nm: Number = Field(description="The extended model's error beyond noise, Nm")
    mse_percent_before: Number = Field(description="The baseline's percentage MSE (eq. 5), %")
    mse_percent_after: Number = Field(description="The extended model's percentage MSE (eq. 5), %")
    log_score_gain: Number = Field(description="Gain in log score, nats")
    prediction_log_score_gain: Number = Field(
        description="Gain in log score when the last states are predicted from the first ones, nats"
    )
    remaining_useful_life: BeforeAndAfter = Field(description="Remaining useful life under both models")


class AdviceOut(Answer):
    """A test that would distinguish two effects, or an effect from the baseline."""

    key: str = Field(description="The test in a word for programs")
    test: str = Field(description="The test in a sentence")
    separates: list[str] = Field(description="The two effects that it distinguishes; `baseline` stands for none")
    nats: Number = Field(description="Expected gain in log evidence, nats")
    probability: Number = Field(default=None, description="Probability that it leaves one explanation alone")
    narrows: Number = Field(
        default=None,
        description="Of a named cause, the standard deviation of its size after the test as a share of today's; else null",
    )
    minutes: Number = Field(default=None, description="Minutes on the rig, those of the duty cycles before it included")
    steps: list["PlanStep"] = Field(default_factory=list, description="What the rig is to do, in order")


class PlanStep(Answer):
    """One test of a plan."""

    kind: str = Field(description="`stationary_stribeck` or `dynamic_stribeck`")
    pressures_bar: list[float] = Field(description="Line pressures in the order in which they are set, bar")
    speeds_rpm: list[float] = Field(
        description="Speeds in the order in which they are set, rpm; of a dynamic test the lowest and the highest"
    )
    frequency_hz: Number = Field(description="Frequency of the speed of a dynamic test, Hz; else null")
    periods: int | None = Field(description="Periods at each pressure of a dynamic test; else null")
    oil_temperature_c: Number = Field(description="Oil temperature, °C; null: as usual")
    repeats: int = Field(description="How often the test is made")
    cycles: Number = Field(description="Duty cycles since new at which it is made")
    pause_hours: Number = Field(description="Rest before it, hours")
    minutes: Number = Field(description="Minutes on the rig")


class PlanOut(Answer):
    """The tests that a diagnosis advises as a protocol: at most three alternatives, each with its steps in order."""

    clutch_id: ClutchName
    diagnosis_id: DiagnosisName
    relation: Literal["alternatives"] = Field(description="How the tests are meant: one of them is enough")
    tests: list[AdviceOut] = Field(description="The tests, best first: alternatives, each with its steps in order")


class VisibleOut(Answer):
    """The smallest amplitude of an effect that would be detected in these data with 90 % power."""

    effect: str = Field(description="The effect's slug")
    amplitude: Number = Field(
        description="The amplitude, in whatever of the effect's shapes; null where one of them would be absorbed whole"
    )
    least: Number = Field(default=None, description="The same in the shape that shows best")
    unit: str = Field(description="Its unit")


class PairOut(Answer):
    """Two effects: whether these tests could tell them apart, and the test that would."""

    effects: list[str] = Field(description="Their slugs")
    probability: Number = Field(
        description="The probability that either, at twice its visible amplitude, is told from the other"
    )
    apart: bool = Field(description="Whether that is sure enough")
    key: str | None = Field(
        description="The shortest test that is sure to part them, or the one that helps most; null: none"
    )
    test: str | None = Field(description="The same in words")
    with_test: Number = Field(description="The probability with that test beside these")


class IsolabilityOut(Answer):
    """Which causes these tests could tell apart, from their design alone: before anything is hidden in them."""

    pairs: list[PairOut] = Field(description="The pairs of effects that these tests can show, hardest first")
    unseen: list[str] = Field(description="The slugs of the effects that these tests cannot show at all")


class Axes(Answer):
    """The axes of the residual maps."""

    pressure_bar: list[float] = Field(description="Line pressure, bar")
    speed_rpm: list[float] = Field(description="Sliding speed, rpm")
    cycles: list[float] = Field(description="Duty cycles since new")


class ResidualMap(Answer):
    """Mean residuals, in standard deviations."""

    speed_pressure: Table = Field(description="A row a pressure, a column a speed")
    pressure_cycles: Table = Field(description="A row a count of cycles, a column a pressure")


class MapsOut(Answer):
    """Residual maps of both models."""

    axes: Axes = Field(description="Their axes")
    before: ResidualMap = Field(description="Under the baseline")
    after: ResidualMap = Field(description="Under the extended model")


class LoopTraceOut(Answer):
    """A friction loop over one period: measured, and of both models."""

    pressure_bar: float = Field(description="Line pressure, bar")
    cycles: float = Field(description="Duty cycles since new")
    frequency_hz: Number = Field(description="Frequency of the speed, Hz")
    speed_rpm: Numbers = Field(description="Sliding speed, rpm")
    measured_nm: Numbers = Field(description="Measured torque, Nm")
    baseline_nm: Numbers = Field(description="Torque under the baseline, Nm")
    extended_nm: Numbers = Field(description="Torque under the extended model, Nm")


class DiagnosisListed(Answer):
    """A diagnosis without its maps and loops. While it runs, and where it failed, it has no verdict."""

    diagnosis_id: DiagnosisName
    clutch_id: ClutchName
    status: Literal["running", "finished", "failed"] = Field(
        description="Whether it still runs, has finished, or failed"
    )
    created_at: str = Field(description="When it was requested; UTC, ISO 8601")
    finished_at: str | None = Field(description="When it ended; UTC, ISO 8601")
    revision: Revision
    as_of_cycles: Number = Field(description="Duty cycles since new of the latest run in it")
    stale: bool = Field(description="Whether runs were posted since")
    earlier_life: bool = Field(description="Whether a rebuild has ended the life that it diagnosed")
    adoptable: bool = Field(description="Whether it has an extended model to adopt")
    not_adoptable: str | None = Field(
        default=None,
        description="Why a cause that was fitted gives nothing to adopt; null where it does, or none was fitted",
    )
    adopted: bool = Field(description="Whether its model is in force")
    problem: str | None = Field(description="Why it failed")
    code_version: str = Field(description="The release that made it")
    verdict: (
        Literal["model_adequate", "cause_named", "cause_ambiguous", "unexplained_structure", "insufficient_data"] | None
    ) = Field(description="The result in a word")
    causes: list[str] = Field(
        description="The named causes, or those that these data cannot distinguish, by their slugs; `uncatalogued` among "
        "the latter stands for something that no effect of the catalogue is"
    )
    summary: str = Field(description="The result in a paragraph")
    explanations: list[ExplanationOut] = Field(
        default_factory=list, description="What may be at work, most probable first; verdict and causes are read off it"
    )
    candidates: list[CandidateOut] = Field(description="The effects that competed, most probable first")
    baseline: MisfitOut = Field(description="The baseline's error")
    extended: MisfitOut = Field(description="The extended model's error")
    gain: GainOut = Field(description="What the extended model gains on held-out runs")
    advice: list[AdviceOut] = Field(description="Tests that would distinguish what these data do not")
    visible: list[VisibleOut] = Field(description="The smallest amplitude of each effect that would be detected")
    notes: list[str] = Field(description="Assumptions and omissions")
    statistics: dict[str, Number] = Field(description="Numbers of the computation, by name")


class DiagnosisOut(DiagnosisListed):
    """A diagnosis with its residual maps and loops."""

    maps: MapsOut | None = Field(description="Residual maps; null without a verdict")
    loops: list[LoopTraceOut] = Field(description="Measured friction loops beside both models'")
    isolability: IsolabilityOut | None = Field(
        default=None, description="Which causes these tests could tell apart; null where it was not asked for"
    )


DiagnosisPage = page_of("DiagnosisPage", DiagnosisListed, "Diagnoses, newest first.", "The diagnoses of this page")


class ModelVersion(Answer):
    """A model that was adopted."""

    version: int = Field(description="Its number, from 1")
    diagnosis_id: str | None = Field(description="The diagnosis that it comes from; null is the baseline")
    adopted_at: str = Field(description="When it was adopted; UTC, ISO 8601")
    model: ModelName = Field(description="The model")


class ModelOut(Answer):
    """The model that tracking and remaining life use now, and all that were adopted.

    A rebuild ends the life that was diagnosed: from then on the baseline is in force, whatever version is the last.
    """

    clutch_id: ClutchName
    model: ModelName = Field(description="The model in force")
    version: int = Field(description="Its number; 0 where none was adopted")
    diagnosis_id: str | None = Field(description="The diagnosis that it comes from; null is the baseline")
    versions: list[ModelVersion] = Field(description="All adopted models, newest first")


class JobIn(Schema):
    """A job that is asked for."""

    kind: Literal["replay", "fleet_refresh"] = Field(
        description="`replay`: results are recomputed from the raw runs; `fleet_refresh`: what clutches of a kind share"
    )
    clutch_id: Identifier | None = Field(
        default=None, description="The clutch that is replayed; null or left out, all. A fleet refresh is of all"
    )

    @model_validator(mode="after")
    def _of_all(self) -> Self:
        if self.kind == "fleet_refresh" and self.clutch_id is not None:
            raise ValueError("a fleet_refresh is of all clutches: leave clutch_id out")
        return self


class JobProgress(Answer):
    """How far a job has come."""

    step: str = Field(description="What it does")
    done: int | None = Field(
        default=None, description="How many of the things that this takes are done; null: not counted"
    )
    of: int | None = Field(default=None, description="How many there are")


class LeftClutch(Answer):
    """A clutch that keeps what it had."""

    clutch_id: ClutchName
    reason: str = Field(description="Why")


class JobResult(Answer):
    """What a replay or a fleet refresh did."""

    replayed: int | None = Field(default=None, description="Clutches whose results were recomputed, of a replay")
    kinds: int | None = Field(default=None, description="Kinds that have a new version of their prior, of a refresh")
    changed: int | None = Field(default=None, description="Clutches whose predictions have changed, of a refresh")
    left: int = Field(description="Clutches that keep what they had")
    reasons: list[LeftClutch] = Field(description="Why, of the first 20 of them")


class JobOut(Answer):
    """What was asked for and is computed by a service when its turn comes. That of a diagnosis has the diagnosis' name."""

    job_id: str = Field(description="The job's name")
    kind: Literal["diagnosis", "replay", "fleet_refresh"] = Field(description="What it computes")
    clutch_id: str | None = Field(description="The clutch that it is of; null where it is of no single one")
    state: JobState = Field(
        description="`waiting` for its turn, `running`, or how it ended: `finished`, `failed` or `cancelled`"
    )
    asked_at: str = Field(description="When it was asked for; UTC, ISO 8601")
    asked_by: str = Field(description="Who asked: `key:ID NOTE`, or `local`")
    started_at: str | None = Field(description="When it was begun, the last time; null before")
    finished_at: str | None = Field(description="When it ended; null before")
    attempts: int = Field(description="How often it was begun: again where the service that had it was killed")
    progress: JobProgress | None = Field(description="How far it has come; null before it says so")
    problem: str | None = Field(description="Why it failed, or who cancelled it")
    result: JobResult | None = Field(description="What it did; null before its end, and of a diagnosis")


JobPage = page_of("JobPage", JobOut, "A page of jobs, newest first.", "The jobs")
