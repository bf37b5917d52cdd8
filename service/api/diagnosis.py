"""Diagnoses, the jobs that make them, and adopted models; fields that are not known, or not yet, are null or empty."""

from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from service.api import base
from service.api.life import ModelName

Number = base.Real | None
Numbers = list[base.Real | None]
NumberTable = list[list[base.Real | None]]
JobState = Literal["waiting", "running", "finished", "failed", "cancelled"]
DiagnosisName = Annotated[str, Field(description="The diagnosis' name")]


class DiagnosisIn(base.Schema):
    """A request for a diagnosis."""

    adopt: Annotated[bool, Field(strict=True)] = Field(
        default=False, description="Whether to adopt the extended model, if there is one"
    )
    isolability: Annotated[bool, Field(strict=True)] = Field(
        default=False, description="Whether the report should say which causes these tests could distinguish"
    )


class ModelIn(base.Schema):
    """A request to adopt a model."""

    diagnosis_id: Annotated[str, StringConstraints(min_length=1, max_length=base.LONGEST_DIAGNOSIS_ID)] | None = Field(
        description="The diagnosis whose extended model is adopted; null returns to the baseline"
    )


class Amplitude(base.Answer):
    """An effect's amplitude in engineering units."""

    name: str = Field(description="What the amplitude is")
    value: Number = Field(description="Estimate")
    sd: Number = Field(description="Its standard deviation")
    unit: str = Field(description="Its unit")
    interval: list[Number] = Field(default_factory=list, description="Its 90 % interval, lower and upper end")


class ExplanationOut(base.Answer):
    """A possible explanation of the data. Explanations exclude each other, and their probabilities sum to one."""

    effects: list[str] = Field(
        description="Slugs of the effects; `uncatalogued`: something that is not in the catalogue; empty: no effect"
    )
    probability: Number = Field(description="Probability that exactly these are at work")
    sign_probability: Number = Field(
        default=None,
        description="Probability that the signs of the estimated amplitudes are right; null without amplitudes",
    )


class CandidateOut(base.Answer):
    """An effect that competed with the others and with the baseline."""

    effect: str = Field(description="The effect's slug")
    title: str = Field(description="The effect in a few words")
    probability: Number = Field(description="Probability that the effect is at work")
    log_evidence_gain: Number = Field(description="Gain in log evidence over the baseline, nats")
    estimate: Amplitude = Field(description="Its amplitude")
    isolability: Number = Field(
        default=None,
        description="Share of its evidence that is left when the friction curve may have another form than eq. 3, 0 to 1; "
        "below 0.5 it is never named; null if it was not fitted",
    )
    beside: list[str] = Field(
        default_factory=list,
        description="Effects that were fitted together with it; evidence and estimate belong to this fit",
    )
    fit: str | None = Field(
        default=None,
        description="How that fit ended: `converged`, `stalled`, or `out_of_steps` (not at its end); null if there is none",
    )


class WhereOut(base.Answer):
    """An axis on which the residuals depend."""

    axis: str = Field(description="A channel, or `test_clock_s`, `cycles` or `loop_phase`")
    strength: Number = Field(description="Log evidence for a dependence on this axis, nats")
    p_value: Number = Field(description="Probability of such a dependence by chance")


class MisfitOut(base.Answer):
    """The error of a model."""

    rmse_nm: Number = Field(description="Root mean square of the residuals, Nm")
    noise_nm: Number = Field(description="The error that noise and run-to-run scatter alone would give, Nm")
    unexplained_share: Number = Field(description="Share of the residuals' variance beyond noise")
    where: list[WhereOut] = Field(description="The axes on which the residuals depend, strongest first")


class BeforeAndAfter(base.Answer):
    """Remaining useful life under both models, in the form of `/remaining-useful-life`."""

    before: dict[str, object] = Field(description="Under the baseline")
    after: dict[str, object] = Field(description="Under the extended model")


class GainOut(base.Answer):
    """What the extended model gains on runs that were left out of the fit."""

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


class LawBandOut(base.Answer):
    """A range of speeds in which the friction curve differs from eq. 3."""

    axis: Literal["speed"] = Field(description="The channel")
    from_rpm: float = Field(description="Its lowest speed, rpm")
    to_rpm: float = Field(description="Its highest speed, rpm")
    share: float = Field(description="Its share of the squared difference, 0 to 1")


class LawGainOut(base.Answer):
    """What the friction law as found gains over eq. 3 on runs that were left out of the fit."""

    rmse_before_nm: Number = Field(description="The error of eq. 3, RMS, Nm")
    rmse_after_nm: Number = Field(description="The error of the law as found, RMS, Nm")
    reduction_percent: Number = Field(description="Reduction of the error, %")
    reduction_percent_sd: Number = Field(description="Its standard deviation, paired by points")
    log_score_gain: Number = Field(description="Gain in log score, nats")


