"""What is answered along a life: Stribeck curves, friction loops and series; eq. 6; engagements measured and simulated."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.base import Answer, ClutchName, Next, Origin, Page, Real, Revision, RunCycles, RunName
from service.api.life import LifeNumber, MethodName, Model, Prior, Quantiles, SeverityUsed
from service.api.run import Fit, IndicatorEstimate, Indicators, Loop, Warned

#: What an answer that follows from the accepted runs says of those that are held.
HeldLeftOut = Annotated[int, Field(description="Number of runs that are held: the answer is without them")]
Warnings = Annotated[list[Warned], Field(description="Warnings, such as tracks that disagree or runs that are held")]


class LinearLaw(Answer):
    """value = intercept + slope · pressure_bar."""

    intercept: Real = Field(description="Value at zero pressure")
    slope_per_bar: Real = Field(description="Change per bar")
    covariance: list[list[Real]] = Field(description="Covariance of `intercept` and `slope_per_bar`, in this order")


class AsymptoticLaw(Answer):
    """value = asymptote + excess · exp(-pressure_bar / decay_bar)."""

    asymptote: Real = Field(description="Value at high pressure")
    excess: Real = Field(description="Value at zero pressure minus the asymptote")
    decay_bar: Real = Field(description="Pressure over which the excess falls to 1/e, bar")
    covariance: list[list[Real]] = Field(
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


class StribeckPage(Answer):
    """Stationary tests by cycles."""

    held_runs: HeldLeftOut
    warnings: Warnings
    items: list[StribeckItem] = Field(description="The tests of this page")
    next: Next


class OfRun(Answer):
    """What belongs to a run."""

    run_id: RunName
    cycles: RunCycles


class LoopItem(Loop, OfRun):
    """A friction loop of one dynamic test at one pressure."""


class LoopPage(Answer):
    """Friction loops by cycles and pressure."""

    held_runs: HeldLeftOut
    warnings: Warnings
    items: list[LoopItem] = Field(description="The loops of this page")
    next: Next


class SeriesItem(Answer):
    """One value of one quantity."""

    cycles: Real = Field(description="Duty cycles since new")
    time: str | None = Field(
        description="When the run was started, or received if that is unknown, ISO 8601; null for predictions"
    )
    run_id: str | None = Field(description="The run's name; null for predictions")
    source: Literal["run", "track"] = Field(
        description="`run`: from one run alone; `track`: from all runs up to these cycles"
    )
    pressure_bar: Real | None = Field(
        description="Line pressure, bar; null: the mean over the reference pressures, or an engagement"
    )
    frequency_hz: Real | None = Field(description="Frequency of a friction loop, Hz, to two digits; null for all else")
    speed_rpm: Real | None = Field(description="Speed of a slope, rpm; null for all else")
    quantity: str = Field(
        description="A fitted quantity, the slope dμ/dv of a curve, one of a friction loop, an indicator of an "
        "engagement, or one of the prediction at these cycles"
    )
    unit: str = Field(description="Its unit")
    value: Real | None = Field(description="The value; the median of a prediction")
    lower: Real | None = Field(description="5 % quantile")
    upper: Real | None = Field(description="95 % quantile")


class SeriesPage(Page[SeriesItem]):
    """Flat rows for dashboards and spreadsheets."""

    items: list[SeriesItem] = Field(description="The rows of this page")


class Estimate(Answer):
    """The posterior of a coefficient."""

    value: Real = Field(description="Posterior mean")
    sd: Real = Field(description="Posterior standard deviation")
    quantiles: Quantiles = Field(description="Posterior quantiles, by probability")


class Coefficients(Answer):
    """The coefficients of eq. 6."""

    initial: Estimate = Field(description="Initial value ξ0, in the quantity's unit")
    change: Estimate = Field(description="Change Δ, in the quantity's unit")
    scale_cycles: Estimate = Field(description="Scale φ, duty cycles")
    exponent: Estimate = Field(description="Exponent ε")


class CoefficientDraws(Answer):
    """Joint draws of the coefficients of eq. 6, of equal weight. The same row of all four columns is one draw."""

    initial: list[Real] = Field(description="Initial value ξ0, in the quantity's unit")
    change: list[Real] = Field(description="Change Δ, in the quantity's unit")
    scale_cycles: list[Real] = Field(description="Scale φ, duty cycles")
    exponent: list[Real] = Field(description="Exponent ε")


class Measured(Answer):
    """The fitted values of the tests, by cycles."""

    cycles: list[Real] = Field(description="Duty cycles since new")
    value: list[Real] = Field(description="Fitted value, in the quantity's unit")
    sd: list[Real] = Field(description="Its standard deviation")


class Trajectory(Answer):
    """A tracked quantity over cycles."""

    cycles: list[Real] = Field(description="Duty cycles since new")
    lower: list[Real] = Field(description="5 % quantile")
    median: list[Real] = Field(description="Posterior median")
    upper: list[Real] = Field(description="95 % quantile")


class DegradationItem(Answer):
    """The degradation of one quantity at one pressure."""

    quantity: str = Field(description="A Stribeck parameter, `mean_cof`, `slope`, or a quantity of the lag")
    unit: str = Field(description="Its unit")
    pressure_bar: Real | None = Field(description="Line pressure, bar; null: the mean over the reference pressures")
    speed_rpm: Real | None = Field(description="Speed of a slope, rpm; null for all else")
    frequency_hz: Real | None = Field(description="Frequency of a friction loop, Hz; null for all else")
    coefficients: Coefficients | None = Field(
        description="The coefficients of eq. 6; null if the quantity surely does not follow eq. 6, with too few "
        "tests, and for a slope, which follows from the parameters"
    )
    correlations: list[list[Real]] | None = Field(
        description="Correlations of ξ0, Δ, log φ and log ε, in this order; null without coefficients"
    )
    eq6_probability: Real | None = Field(
        description="Probability that the quantity follows eq. 6; null for a slope and with too few tests"
    )
    draws: CoefficientDraws | None = Field(description="Joint draws of the coefficients, if `draws` requested them")
    measured: Measured = Field(description="The fitted values of the tests")
    trajectory: Trajectory = Field(description="The course as tracked, with its 90 % band; empty with too few tests")


class SeverityWeighed(Answer):
    """Exponent by which the work of a duty cycle ages this clutch, estimated from the tests of a life with varying duty."""

    basis: str = Field(description="The work: `dissipated_energy` or `sliding_distance`")
    exponents: list[Real] = Field(description="The compared exponents; 0: every cycle ages the clutch equally")
    probabilities: list[Real] = Field(description="Probability of each exponent")
    value: Real = Field(description="Their mean")
    sd: Real = Field(description="Their standard deviation")


class Degradation(Answer):
    """Eq. 6 for every Stribeck parameter and for mean COF, or the track of one quantity."""

    clutch_id: ClutchName
    revision: Revision
    method: MethodName = Field(description="The filter")
    life: LifeNumber = Field(description="The life that the tracks belong to")
    items: list[DegradationItem] = Field(description="The quantities of this page, by pressure")
    severity_estimate: SeverityWeighed | None = Field(
        description="The exponent of severity, estimated from the tests of this life; null if its duty states no "
        "work or hardly varies, with too few tests, or if one quantity was requested"
    )
    held_runs: HeldLeftOut
    warnings: Warnings
    model: Model
    prior: Prior
    severity: SeverityUsed
    next: Next


class SurfaceParameters(Answer):
    """The Stribeck parameters, one row per count of cycles, one column per pressure."""

    static_torque_nm: list[list[Real]] = Field(description="Static torque M_s, Nm")
    coulomb_ratio: list[list[Real]] = Field(description="Coulomb torque over static torque, M̄_c")
    stribeck_velocity_m_s: list[list[Real]] = Field(description="Stribeck velocity V_S, m/s")
    viscous_coefficient: list[list[Real]] = Field(description="Viscous coefficient C_v, Nm/(m/s)^0.3")


class Surfaces(Answer):
    """The tracked Stribeck parameters over cycles and pressure (figs. 10, 11), and torque over speed too."""

    clutch_id: ClutchName
    revision: Revision
    held_runs: HeldLeftOut
    warnings: Warnings
    cycles: list[Real] = Field(description="The axis of duty cycles since new")
    pressure_bar: list[Real] = Field(description="The axis of line pressure, bar")
    speed_rpm: list[Real] = Field(description="The axis of speed, rpm")
    parameters: SurfaceParameters = Field(description="The parameters by cycles and pressure")
    torque_nm: list[list[list[Real]]] = Field(description="Torque by cycles, pressure and speed, Nm")
    model: Model
    prior: Prior
    severity: SeverityUsed


class EngagementChannels(Answer):
    """The time course of an engagement, one column per quantity."""

    time_s: list[Real] = Field(description="Time, s")
    pressure_bar: list[Real] = Field(description="Line pressure, bar")
    speed_rpm: list[Real] = Field(description="Sliding speed, rpm")
    torque_nm: list[Real] = Field(description="Friction torque, Nm")
    motor_torque_nm: list[Real] = Field(description="The motor's torque, Nm")


class AllIndicators(Indicators):
    """The indicators of one engagement, and its comparison with the first ones of the life (null: they had other duty)."""

    normalised_duration: IndicatorEstimate | None = Field(
        description="Duration of slip over that of the first engagements"
    )
    euclidean_distance: IndicatorEstimate | None = Field(
        description="Distance of the speed curve from that of the first engagements"
    )
    spectral_angle_rad: IndicatorEstimate | None = Field(
        description="Angle between the speed curve and that of the first engagements, rad"
    )


class MeasuredEngagement(Answer):
    """A measured engagement."""

    run_id: RunName
    cycles: RunCycles
    kind: str = Field(description="The kind of run")
    time: str = Field(description="When the run was started, or received if that is unknown, ISO 8601")
    initial_speed_rpm: Real = Field(description="Sliding speed at contact, rpm")
    maximum_pressure_bar: Real = Field(description="Highest pressure of the slip, bar")
    indicators: AllIndicators = Field(description="The indicators, each with its standard error")


class EngagementTrace(Answer):
    """The time course of an engagement, one column per quantity. Time counts from contact."""

    time_s: list[Real] = Field(description="Time since contact, s")
    pressure_bar: list[Real] = Field(description="Line pressure, bar")
    speed_rpm: list[Real] = Field(description="Sliding speed minus the sensor's reading at standstill, rpm")
    torque_nm: list[Real] = Field(description="Friction torque minus the sensor's reading before contact, Nm")


class ModelledEngagement(Answer):
    """The tracked model's engagement, for the pressure, initial speed and drive of a measured one."""

    channels: EngagementTrace = Field(description="The course of the simulated engagement")
    inertia_kg_m2: Real = Field(description="The shaft's inertia, estimated from its deceleration in the record, kg m²")
    motor_torque_limit_nm: Real = Field(
        description="The drive's torque, estimated from the clutch's torque at standstill, Nm"
    )
    stop_time_s: Real | None = Field(description="Simulated stop time, s; null if the simulated clutch does not stop")
    torque_discrepancy: Real = Field(
        description="Root mean square of measured minus simulated torque, over that of the measured torque"
    )
    stop_time_difference_s: Real | None = Field(description="Measured minus simulated stop time, s")
    stop_time_difference_sd_s: Real | None = Field(description="Standard error of the measured stop time, s")


