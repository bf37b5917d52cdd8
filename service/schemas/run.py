"""Runs as they come in, and the receipts that go out."""

from typing import Annotated, Literal

from pydantic import AwareDatetime, Field, StringConstraints, TypeAdapter

from service.schemas.base import Answer, Column, Cycles, Identifier, NotNegativeNumber, Origin, PositiveNumber, Schema


class StationaryChannels(Schema):
    """One value a plateau; with `time_s`, the raw record."""

    pressure_bar: Column
    speed_rpm: Column
    torque_nm: Column
    torque_sd_nm: Column | None = None
    oil_temperature_c: Column | None = None
    time_s: Column | None = None


class DynamicChannels(Schema):
    """The sampled record of a dynamic test."""

    time_s: Column
    pressure_bar: Column
    speed_rpm: Column
    torque_nm: Column
    oil_temperature_c: Column | None = None


class Duty(Schema):
    """The block of engagements that ends at the run's `cycles`."""

    cycles: Annotated[PositiveNumber, Field(le=1e12)]
    energy_per_cycle_kj: NotNegativeNumber | None = None
    initial_speed_rpm: NotNegativeNumber | None = None
    engagement_duration_s: NotNegativeNumber | None = None
    maximum_pressure_bar: NotNegativeNumber | None = None


class RunBase(Schema):
    """What every run says: its name (derived from its content when left out) and the cycles since new when it is made."""

    run_id: Identifier | None = None
    cycles: Cycles
    started_at: Annotated[AwareDatetime, Field(strict=True)] | None = None
    origin: Origin = "measured"


class StationaryRunIn(RunBase):
    """A stationary Stribeck test."""

    kind: Literal["stationary_stribeck"]
    channels: StationaryChannels


class DynamicRunIn(RunBase):
    """A dynamic Stribeck test."""

    kind: Literal["dynamic_stribeck"]
    channels: DynamicChannels


class DutyRunIn(RunBase):
    """A block of duty cycles, or the run-in; optionally the record of one engagement."""

    kind: Literal["duty_cycles", "run_in"]
    duty: Duty
    channels: DynamicChannels | None = None


class MaintenanceRunIn(RunBase):
    """Something was done to the clutch or the rig."""

    kind: Literal["maintenance"]
    event: Literal["oil_change", "rest", "sensor_zero", "rebuild", "other"]
    note: Annotated[str, StringConstraints(max_length=4000)] = ""


RunIn = Annotated[StationaryRunIn | DynamicRunIn | DutyRunIn | MaintenanceRunIn, Field(discriminator="kind")]

RUN_IN: TypeAdapter[StationaryRunIn | DynamicRunIn | DutyRunIn | MaintenanceRunIn] = TypeAdapter(RunIn)


class Warned(Answer):
    """Something that was noticed and did not stop the run."""

    code: str
    message: str


class Parameters(Answer):
    """The four Stribeck parameters of eq. 3."""

    static_torque_nm: float
    coulomb_ratio: float
    stribeck_velocity_m_s: float
    viscous_coefficient: float


class Fit(Answer):
    """The fitted curve of one pressure (eq. 4, 5); `mean_cof` is null where the data cannot say it."""

    pressure_bar: float
    parameters: Parameters
    standard_errors: Parameters
    mse_percent: float | None
    rmse_nm: float
    noise_nm: float
    acceptable: bool
    mean_cof: float | None
    mean_cof_sd: float | None
    points: int
    status: Literal["determined", "at_bound", "undetermined"]
    undetermined: list[str]
    message: str


class Loop(Answer):
    """A friction loop at one pressure (eq. 8): positive where torque is higher in acceleration; null: it cannot be told."""

    pressure_bar: float
    loop_area_nm_m_s: float | None
    loop_area_sd_nm_m_s: float | None
    attractor_nm_s: float | None
    attractor_sd_nm_s: float | None
    film_time_s: float | None
    film_time_sd_s: float | None
    frequency_hz: float | None
    periods: int
    direction: str
    better_law: str | None
    status: str
    message: str


class Receipt(Answer):
    """What the service made of a run."""

    clutch_id: str
    run_id: str
    kind: str
    cycles: float
    started_at: str | None
    origin: Origin
    received_at: str
    content_sha256: str
    duplicate: bool
    warnings: list[Warned]
    fits: list[Fit]
    loops: list[Loop]
    duty: Duty | None
    event: str | None
    note: str | None
    code_version: str


class RunOut(Receipt):
    """A receipt with the run's channels as they were sent."""

    channels: dict[str, list[float]]


class RunPage(Answer):
    """Receipts by cycles."""

    items: list[Receipt]
    next: str | None
