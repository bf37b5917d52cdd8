"""What tests look like: Stribeck curves, friction loops, and flat series."""

from typing import Literal

from pydantic import Field

from service.schemas.base import Answer, RunCycles, RunName, page_of
from service.schemas.run import Fit, Loop


class LinearLaw(Answer):
    """value = intercept + slope · pressure_bar."""

    intercept: float = Field(description="Value at no pressure")
    slope_per_bar: float = Field(description="Change per bar")
    covariance: list[list[float]] = Field(description="Covariance of `intercept` and `slope_per_bar`, in this order")


class AsymptoticLaw(Answer):
    """value = asymptote + excess · exp(-pressure_bar / decay_bar)."""

    asymptote: float = Field(description="Value at high pressure")
    excess: float = Field(description="Value at no pressure less the asymptote")
    decay_bar: float = Field(description="Pressure over which the excess falls to 1/e, bar")
    covariance: list[list[float]] = Field(
        description="Covariance of `asymptote`, `excess` and `decay_bar`, in this order; 0 of what is held at 0"
    )


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


StribeckPage = page_of("StribeckPage", StribeckItem, "Stationary tests by cycles.", "The tests of this page")


class LoopItem(Loop):
    """A friction loop of one dynamic test at one pressure."""

    run_id: RunName
    cycles: RunCycles


LoopPage = page_of("LoopPage", LoopItem, "Friction loops by cycles and pressure.", "The loops of this page")


class SeriesItem(Answer):
    """One value of one quantity."""

    cycles: float = Field(description="Duty cycles since new")
    time: str | None = Field(description="When the run was started, else received, ISO 8601; null for predictions")
    run_id: str | None = Field(description="The run's name; null for predictions")
    quantity: str = Field(
        description="A fitted quantity, the slope dμ/dv of a curve, one of a friction loop, an indicator of an "
        "engagement, or one of the prediction at these cycles"
    )
    unit: str = Field(description="Its unit")
    pressure_bar: float | None = Field(
        description="Line pressure, bar; null: the mean over the reference pressures, or an engagement"
    )
    value: float | None = Field(description="The value; the median of a prediction")
    lower: float | None = Field(description="5 % quantile")
    upper: float | None = Field(description="95 % quantile")
    frequency_hz: float | None = Field(description="Frequency of a friction loop, Hz, to two digits; null for all else")
    speed_rpm: float | None = Field(description="Speed of a slope, rpm; null for all else")
    source: Literal["run", "track"] = Field(
        description="`run`: fitted or measured in one run alone; `track`: what all runs up to these cycles say"
    )


SeriesPage = page_of("SeriesPage", SeriesItem, "Flat rows for dashboards and spreadsheets.", "The rows of this page")
