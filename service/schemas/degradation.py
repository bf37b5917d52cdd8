"""Eq. 6 along a life: coefficients, trajectories, COF from the parameters, and surfaces over pressure and cycles."""

from pydantic import Field

from service.schemas.base import Answer, ClutchName, Next, Revision
from service.schemas.life import LifeNumber, MethodName, Model, Prior, Quantiles, SeverityUsed
from service.schemas.run import Warned


class Estimate(Answer):
    """The posterior of a coefficient."""

    value: float = Field(description="Posterior mean")
    sd: float = Field(description="Posterior standard deviation")
    quantiles: Quantiles = Field(description="Posterior quantiles, by probability")


class Coefficients(Answer):
    """The coefficients of eq. 6."""

    initial: Estimate = Field(description="Initial value ξ0, in the quantity's unit")
    change: Estimate = Field(description="Change Δ, in the quantity's unit")
    scale_cycles: Estimate = Field(description="Scale φ, duty cycles")
    exponent: Estimate = Field(description="Exponent ε")


class CoefficientDraws(Answer):
    """Joint draws of the coefficients of eq. 6, of equal weight: the same place of all four columns is one draw."""

    initial: list[float] = Field(description="Initial value ξ0, in the quantity's unit")
    change: list[float] = Field(description="Change Δ, in the quantity's unit")
    scale_cycles: list[float] = Field(description="Scale φ, duty cycles")
    exponent: list[float] = Field(description="Exponent ε")


class Measured(Answer):
    """The fitted values of the tests, by cycles."""

    cycles: list[float] = Field(description="Duty cycles since new")
    value: list[float] = Field(description="Fitted value, in the quantity's unit")
    sd: list[float] = Field(description="Its standard deviation")


class Trajectory(Answer):
    """A tracked quantity over cycles."""

    cycles: list[float] = Field(description="Duty cycles since new")
    median: list[float] = Field(description="Posterior median")
    lower: list[float] = Field(description="5 % quantile")
    upper: list[float] = Field(description="95 % quantile")


class DegradationItem(Answer):
    """The degradation of one quantity at one pressure."""

    quantity: str = Field(description="A Stribeck parameter, `mean_cof`, `slope`, or a quantity of the lag")
    unit: str = Field(description="Its unit")
    pressure_bar: float | None = Field(description="Line pressure, bar; null: the mean over the reference pressures")
    speed_rpm: float | None = Field(description="Speed of a slope, rpm; null for all else")
    frequency_hz: float | None = Field(description="Frequency of a friction loop, Hz; null for all else")
    coefficients: Coefficients | None = Field(
        description="The coefficients of eq. 6, where the quantity follows it; null where it surely does not, with too few "
        "tests, and of a slope, which follows from the parameters"
    )
    correlations: list[list[float]] | None = Field(
        description="Correlations of ξ0, Δ, log φ and log ε, in this order; null where there are no coefficients"
    )
    eq6_probability: float | None = Field(
        description="How probable it is that the quantity follows eq. 6; null of a slope and with too few tests"
    )
    draws: CoefficientDraws | None = Field(description="Joint draws of the coefficients, where `draws` asked for them")
    measured: Measured = Field(description="The fitted values of the tests")
    trajectory: Trajectory = Field(description="The course as tracked, with its 90 % band; empty with too few tests")


class Disagreement(Answer):
    """COF from the parameters less the direct track, in standard deviations of the difference."""

    now_sd: float | None = Field(description="Of the present value; null where it has no uncertainty")
    end_of_life_sd: float | None = Field(description="Of the median end of life; null beyond the horizon")


class Rebuilt(Answer):
    """COF from the parameters: mean COF of the Stribeck parameters' own tracks, to compare with its direct track."""

    trajectory: Trajectory = Field(description="Mean COF from the parameters, with its 90 % band")
    end_of_life_cycles: Quantiles = Field(description="Quantiles of the duty cycles since new at the end of life")
    disagreement: Disagreement = Field(description="How far it is from the direct track")


class SeverityWeighed(Answer):
    """By which power of its work a duty cycle ages this clutch, by the tests of one life whose duty varies."""

    basis: str = Field(description="The work: `dissipated_energy` or `sliding_distance`")
    exponents: list[float] = Field(
        description="The exponents that were weighed; 0: cycles age alike whatever their work"
    )
    probabilities: list[float] = Field(description="How probable each of them is")
    value: float = Field(description="Their mean")
    sd: float = Field(description="Their standard deviation")


class Degradation(Answer):
    """Eq. 6 for every Stribeck parameter and for mean COF, or the track of one quantity."""

    clutch_id: ClutchName
    revision: Revision
    method: MethodName = Field(description="The filter")
    life: LifeNumber = Field(description="The life that the tracks are of")
    items: list[DegradationItem] = Field(description="The quantities of this page, by pressure")
    held_runs: int = Field(description="Number of runs that are held: the tracks are without them")
    rebuilt: Rebuilt | None = Field(description="COF from the parameters; null with too few tests")
    severity_estimate: SeverityWeighed | None = Field(
        description="The exponent of severity as the tests of this life have it; null where its duty states no work or "
        "hardly varies, with too few tests, and where one quantity was asked for"
    )
    warnings: list[Warned] = Field(description="Warnings, such as tracks that disagree or runs that are held")
    model: Model
    prior: Prior
    severity: SeverityUsed
    next: Next


class SurfaceParameters(Answer):
    """The Stribeck parameters, a row a count of cycles, a column a pressure."""

    static_torque_nm: list[list[float]] = Field(description="Static torque M_s, Nm")
    coulomb_ratio: list[list[float]] = Field(description="Coulomb torque over static torque, M̄_c")
    stribeck_velocity_m_s: list[list[float]] = Field(description="Stribeck velocity V_S, m/s")
    viscous_coefficient: list[list[float]] = Field(description="Viscous coefficient C_v, Nm/(m/s)^0.3")


class Surfaces(Answer):
    """The tracked Stribeck parameters over cycles and pressure (figs. 10, 11), and torque over speed too."""

    clutch_id: ClutchName
    revision: Revision
    held_runs: int = Field(description="Number of runs that are held: the surfaces are without them")
    cycles: list[float] = Field(description="The axis of duty cycles since new")
    pressure_bar: list[float] = Field(description="The axis of line pressure, bar")
    speed_rpm: list[float] = Field(description="The axis of speed, rpm")
    parameters: SurfaceParameters = Field(description="The parameters by cycles and pressure")
    torque_nm: list[list[list[float]]] = Field(description="Torque by cycles, pressure and speed, Nm")
    model: Model
    prior: Prior
    severity: SeverityUsed