class FrictionLawOut(base.Answer):
    """How the measured friction curve differs from eq. 3, whatever the verdict is."""

    rms_percent: float = Field(description="Difference from eq. 3, RMS over the plateaus, % of the torque")
    interval_percent: list[float] = Field(description="Its 90 % interval, %")
    where: list[LawBandOut] = Field(description="The speeds at which it differs, largest share first")
    effect_on_mean_cof_percent: float = Field(description="Change of mean COF at the last test against eq. 3, %")
    effect_on_remaining_cycles_percent: Number = Field(
        description="Change of the remaining cycles against eq. 3, %; null if no end is in sight under either"
    )
    gain: LawGainOut | None = Field(
        description="What it gains on held-out runs; null if eq. 3 is exact or none can be left out"
    )
    adoptable: bool = Field(
        description="Whether the law as found is proposed in place of eq. 3: it predicts held-out runs better, and what is "
        "at work is known"
    )


class LawCurveOut(base.Answer):
    """A friction curve at one pressure and count of cycles: measured, by eq. 3, and by the law as found."""

    pressure_bar: float = Field(description="Line pressure, bar")
    cycles: float = Field(description="Duty cycles since new")
    speed_rpm: Numbers = Field(description="Sliding speed, rpm")
    measured_nm: Numbers = Field(description="Measured torque, Nm")
    eq3_nm: Numbers = Field(description="Torque by eq. 3, Nm")
    law_nm: Numbers = Field(description="Torque by the law as found, Nm")
    law_sd_nm: Numbers = Field(description="Its standard deviation, Nm")


class AdviceOut(base.Answer):
    """A test that would distinguish two effects, or an effect from the baseline."""

    key: str = Field(description="Code of the test, for programs")
    test: str = Field(description="The test in a sentence")
    separates: list[str] = Field(description="The two effects that it distinguishes; `baseline` stands for none")
    nats: Number = Field(description="Expected gain in log evidence, nats")
    probability: Number = Field(
        default=None, description="Probability that only one explanation remains after the test"
    )
    narrows: Number = Field(
        default=None,
        description="For a named cause: standard deviation of its size after the test, as a share of today's; else null",
    )
    minutes: Number = Field(default=None, description="Minutes on the rig, including the duty cycles before the test")
    steps: list["PlanStep"] = Field(default_factory=list, description="The steps for the rig, in order")


class PlanStep(base.Answer):
    """One test of a plan."""

    kind: str = Field(description="`stationary_stribeck` or `dynamic_stribeck`")
    pressures_bar: list[base.Real] = Field(description="Line pressures in the order in which they are set, bar")
    speeds_rpm: list[base.Real] = Field(
        description="Speeds in the order in which they are set, rpm; for a dynamic test the lowest and the highest"
    )
    frequency_hz: Number = Field(description="Frequency of the speed of a dynamic test, Hz; else null")
    periods: int | None = Field(description="Periods at each pressure of a dynamic test; else null")
    oil_temperature_c: Number = Field(description="Oil temperature, °C; null: as usual")
    repeats: int = Field(description="How often the test is made")
    cycles: Number = Field(description="Duty cycles since new at the test")
    pause_hours: Number = Field(description="Rest before it, hours")
    minutes: Number = Field(description="Minutes on the rig")


class PlanOut(base.Answer):
    """The tests that a diagnosis advises as a protocol: at most three alternatives, each with its steps in order."""

    clutch_id: base.ClutchName
    diagnosis_id: DiagnosisName
    relation: Literal["alternatives"] = Field(description="How to use the tests: one of them is enough")
    tests: list[AdviceOut] = Field(description="The tests, best first: alternatives, each with its steps in order")


class VisibleOut(base.Answer):
    """The smallest amplitude of an effect that these data would show with 90 % probability."""

    effect: str = Field(description="The effect's slug")
    amplitude: Number = Field(
        description="The amplitude that is visible in every shape of the effect; null if the model would absorb "
        "one shape completely"
    )
    least: Number = Field(default=None, description="The amplitude that is visible in the most visible shape")
    unit: str = Field(description="Its unit")
    isolability: Number = Field(
        default=None,
        description="Share of its evidence that is left when the friction curve may have another form than eq. 3, 0 to 1; "
        "below 0.5 these tests cannot tell it from the form of the curve",
    )


