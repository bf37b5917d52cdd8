"""Runs as they are posted, and the receipts that answer them."""

from typing import Annotated, Literal, Self

from pydantic import Field, JsonValue, StringConstraints, TypeAdapter, model_validator

from service.api import base


class IndicatorEstimate(base.Answer):
    """A value with its standard error from noise."""

    value: base.Real = Field(description="The value")
    sd: base.Real = Field(description="Its standard error")


class Indicators(base.Answer):
    """The indicators of one engagement; null if the record does not determine one."""

    stop_time_s: IndicatorEstimate | None = Field(description="From 10 % of the highest torque to standstill, s")
    engagement_energy_kj: IndicatorEstimate | None = Field(description="Dissipated from contact to standstill, kJ")
    peak_power_kw: IndicatorEstimate | None = Field(description="Highest power, kW")
    initial_cof: IndicatorEstimate | None = Field(description="COF at 90 % of the initial speed")
    midpoint_cof: IndicatorEstimate | None = Field(description="COF at 50 % of the initial speed")
    endpoint_cof: IndicatorEstimate | None = Field(description="COF at 10 % of the initial speed")
    breakaway_cof: IndicatorEstimate | None = Field(description="COF at which slip begins again after the standstill")
    initial_cof_ratio: IndicatorEstimate | None = Field(description="Initial over midpoint COF")
    endpoint_cof_ratio: IndicatorEstimate | None = Field(description="Endpoint over midpoint COF")
    breakaway_cof_ratio: IndicatorEstimate | None = Field(description="Breakaway over midpoint COF")
    torque_rise: IndicatorEstimate | None = Field(
        description="Torque at the end of slip over torque at half speed, minus 1"
    )


class ReceivedEngagement(base.Answer):
    """The measured engagement of a block of duty; null if it was not evaluated."""

    status: str = Field(
        description="`determined`, or why not: `no_slip`, `slip_never_ends`, `no_torque`, `no_pressure`, "
        "`time_not_increasing`, `sampled_too_slowly`, `starts_in_contact`, `gap`, `too_few_samples`"
    )
    message: str = Field(description="The status in a sentence")
    start_s: base.Real | None = Field(description="Start of slip on the record's clock, s")
    end_s: base.Real | None = Field(description="End of slip on the record's clock, s")
    initial_speed_rpm: base.Real | None = Field(description="Sliding speed at contact, rpm")
    maximum_pressure_bar: base.Real | None = Field(description="Highest pressure of the slip, bar")
    indicators: Indicators = Field(description="The indicators, each with its standard error")


Pressure = Annotated[base.Column, Field(description="Line pressure, bar")]
Speed = Annotated[base.Column, Field(description="Sliding speed, rpm")]
Torque = Annotated[base.Column, Field(description="Friction torque, Nm")]
OilTemperature = Annotated[base.Column | None, Field(description="Oil temperature, °C")]
FrontTemperature = Annotated[
    base.Column | None,
    Field(description="Temperature of the reaction plate at its front, or at the only measured place, °C"),
]
RearTemperature = Annotated[base.Column | None, Field(description="Temperature of the reaction plate at its rear, °C")]


EndReason = Literal["worn", "other"]
GivenReason = Annotated[base.Reason, StringConstraints(min_length=1)]


class StationaryChannels(base.Schema):
    """The channels of a stationary test: one value per plateau, or with `time_s` the raw record."""

    pressure_bar: Pressure
    speed_rpm: Speed
    torque_nm: Torque
    torque_sd_nm: base.Column | None = Field(
        default=None, description="Standard deviation of each plateau's mean torque, Nm"
    )
    oil_temperature_c: OilTemperature = None
    plate_temperature_front_c: FrontTemperature = None
    plate_temperature_rear_c: RearTemperature = None
    time_s: base.Column | None = Field(
        default=None, description="Time of each sample, s; without it, rows are plateaus"
    )


class DynamicChannels(base.Schema):
    """The sampled record of a dynamic test or of an engagement."""

    time_s: base.Column = Field(description="Time of each sample, s")
    pressure_bar: Pressure
    speed_rpm: Speed
    torque_nm: Torque
    oil_temperature_c: OilTemperature = None
    plate_temperature_front_c: FrontTemperature = None
    plate_temperature_rear_c: RearTemperature = None


