"""How the Stribeck parameters depend on pressure (fig. 9): three grow linearly, the Coulomb ratio falls to an asymptote.

    M_s, V_S, C_v = α + β p          M̄_c = c_∞ + a e^{-p/p_0},   a, c_∞ >= 0,  p_0 > 0

Weighted least squares through the parameters of one test's pressures, each with the variance of its fit. Given p_0 the
falling law is linear in a and c_∞, so a search over p_0 alone gives the optimum. The covariance of a law's coefficients is
that of the linearised fit, (JᵀWJ)⁻¹, times χ² over its degrees of freedom where that is above 1.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, fig. 9 and section 3.1.2, which gives the shapes but no
formula of the falling one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.friction.criteria import FEWEST_PRESSURES
from models.friction.identification import StribeckFit
from models.friction.stribeck import PARAMETER_NAMES, StribeckParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearPressureLaw:
    """A linear law α + β p: `intercept` in the parameter's unit, `slope` in that unit per Pa."""

    intercept: float
    slope: float

    def __call__(self, pressure: FloatArray) -> FloatArray:
        """The parameter at pressure [...] Pa."""
        return self.intercept + self.slope * pressure

    def gradient(self, pressure: FloatArray) -> FloatArray:
        """Derivatives by (intercept, slope) [n, 2] at pressure [n] Pa."""
        return np.stack([np.ones_like(pressure), pressure], axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class AsymptoticPressureLaw:
    """A law that falls to an asymptote, c_∞ + a e^{-p/p_0}: `asymptote` and `excess` in the parameter's unit, `decay`
    p_0 in Pa."""

    asymptote: float
    excess: float
    decay: float

    def __call__(self, pressure: FloatArray) -> FloatArray:
        """The parameter at pressure [...] Pa."""
        return self.asymptote + self.excess * np.exp(-pressure / self.decay)

    def gradient(self, pressure: FloatArray) -> FloatArray:
        """Derivatives by (asymptote, excess, decay) [n, 3] at pressure [n] Pa; 0 for a coefficient at its bound of
        0."""
        falling = np.exp(-pressure / self.decay)
        by_asymptote = np.ones_like(pressure) if self.asymptote > 0.0 else np.zeros_like(pressure)
        by_excess = falling if self.excess > 0.0 else np.zeros_like(pressure)
        return np.stack([by_asymptote, by_excess, self.excess * falling * pressure / self.decay**2], axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureLaws:
    """The four laws of one stationary test."""

    static_torque: LinearPressureLaw
    coulomb_ratio: AsymptoticPressureLaw
    stribeck_velocity: LinearPressureLaw
    viscous_coefficient: LinearPressureLaw

    def parameters(self, pressure: FloatArray) -> StribeckParameters:
        """The Stribeck parameters at pressure [...] Pa, each at least 0."""
        at = [np.maximum(getattr(self, name)(pressure), 0.0) for name in PARAMETER_NAMES]
        return StribeckParameters(**dict(zip(PARAMETER_NAMES, at, strict=True)))


def fit_pressure_laws(fits: Sequence[StribeckFit]) -> PressureLaws | None:
    """The laws over the fits of one test, or None where a parameter is determined at fewer than three pressures."""
    determined = [_determined(fits, index) for index in range(len(PARAMETER_NAMES))]
    if any(np.unique(pressure).size < FEWEST_PRESSURES for pressure, _, _ in determined):
        return None
    return _laws(determined)


def law_covariances(fits: Sequence[StribeckFit], laws: PressureLaws) -> dict[str, FloatArray]:
    """The covariance of each law's coefficients by the parameter's name, for the fits that `laws` are through."""
    return {
        name: law_covariance(getattr(laws, name), *_determined(fits, index))
        for index, name in enumerate(PARAMETER_NAMES)
    }


def law_covariance(
    law: LinearPressureLaw | AsymptoticPressureLaw, pressure: FloatArray, value: FloatArray, deviation: FloatArray
) -> FloatArray:
    """(JᵀWJ)⁻¹ max(1, χ²/ν) [k, k] of the k coefficients in their order.

    Of the law through value [n] at pressure [n] Pa with deviation [n] > 0. ν is n less the coefficients that are free:
    parameters scatter about a law by more than their own errors where the law is not quite theirs. Rows and columns of a
    coefficient at its bound are 0.
    """
    columns = law.gradient(pressure) / deviation[:, None]
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0  # the coefficient is held
    _, singular, turned = np.linalg.svd(columns / size, full_matrices=False)
    free = singular > 1e-9 * singular[0]  # far above rounding
    root = turned[free] / singular[free, None] / size
    freedom = pressure.size - int(free.sum())
    misfit = float(np.sum(((value - law(pressure)) / deviation) ** 2))
    covariance: FloatArray = root.T @ root * (max(1.0, misfit / freedom) if freedom > 0 else 1.0)
    return covariance


def laws_of(levels: FloatArray, columns: FloatArray) -> PressureLaws:
    """The laws through parameters [l, 4] in the order of PARAMETER_NAMES at levels [l] Pa, equally weighted."""
    return _laws([(levels, column, np.ones_like(levels)) for column in columns.T])


def _laws(points: Sequence[tuple[FloatArray, FloatArray, FloatArray]]) -> PressureLaws:
    """The laws through pressures, values and deviations, in the order of PARAMETER_NAMES."""
    m_s, m_c, v_s, c_v = points
    return PressureLaws(
        static_torque=fit_linear(*m_s),
        coulomb_ratio=fit_asymptotic(*m_c),
        stribeck_velocity=fit_linear(*v_s),
        viscous_coefficient=fit_linear(*c_v),
    )


def over_pressure(name: str, levels: FloatArray, values: FloatArray, pressures: FloatArray) -> FloatArray:
    """A parameter at pressures [p] Pa by its law through values [l, k] of k states at levels [l] Pa; [p, k]."""
    fit = fit_asymptotic if name == "coulomb_ratio" else fit_linear
    equal = np.ones_like(levels)
    return np.stack([fit(levels, column, equal)(pressures) for column in values.T], axis=1)


def fit_linear(pressure: FloatArray, value: FloatArray, deviation: FloatArray) -> LinearPressureLaw:
    """Weighted least squares line through value [n] at pressure [n] Pa, deviation [n] > 0, two pressures or more."""
    scale = float(pressure.max())
    columns = np.stack([np.ones_like(pressure), pressure / scale], axis=1) / deviation[:, None]
    intercept, slope = np.linalg.lstsq(columns, value / deviation, rcond=None)[0].tolist()
    return LinearPressureLaw(intercept=intercept, slope=slope / scale)


def fit_asymptotic(pressure: FloatArray, value: FloatArray, deviation: FloatArray) -> AsymptoticPressureLaw:
    """Weighted least squares in (c_∞, a) >= 0 and p_0, for value [n] at pressure [n] Pa, deviation [n] > 0.

    p_0 is scanned from 0.05 to 20 times the pressures' range, then refined between the best one's neighbours.
    """
    from scipy.optimize import minimize_scalar, nnls  # start-up time: only charts over pressure need it

    least = float(pressure.min())
    span = max(float(np.ptp(pressure)), 1e-6 * least)

    def solve(log_decay: float) -> tuple[FloatArray, float]:
        falling = np.exp((least - pressure) / (span * np.exp(log_decay)))
        coefficients, norm = nnls(
            np.stack([np.ones_like(pressure), falling], axis=1) / deviation[:, None], value / deviation
        )
        return np.asarray(coefficients), float(norm)

    logs = np.log(np.geomspace(0.05, 20.0, 41))
    best = int(np.argmin([solve(float(log))[1] for log in logs]))
    around = (float(logs[max(best - 1, 0)]), float(logs[min(best + 1, logs.size - 1)]))
    refined = minimize_scalar(lambda log: solve(log)[1], bounds=around, method="bounded", options={"xatol": 1e-6})
    log_decay = float(refined.x) if refined.fun <= solve(float(logs[best]))[1] else float(logs[best])
    (asymptote, at_least), _ = solve(log_decay)
    decay = span * float(np.exp(log_decay))
    return AsymptoticPressureLaw(
        asymptote=float(asymptote), excess=float(at_least * np.exp(least / decay)), decay=decay
    )


def _determined(fits: Sequence[StribeckFit], index: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Pressure [n] Pa, value [n] and deviation [n] of a parameter where its fit determines it."""
    usable = [fit for fit in fits if PARAMETER_NAMES[index] not in fit.undetermined]
    value = np.array([fit.parameters.as_array()[index] for fit in usable])
    deviation = np.array([fit.standard_errors[index] for fit in usable])
    # the weights of noiseless fits must stay finite
    least = max(1e-6 * float(np.abs(value).max(initial=0.0)), 1e-100)
    return np.array([fit.pressure for fit in usable]), value, np.maximum(deviation, least)