class PairOut(base.Answer):
    """Two effects: whether these tests could distinguish them, and the test that would."""

    effects: list[str] = Field(description="Their slugs")
    probability: Number = Field(
        description="The probability that these tests distinguish the two, each at twice its visible amplitude"
    )
    apart: bool = Field(description="Whether that is sure enough")
    key: str | None = Field(
        description="The shortest test that surely distinguishes them, or the one that helps most; null: none"
    )
    test: str | None = Field(description="The same in words")
    with_test: Number = Field(description="The probability with that test added")


class IsolabilityOut(base.Answer):
    """Which causes these tests could distinguish. This depends on the design of the tests only, not on their results."""

    pairs: list[PairOut] = Field(description="The pairs of effects that these tests can show, hardest first")
    unseen: list[str] = Field(description="The slugs of the effects that these tests cannot show at all")


class Axes(base.Answer):
    """The axes of the residual maps."""

    pressure_bar: list[base.Real] = Field(description="Line pressure, bar")
    speed_rpm: list[base.Real] = Field(description="Sliding speed, rpm")
    cycles: list[base.Real] = Field(description="Duty cycles since new")


class ResidualMap(base.Answer):
    """Mean residuals, in standard deviations."""

    speed_pressure: NumberTable = Field(description="One row per pressure, one column per speed")
    pressure_cycles: NumberTable = Field(description="One row per count of cycles, one column per pressure")


class MapsOut(base.Answer):
    """Residual maps of both models."""

    axes: Axes = Field(description="Their axes")
    before: ResidualMap = Field(description="Under the baseline")
    after: ResidualMap = Field(description="Under the extended model")


class LoopTraceOut(base.Answer):
    """A friction loop over one period: measured, and of both models."""

    pressure_bar: base.Real = Field(description="Line pressure, bar")
    cycles: base.Real = Field(description="Duty cycles since new")
    frequency_hz: Number = Field(description="Frequency of the speed, Hz")
    speed_rpm: Numbers = Field(description="Sliding speed, rpm")
    measured_nm: Numbers = Field(description="Measured torque, Nm")
    baseline_nm: Numbers = Field(description="Torque under the baseline, Nm")
    extended_nm: Numbers = Field(description="Torque under the extended model, Nm")


class ReportSummary(base.Answer):
    """What a diagnosis found, as lists show it."""

    verdict: base.VerdictName | None = Field(description="The verdict")
    causes: list[str] = Field(
        description="Slugs of the named causes, or of those that these data cannot distinguish; `uncatalogued`: "
        "something that is not in the catalogue"
    )
    summary: str = Field(description="The result in a paragraph")
    explanations: list[ExplanationOut] = Field(
        default_factory=list,
        description="The possible explanations, most probable first; verdict and causes follow from them",
    )
    candidates: list[CandidateOut] = Field(description="The effects that competed, most probable first")
    baseline: MisfitOut = Field(description="The baseline's error")
    extended: MisfitOut = Field(description="The extended model's error")
    gain: GainOut = Field(description="What the extended model gains on runs that were left out of the fit")
    friction_law: FrictionLawOut | None = Field(
        default=None,
        description="How the friction curve differs from eq. 3; null without a verdict or without plateaus",
    )
    like_the_law: list[str] = Field(
        default_factory=list,
        description="Effects that would explain the data, but cannot be told from the form of the friction curve",
    )
    advice: list[AdviceOut] = Field(description="Tests that would distinguish the remaining explanations")
    visible: list[VisibleOut] = Field(description="The smallest amplitude of each effect that these data would show")
    not_adoptable: str | None = Field(
        default=None, description="Why a fitted cause cannot be adopted; null if it can, or if none was fitted"
    )
    notes: list[str] = Field(description="Assumptions and omissions")
    statistics: dict[str, Number] = Field(description="Numbers of the computation, by name")


class ReportParts(base.Answer):
    """What only the diagnosis itself shows of its report."""

    maps: MapsOut | None = Field(description="Residual maps; null without a verdict")
    loops: list[LoopTraceOut] = Field(description="Measured friction loops beside both models'")
    law_curves: list[LawCurveOut] = Field(
        default_factory=list, description="Measured friction curves beside eq. 3 and the law as found"
    )
    isolability: IsolabilityOut | None = Field(
        default=None, description="Which causes these tests could distinguish; null if not requested"
    )


class ReportOut(ReportParts, ReportSummary):
    """The report of a diagnosis; stored as JSON when it ends."""