class Duty(base.Schema):
    """The block of engagements that ends at the run's `cycles`."""

    cycles: Annotated[base.PositiveNumber, Field(le=base.MAX_CYCLES)] = Field(description="Duty cycles in the block")
    energy_per_cycle_kj: base.NotNegativeNumber | None = Field(
        default=None, description="Energy dissipated in a duty cycle, kJ"
    )
    initial_speed_rpm: base.NotNegativeNumber | None = Field(
        default=None, description="Sliding speed at the start of an engagement, rpm"
    )
    engagement_duration_s: base.NotNegativeNumber | None = Field(
        default=None, description="Time from contact to standstill, s"
    )
    maximum_pressure_bar: base.NotNegativeNumber | None = Field(
        default=None, description="Highest line pressure of an engagement, bar"
    )


class RunBase(base.Schema):
    """Fields of every run."""

    run_id: base.Identifier | None = Field(
        default=None, description="The run's name; default: derived from the content"
    )
    cycles: base.Cycles = Field(description="Duty cycles since new when the run is made")
    started_at: Annotated[base.StartedAt, Field(strict=True)] | None = Field(
        default=None, description="When it was started: ISO 8601 with a time zone"
    )
    origin: base.Origin = "measured"


class StationaryRunIn(RunBase):
    """A stationary Stribeck test."""

    kind: Literal["stationary_stribeck"] = Field(description="The kind of run")
    channels: StationaryChannels = Field(description="The channels, of equal length")


class DynamicRunIn(RunBase):
    """A dynamic Stribeck test."""

    kind: Literal["dynamic_stribeck"] = Field(description="The kind of run")
    channels: DynamicChannels = Field(description="The channels, of equal length")


class DutyRunIn(RunBase):
    """A block of duty cycles, or the run-in; optionally the record of one engagement."""

    kind: Literal["duty_cycles", "run_in"] = Field(description="The kind of run")
    duty: Duty = Field(description="The block of engagements")
    channels: DynamicChannels | None = Field(default=None, description="The record of one engagement")


class MaintenanceRunIn(RunBase):
    """Maintenance of the clutch or the rig."""

    kind: Literal["maintenance"] = Field(description="The kind of run")
    event: Literal["oil_change", "rest", "sensor_zero", "rebuild", "other", "end_of_life"] = Field(
        description="What was done; `end_of_life`: the life has ended, and later duty and tests are refused until a rebuild"
    )
    reason: EndReason | None = Field(
        default=None, description="Why a life has ended: `worn` (default), or `other` (taken out before its end)"
    )
    note: Annotated[str, StringConstraints(max_length=base.LONGEST_NOTE)] = Field(default="", description="A remark")

    @model_validator(mode="after")
    def _reason_is_of_an_end(self) -> Self:
        if self.reason is not None and self.event != "end_of_life":
            raise ValueError(f"reason is only for the event end_of_life, not for {self.event}")
        return self


RunIn = Annotated[StationaryRunIn | DynamicRunIn | DutyRunIn | MaintenanceRunIn, Field(discriminator="kind")]

RUN_IN: TypeAdapter[StationaryRunIn | DynamicRunIn | DutyRunIn | MaintenanceRunIn] = TypeAdapter(RunIn)


class Warned(base.Answer):
    """A warning; it does not stop the run."""

    code: str = Field(description="Code of the warning, for programs")
    message: str = Field(description="The warning in a sentence")


class CycleCorrection(base.Answer):
    """A correction of cycles: an offset or a factor; empty if the runs have neither in common."""

    cycles_offset: base.Real | None = Field(
        default=None, description="Cycles to add to those sent; after a second roll-over twice as many"
    )
    cycles_factor: base.Real | None = Field(default=None, description="Factor on the cycles sent")


class CounterHypothesis(base.Answer):
    """One cause of several held runs."""

    kind: Literal["restart", "offset", "roll_over", "stuck", "other_clutch", "other_unit"] = Field(
        description="What happened to the counter of cycles; `other_clutch`: the runs are another clutch's"
    )
    runs: list[str] = Field(description="The runs that it explains")
    proposal: CycleCorrection = Field(description="The correction of their cycles")


class Doubt(Warned):
    """Why a run is held."""

    likely_cycles: base.Real | None = Field(
        default=None, description="The cycles that the doubt suggests; absent if it suggests none"
    )
    id: str | None = Field(
        default=None, description="The doubt's name, to be answered at `/doubts/{id}/answer`; absent for one run alone"
    )
    hypothesis: CounterHypothesis | None = Field(
        default=None, description="The common cause of several held runs; absent for one run alone"
    )


class DoubtAnswer(base.Schema):
    """An answer to a doubt about several runs."""

    accept: Annotated[bool, Field(strict=True)] = Field(
        description="Whether the hypothesis is right: its runs get their likely cycles, or are withdrawn if they are "
        "another clutch's. If not, they are accepted as sent"
    )
    reason: base.Reason = Field(default="", description="Why")


