"""Engagements over a life: the measured ones, a simulated one, and one beside the other."""

from typing import Literal

from pydantic import Field

from service.schemas.base import Answer, ClutchName, Origin, RunCycles, RunName
from service.schemas.life import Model
from service.schemas.run import IndicatorEstimate, Indicators


class EngagementChannels(Answer):
    """The course of an engagement, a column each."""

    time_s: list[float] = Field(description="Time, s")
    pressure_bar: list[float] = Field(description="Line pressure, bar")
    speed_rpm: list[float] = Field(description="Sliding speed, rpm")
    torque_nm: list[float] = Field(description="Friction torque, Nm")
    motor_torque_nm: list[float] = Field(description="The motor's torque, Nm")


class AllIndicators(Indicators):
    """The indicators of one engagement, and those against the first ones of its life (null: of another duty)."""

    normalised_duration: IndicatorEstimate | None = Field(
        description="Duration of slip over that of the first engagements"
    )
    euclidean_distance: IndicatorEstimate | None = Field(
        description="Distance of the speed's course from that of the first ones"
    )
    spectral_angle_rad: IndicatorEstimate | None = Field(description="Angle between the speed's course and theirs, rad")


class MeasuredEngagement(Answer):
    """A measured engagement."""

    run_id: RunName
    cycles: RunCycles
    kind: str = Field(description="The kind of run")
    time: str = Field(description="When the run was started, else received, ISO 8601")
    initial_speed_rpm: float = Field(description="Sliding speed at contact, rpm")
    maximum_pressure_bar: float = Field(description="Highest pressure of the slip, bar")
    indicators: AllIndicators = Field(description="The indicators, each with its standard error")


class EngagementTrace(Answer):
    """The course of an engagement, a column each; time counts from contact."""

    time_s: list[float] = Field(description="Time since contact, s")
    pressure_bar: list[float] = Field(description="Line pressure, bar")
    speed_rpm: list[float] = Field(description="Sliding speed less what the sensor reads at standstill, rpm")
    torque_nm: list[float] = Field(description="Friction torque less what the sensor reads before contact, Nm")


class ModelledEngagement(Answer):
    """What the tracked model gives for a measured engagement's pressure, initial speed and drive."""

    channels: EngagementTrace = Field(description="The course of the simulated engagement")
    inertia_kg_m2: float = Field(description="The shaft's inertia, by what slowed it in the record, kg m²")
    motor_torque_limit_nm: float = Field(description="The drive's torque, by what the clutch carries at standstill, Nm")
    stop_time_s: float | None = Field(description="Simulated stop time, s; null where the simulated clutch slips on")
    torque_discrepancy: float = Field(
        description="Root mean square of measured less simulated torque over the measured one"
    )
    stop_time_difference_s: float | None = Field(description="Measured less simulated stop time, s")
    stop_time_difference_sd_s: float | None = Field(description="Its standard error, of the measurement, s")


class ComparedEngagement(Answer):
    """A measured engagement beside the tracked model's."""

    run_id: RunName
    cycles: RunCycles
    channels: EngagementTrace = Field(description="The measured course, averaged over equal steps of time")
    model: ModelledEngagement | None = Field(description="The model's; null where the record does not show its drive")


class EngagementOut(Answer):
    """A simulated engagement of the tracked clutch, and the measured ones."""

    clutch_id: ClutchName
    origin: Origin
    simulated: Literal[True] = Field(
        description="Always true: the engagement is simulated, whatever the clutch's origin"
    )
    at_cycles: float = Field(description="Duty cycles since new of the clutch's state")
    model: Model
    initial_speed_rpm: float = Field(description="Sliding speed at the start, rpm")
    maximum_pressure_bar: float = Field(description="Highest line pressure, bar")
    motor_torque_limit_nm: float = Field(description="The motor's limit, Nm")
    engaged: bool = Field(description="Whether the clutch comes to standstill")
    duration_s: float | None = Field(description="From contact to standstill, s; null while it slips")
    energy_kj: float = Field(description="Dissipated energy, kJ")
    channels: EngagementChannels = Field(description="The course of the engagement")
    measured: list[MeasuredEngagement] = Field(description="The measured engagements that were evaluated, by cycles")
    compared: ComparedEngagement | None = Field(
        description="One measured engagement beside the tracked model's; null where there is none in this life"
    )