class DiagnosisHead(base.Answer):
    """What a row says of a diagnosis."""

    diagnosis_id: DiagnosisName
    clutch_id: base.ClutchName
    status: Literal["running", "finished", "failed"] = Field(
        description="Whether it still runs, has finished, or failed"
    )
    created_at: str = Field(description="When it was requested; UTC, ISO 8601")
    finished_at: str | None = Field(description="When it ended; UTC, ISO 8601")
    revision: base.Revision
    as_of_cycles: Number = Field(description="Duty cycles since new of the latest run in it")
    stale: bool = Field(description="Whether runs were posted since")
    earlier_life: bool = Field(description="Whether a rebuild has ended the life that it diagnosed")
    adoptable: bool = Field(description="Whether it has an extended model to adopt")
    adopted: bool = Field(description="Whether its model is the current one")
    problem: str | None = Field(description="Why it failed")
    code_version: str = Field(description="The release that computed it")


class DiagnosisListed(ReportSummary, DiagnosisHead):
    """A diagnosis without its maps and loops. It has no verdict while it runs, or if it failed."""


class DiagnosisOut(ReportParts, DiagnosisListed):
    """A diagnosis with its residual maps and loops."""


class DiagnosisPage(base.Page[DiagnosisListed]):
    """Diagnoses, newest first."""

    items: list[DiagnosisListed] = Field(description="The diagnoses of this page")


class ModelVersion(base.Answer):
    """A model that was adopted."""

    version: int = Field(description="Its number, from 1")
    diagnosis_id: str | None = Field(description="The diagnosis that it comes from; null: the baseline")
    adopted_at: str = Field(description="When it was adopted; UTC, ISO 8601")
    model: ModelName = Field(description="The model")


class ModelOut(base.Answer):
    """The current model of tracking and remaining life, and all adopted versions. After a rebuild the baseline is the
    current model again.
    """

    clutch_id: base.ClutchName
    model: ModelName = Field(description="The model in force")
    version: int = Field(description="Its number; 0 if none was adopted")
    diagnosis_id: str | None = Field(description="The diagnosis that it comes from; null: the baseline")
    versions: list[ModelVersion] = Field(description="All adopted models, newest first")


class JobIn(base.Schema):
    """A job to start."""

    kind: Literal["replay", "fleet_refresh"] = Field(
        description="`replay`: compute results again from the raw runs; `fleet_refresh`: learn the priors that "
        "clutches of a kind share"
    )
    clutch_id: base.Identifier | None = Field(
        default=None, description="The clutch to replay; default: all. A fleet refresh always concerns all"
    )

    @model_validator(mode="after")
    def _fleet_refresh_names_no_clutch(self) -> Self:
        if self.kind == "fleet_refresh" and self.clutch_id is not None:
            raise ValueError("a fleet_refresh concerns all clutches: omit clutch_id")
        return self


class JobProgress(base.Answer):
    """The progress of a job."""

    step: str = Field(description="What it does")
    done: int | None = Field(default=None, description="Number of steps done; null: not counted")
    of: int | None = Field(default=None, description="Total number of steps")


class LeftClutch(base.Answer):
    """A clutch that keeps its former results."""

    clutch_id: base.ClutchName
    reason: str = Field(description="Why")


class JobResult(base.Answer):
    """The result of a replay or a fleet refresh."""

    kinds: int | None = Field(default=None, description="Kinds that have a new version of their prior, of a refresh")
    changed: int | None = Field(default=None, description="Clutches whose predictions have changed, of a refresh")
    replayed: int | None = Field(default=None, description="Clutches whose results were recomputed, of a replay")
    left: int = Field(description="Clutches that keep their former results")
    reasons: list[LeftClutch] = Field(description="The reasons, for the first 20 of them")


class JobOut(base.Answer):
    """A job, which a service computes when its turn comes. The job of a diagnosis has the diagnosis' name."""

    job_id: str = Field(description="The job's name")
    kind: Literal["diagnosis", "replay", "fleet_refresh"] = Field(description="What it computes")
    clutch_id: str | None = Field(description="The clutch that it concerns; null if it concerns several")
    state: JobState = Field(
        description="`waiting` for its turn, `running`, or how it ended: `finished`, `failed` or `cancelled`"
    )
    asked_at: str = Field(description="When it was asked for; UTC, ISO 8601")
    asked_by: str = Field(description="Who asked: `key:ID NOTE`, or `local`")
    started_at: str | None = Field(description="When it last started; null before")
    finished_at: str | None = Field(description="When it ended; null before")
    attempts: int = Field(description="Number of starts; a job starts again if its service was killed")
    progress: JobProgress | None = Field(description="Its progress; null before the first report")
    problem: str | None = Field(description="Why it failed, or who cancelled it")
    result: JobResult | None = Field(description="Its result; null before its end, and for a diagnosis")


class JobPage(base.Page[JobOut]):
    """A page of jobs, newest first."""

    items: list[JobOut] = Field(description="The jobs")