class Withdrawal(base.Schema):
    """Why a run or an inspection is withdrawn or restored."""

    reason: GivenReason = Field(description="Why")


class Confirmation(base.Schema):
    """Why a held run is accepted."""

    reason: base.Reason = Field(default="", description="Why")


class Confirmations(base.Schema):
    """Held runs to accept together, and the reason."""

    run_ids: list[base.Identifier] = Field(min_length=1, max_length=base.MAX_CONFIRMED, description="The runs")
    reason: base.Reason = Field(default="", description="Why")


class Withdrawals(base.Schema):
    """Runs to withdraw or to restore together, and the reason."""

    run_ids: list[base.Identifier] = Field(min_length=1, max_length=base.MAX_CONFIRMED, description="The runs")
    reason: GivenReason = Field(description="Why")


class Corrections(base.Schema):
    """The true cycles of several runs, and the reason."""

    cycles: dict[base.Identifier, base.Cycles] = Field(
        min_length=1,
        max_length=base.MAX_CONFIRMED,
        description="Duty cycles since new when each run was made, by run_id",
    )
    reason: GivenReason = Field(description="Why")


class Correction(base.Schema):
    """A correction: the true cycles of a run, or the rig profile to read its file again, and the reason."""

    cycles: base.Cycles | None = Field(default=None, description="Duty cycles since new when the run was made")
    rig: base.Identifier | None = Field(default=None, description="The rig profile to read the kept file with")
    reason: GivenReason = Field(description="Why")

    @model_validator(mode="after")
    def _either_cycles_or_rig(self) -> Self:
        if (self.cycles is None) == (self.rig is None):
            raise ValueError("give either cycles or rig")
        return self


class Parameters(base.Answer):
    """The four Stribeck parameters of eq. 3."""

    static_torque_nm: base.Real = Field(description="Static torque M_s, Nm")
    coulomb_ratio: base.Real = Field(description="Coulomb torque over static torque, M̄_c")
    stribeck_velocity_m_s: base.Real = Field(description="Stribeck velocity V_S, m/s")
    viscous_coefficient: base.Real = Field(description="Viscous coefficient C_v, Nm/(m/s)^0.3")


class Fit(base.Answer):
    """The fitted Stribeck curve of one pressure (eq. 4, 5)."""

    pressure_bar: base.Real = Field(description="Line pressure, bar")
    parameters: Parameters = Field(description="The fitted parameters")
    standard_errors: Parameters = Field(description="Their standard errors")
    mse_percent: base.Real | None = Field(description="Eq. 5, %; null if the torque does not vary")
    rmse_nm: base.Real = Field(description="Root mean square of the residuals, Nm")
    noise_nm: base.Real = Field(description="Standard deviation of one point, Nm")
    acceptable: bool = Field(
        description="Whether `mse_percent` is below 5, or the error is no more than the noise of the points"
    )
    mean_cof: base.Real | None = Field(description="Mean COF of the curve; null if the data do not determine it")
    mean_cof_sd: base.Real | None = Field(description="Its standard deviation")
    points: int = Field(description="Number of points")
    status: Literal["determined", "at_bound", "undetermined"] = Field(
        description="Whether the data determine all parameters, set one to zero, or leave some undetermined"
    )
    undetermined: list[str] = Field(description="The parameters that the data do not determine")
    message: str = Field(description="The fit in a sentence")


class Loop(base.Answer):
    """A friction loop at one pressure; a value is null if the record does not determine it."""

    pressure_bar: base.Real = Field(description="Line pressure, bar")
    loop_area_nm_m_s: base.Real | None = Field(
        description="Area (eq. 8), Nm·m/s; positive if torque is higher while the speed rises"
    )
    loop_area_sd_nm_m_s: base.Real | None = Field(description="Its standard deviation")
    attractor_nm_s: base.Real | None = Field(description="The attractor's rate C of the GMS model, Nm/s")
    attractor_sd_nm_s: base.Real | None = Field(description="Its standard deviation")
    film_time_s: base.Real | None = Field(description="Time constant of the squeeze film, s")
    film_time_sd_s: base.Real | None = Field(description="Its standard deviation")
    frequency_hz: base.Real | None = Field(description="Frequency of the speed, Hz")
    periods: int = Field(description="Number of whole periods")
    direction: str = Field(
        description="`higher_accelerating`, `higher_decelerating`, or `none`: the area is within noise"
    )
    better_law: str | None = Field(
        description="The law that fits clearly better, `attractor` or `squeeze film`; null: neither"
    )
    status: str = Field(
        description="`determined`, `unresolved`, `against_the_law`, `no_curve`, `reverses` (speed changes sign), `no_period`"
    )
    message: str = Field(description="The loop in a sentence")