class ComparedEngagement(Answer):
    """A measured engagement beside the tracked model's."""

    run_id: RunName
    cycles: RunCycles
    channels: EngagementTrace = Field(description="The measured course, averaged over equal steps of time")
    model: ModelledEngagement | None = Field(
        description="The simulated time course; null if the record does not show the drive"
    )


class EngagementOut(Answer):
    """A simulated engagement of the tracked clutch, and the measured ones."""

    clutch_id: ClutchName
    origin: Origin
    simulated: Literal[True] = Field(
        description="Always true: the engagement is simulated, whatever the clutch's origin"
    )
    at_cycles: Real = Field(description="Duty cycles since new of the clutch's state")
    model: Model
    initial_speed_rpm: Real = Field(description="Sliding speed at the start, rpm")
    maximum_pressure_bar: Real = Field(description="Highest line pressure, bar")
    motor_torque_limit_nm: Real = Field(description="The motor's limit, Nm")
    engaged: bool = Field(description="Whether the clutch comes to standstill")
    duration_s: Real | None = Field(description="From contact to standstill, s; null while it slips")
    energy_kj: Real = Field(description="Dissipated energy, kJ")
    channels: EngagementChannels = Field(description="The course of the engagement")
    measured: list[MeasuredEngagement] = Field(description="The measured engagements that were evaluated, by cycles")
    compared: ComparedEngagement | None = Field(
        description="One measured engagement beside the tracked model's; null if this life has none"
    )
    held_runs: HeldLeftOut
    warnings: Warnings
