"""What tests and engagements look like: Stribeck curves, friction loops, a simulated engagement, and flat series."""

from typing import Literal

from pydantic import Field

from service.schemas.base import Answer, ClutchName, Next, Origin, RunCycles, RunName
from service.schemas.life import Model
from service.schemas.run import Fit, Loop


class LinearLaw(Answer):
    """value = intercept + slope · pressure_bar."""

    intercept: float = Field(description="Value at no pressure")
    slope_per_bar: float = Field(description="Change per bar")


class AsymptoticLaw(Answer):
    """value = asymptote + excess · exp(-pressure_bar / decay_bar)."""

    asymptote: float = Field(description="Value at high pressure")
    excess: float = Field(description="Value at no pressure less the asymptote")
    decay_bar: float = Field(description="Pressure over which the excess falls to 1/e, bar")


class PressureLawsOut(Answer):
    """The Stribeck parameters over pressure (fig. 9)."""

    static_torque_nm: LinearLaw = Field(description="Static torque M_s, Nm")
    coulomb_ratio: AsymptoticLaw = Field(description="Coulomb torque over static torque, M̄_c")
    stribeck_velocity_m_s: LinearLaw = Field(description="Stribeck velocity V_S, m/s")
    viscous_coefficient: LinearLaw = Field(description="Viscous coefficient C_v, Nm/(m/s)^0.3")


class StribeckItem(Answer):
    """The curves of one stationary test."""

    run_id: RunName
    cycles: RunCycles
    fits: list[Fit] = Field(description="The fitted curves, by pressure")
    pressure_laws: PressureLawsOut | None = Field(description="The pressure laws; null with too few pressures")


class StribeckPage(Answer):
    """Stationary tests by cycles."""

    items: list[StribeckItem] = Field(description="The tests of this page")
    next: Next


class LoopItem(Loop):
    """A friction loop of one dynamic test at one pressure."""

    run_id: RunName
    cycles: RunCycles


class LoopPage(Answer):
    """Friction loops by cycles and pressure."""

    items: list[LoopItem] = Field(description="The loops of this page")
    next: Next


class EngagementChannels(Answer):
    """The course of an engagement, a column each."""

    time_s: list[float] = Field(description="Time, s")
    pressure_bar: list[float] = Field(description="Line pressure, bar")
    speed_rpm: list[float] = Field(description="Sliding speed, rpm")
    torque_nm: list[float] = Field(description="Friction torque, Nm")
    motor_torque_nm: list[float] = Field(description="The motor's torque, Nm")


class EngagementOut(Answer):
    """A simulated engagement of the tracked clutch."""

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


class SeriesItem(Answer):
    """One value of one quantity."""

    cycles: float = Field(description="Duty cycles since new")
    time: str | None = Field(description="When the run was started, else received, ISO 8601; null for predictions")
    run_id: str | None = Field(description="The run's name; null for predictions")
    quantity: str = Field(description="A fitted quantity, or one of the prediction at these cycles")
    unit: str = Field(description="Its unit")
    pressure_bar: float | None = Field(description="Line pressure, bar; null: the mean over the reference pressures")
    value: float | None = Field(description="The value; the median of a prediction")
    lower: float | None = Field(description="5 % quantile")
    upper: float | None = Field(description="95 % quantile")


class SeriesPage(Answer):
    """Flat rows for dashboards and spreadsheets."""

    items: list[SeriesItem] = Field(description="The rows of this page")
    next: Next