State = Annotated[
    Literal["accepted", "held", "withdrawn"],
    Field(
        description="`accepted` (it counts), `held` until it is confirmed or corrected, or `withdrawn` until it is restored"
    ),
]


class ReceivedFile(base.Answer):
    """The file of a run, which is kept: `/runs/{run_id}/file` returns it."""

    filename: str = Field(description="The sender's name for it")
    sha256: str = Field(description="Hash of the file as it was sent")
    bytes: int = Field(description="Its length as it was sent")
    rig: str | None = Field(description="The rig profile that was used; null: no saved profile")


class Evaluation(base.Answer):
    """What was computed of a run by itself and among the others; stored with it."""

    clutch_id: base.ClutchName
    run_id: base.RunName
    kind: str = Field(description="The kind of run")
    cycles: base.RunCycles
    started_at: str | None = Field(description="When it was started, ISO 8601")
    origin: base.Origin
    received_at: str = Field(description="When it was stored; UTC, ISO 8601")
    content_sha256: str = Field(description="Hash of the content without the name")
    duplicate: bool = Field(description="Whether the run was stored before this request")
    file: ReceivedFile | None = Field(description="The file that it was read from; null for a run sent as JSON")
    warnings: list[Warned] = Field(description="Warnings")
    fits: list[Fit] = Field(description="The fitted curves of a stationary test, by pressure")
    loops: list[Loop] = Field(description="The friction loops of a dynamic test, by pressure")
    engagement: ReceivedEngagement | None = Field(
        default=None, description="The measured engagement of a block of duty; null for a run without one"
    )
    duty: Duty | None = Field(description="The block of engagements; null for other kinds")
    event: str | None = Field(description="The maintenance event; null for other kinds")
    reason: EndReason | None = Field(description="Why the life has ended; null where the run declares no end")
    note: str | None = Field(description="The maintenance note; null for other kinds")
    code_version: str = Field(description="The release that evaluated the run")


class Receipt(Evaluation):
    """The evaluation of a stored run."""

    state: State
    doubts: list[Doubt] = Field(description="Why the run is, or was, held; empty if nothing was odd")
    sent_cycles: base.Real = Field(description="Cycles as sent; `cycles` has the present value")
    received_by: str | None = Field(description="Who posted it: `key:` with the key's id and note, or `local`")


Action = Literal[
    "hold", "accept", "doubt", "confirm", "withdraw", "restore", "correct", "reread", "edit", "archive", "unarchive",
    "adopt", "withdraw_inspection", "restore_inspection",
]  # fmt: skip


class Change(base.Answer):
    """An entry of the audit trail."""

    at: str = Field(description="When; UTC, ISO 8601")
    by: str = Field(
        description="Who: `key:` with the key's id and note, `local` without keys, or `evidence`: other runs"
    )
    action: Action = Field(
        description="What was done; `accept` and `doubt`: other runs agree with a held run, or contradict an accepted one"
    )
    run_id: str | None = Field(
        description="The run; null for a change of the clutch's record or of an inspection, which `after` names"
    )
    reason: str = Field(description="Why")
    before: dict[str, JsonValue] = Field(description="The changed fields before")
    after: dict[str, JsonValue] = Field(description="The changed fields after")


class ChangePage(base.Page[Change]):
    """The audit trail, newest first."""

    items: list[Change] = Field(description="The entries of this page")


class RunDescription(Receipt):
    """A receipt with what is known of the run beside its channels."""

    reading: dict[str, JsonValue] | None = Field(
        description="How its file was read: the complete profile; null for a run sent as JSON"
    )
    changes: list[Change] = Field(description="The run's entries of the audit trail, newest first")
    samples: int = Field(description="Number of samples of each channel as sent; 0 for a run without channels")


class RunOut(RunDescription):
    """A receipt with the run's channels: as sent, or with `points` thinned for a plot."""

    channels: dict[str, list[base.Real]] = Field(
        description="The channels by name, bit for bit as sent and of equal length. With `points`, row k of all "
        "channels is one measured sample: the answer keeps the lowest and highest of every channel in"
        " equal bins, the first and the last"
    )


class RunPage(base.Page[Receipt]):
    """Receipts by cycles."""

    items: list[Receipt] = Field(description="The receipts of this page")
