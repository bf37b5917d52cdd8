"""Remaining useful life, degradation, Stribeck curves and flat series as they go out."""

from typing import Literal

from service.schemas.base import Answer, Origin
from service.schemas.run import Fit, Loop, Warned

Method = Literal["particle", "ukf", "grid"]
Quantiles = dict[str, float | None]


class Criterion(Answer):
    """When a clutch counts as worn out; null where nothing was measured yet."""

    quantity: Literal["mean_cof"]
    fraction: float
    initial_mean_cof: float | None
    threshold_mean_cof: float | None
    pressure_bar: float | None


class Current(Answer):
    """Where the clutch stands; health is 1 when new and 0 at end of life."""

    mean_cof: float | None
    mean_cof_sd: float | None
    fraction_of_initial: float | None
    health: float | None


class ModelName(Answer):
    """The model behind an answer."""

    name: str
    effects: list[str]


class PriorName(Answer):
    """What was believed before the clutch was measured; a fleet's prior has a version and clutches that taught it."""

    name: Literal["weak", "fleet"]
    version: int | None
    clutches: int


class SeverityName(Answer):
    """What eq. 6 counts."""

    basis: Literal["cycles", "sliding_distance", "dissipated_energy"]
    exponent: float


class RemainingLife(Answer):
    """The duty cycles that remain until mean COF has fallen to the criterion's fraction of its initial value."""

    clutch_id: str
    method: Method
    as_of_cycles: float | None
    runs_used: int
    revision: int
    status: Literal["predicted", "reached", "may_never_reach", "insufficient_data"]
    criterion: Criterion
    current: Current
    remaining_cycles: Quantiles
    end_of_life_cycles: Quantiles
    probability_of_reaching: float | None
    horizon_cycles: float
    model: ModelName
    prior: PriorName
    severity: SeverityName
    warnings: list[Warned]
    origin: Origin


class Estimate(Answer):
    """A coefficient's posterior mean and deviation."""

    value: float
    sd: float


class Coefficients(Answer):
    """Eq. 6's coefficients: initial and change in the quantity's unit, scale in cycles, exponent without unit."""

    initial: Estimate
    change: Estimate
    scale_cycles: Estimate
    exponent: Estimate


class Measured(Answer):
    """What the tests said, a column each."""

    cycles: list[float]
    value: list[float]
    sd: list[float]


class Trajectory(Answer):
    """Eq. 6 over cycles: posterior median and 90 % band."""

    cycles: list[float]
    median: list[float]
    lower: list[float]
    upper: list[float]


class DegradationItem(Answer):
    """One quantity's degradation; `pressure_bar` null is the mean over the reference pressures."""

    quantity: str
    unit: str
    pressure_bar: float | None
    coefficients: Coefficients
    measured: Measured
    trajectory: Trajectory


class Disagreement(Answer):
    """Rebuilt less direct, in deviations: of the value now, and of the median end of life; null beyond the horizon."""

    now_sd: float | None
    end_of_life_sd: float | None


class Rebuilt(Answer):
    """Mean COF rebuilt from the Stribeck parameters' own tracks, beside the direct track of mean COF."""

    trajectory: Trajectory
    end_of_life_cycles: Quantiles
    disagreement: Disagreement


class Degradation(Answer):
    """Eq. 6 for every Stribeck parameter and for mean COF; `rebuilt` is null where too little is known."""

    clutch_id: str
    revision: int
    items: list[DegradationItem]
    rebuilt: Rebuilt | None
    warnings: list[Warned]
    model: ModelName
    prior: PriorName
    severity: SeverityName
    next: str | None


class SurfaceParameters(Answer):
    """Each Stribeck parameter by cycles and pressure."""

    static_torque_nm: list[list[float]]
    coulomb_ratio: list[list[float]]
    stribeck_velocity_m_s: list[list[float]]
    viscous_coefficient: list[list[float]]


class Surfaces(Answer):
    """Tracked Stribeck parameters by cycles and pressure (figs. 10, 11), and torque by cycles, pressure and speed."""

    clutch_id: str
    revision: int
    cycles: list[float]
    pressure_bar: list[float]
    speed_rpm: list[float]
    parameters: SurfaceParameters
    torque_nm: list[list[list[float]]]
    model: ModelName
    prior: PriorName
    severity: SeverityName


class LinearLaw(Answer):
    """value = intercept + slope · pressure_bar."""

    intercept: float
    slope_per_bar: float


class AsymptoticLaw(Answer):
    """value = asymptote + excess · exp(-pressure_bar / decay_bar)."""

    asymptote: float
    excess: float
    decay_bar: float


class PressureLawsOut(Answer):
    """How the Stribeck parameters depend on pressure (fig. 9)."""

    static_torque_nm: LinearLaw
    coulomb_ratio: AsymptoticLaw
    stribeck_velocity_m_s: LinearLaw
    viscous_coefficient: LinearLaw


class StribeckItem(Answer):
    """The curves of one stationary test."""

    run_id: str
    cycles: float
    fits: list[Fit]
    pressure_laws: PressureLawsOut | None


class StribeckPage(Answer):
    """Stationary tests by cycles."""

    items: list[StribeckItem]
    next: str | None


class EngagementChannels(Answer):
    """The trace, a column each."""

    time_s: list[float]
    pressure_bar: list[float]
    speed_rpm: list[float]
    torque_nm: list[float]
    motor_torque_nm: list[float]


class EngagementOut(Answer):
    """A simulated engagement of the tracked clutch; `duration_s` from contact to standstill, null where it slips on."""

    clutch_id: str
    origin: Origin
    simulated: Literal[True]
    at_cycles: float
    model: ModelName
    initial_speed_rpm: float
    maximum_pressure_bar: float
    motor_torque_limit_nm: float
    engaged: bool
    duration_s: float | None
    energy_kj: float
    channels: EngagementChannels


class LoopItem(Loop):
    """A friction loop of one dynamic test at one pressure."""

    run_id: str
    cycles: float


class LoopPage(Answer):
    """Friction loops by cycles."""

    items: list[LoopItem]
    next: str | None


class SeriesItem(Answer):
    """One value of one quantity at one count of cycles."""

    cycles: float
    time: str | None
    run_id: str | None
    quantity: str
    unit: str
    pressure_bar: float | None
    value: float | None
    lower: float | None
    upper: float | None


class SeriesPage(Answer):
    """Flat rows for dashboards and spreadsheets."""

    items: list[SeriesItem]
    next: str | None
