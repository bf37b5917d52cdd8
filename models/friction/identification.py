"""Identification of the four Stribeck parameters of every pressure of a stationary test, eq. 4-5, with uncertainty.

The estimate is the global optimum of eq. 4 (see `friction.variable_projection`), weighted by 1/torque_sd where that is
given.

The covariance is always finite, and estimate ± 1.645 standard errors holds the truth in 90 % of tests for every parameter
that is not called undetermined.

Where the optimum has M_s = 0 with M_s M̄_c finite (a torque that only rises), M_s is set to a millionth of the torque,
so that M̄_c exists and the curve is right to a millionth; M̄_c is then called undetermined. Where V_S has no influence on
the fit it is set to the middle of the speeds, and a single speed is fitted by a constant torque.

The covariance is the linearised one, σ² (JᵀJ)^-1 in (M_s, M_s M̄_c e_max, C_v, log V_S), transformed to the four
parameters by the delta method. J has all four columns also where a parameter is at its bound, so that an interval there
is not too narrow.

- σ² is the residual variance with n - (free parameters) degrees of freedom.
- How the noise depends on the torque is unknown: sensors have noise in proportion to torque and noise that is constant.
  So the middle of the covariance ("sandwich") has each point's own squared residual r²/(1 - h)², h its leverage, for its
  variance (HC3). Estimate ± 1.645 standard errors then holds the truth in 88 to 92 % of tests for noise of either kind, of
  the slope at low speeds too, which hangs on a few points of high leverage; with (JᵀJ)^-1 alone it was 84 to 87 % under
  noise in proportion. HC3 errs to the wide side by itself in small samples: no Student's factor is on top of it.
- That width makes up for the error of a variance that one test's residuals give. Where tests are taken together it is too
  much: there r²/(1 - h) (HC2) stands for the variance, whose mean over tests is that of the errors, within a third in
  every direction from six speeds on, where all four parameters are determined.
- Where the deviation of the points is given it is the noise, unless the weighted residuals exceed the 99 % point of χ²:
  then the noise follows from the residuals, as above.
- Without any degree of freedom, and without given deviations, noise of 5 % of the torque is assumed.
- A weak prior keeps the covariance finite: each term of the torque has a deviation of three times the torque, log V_S one
  of 5. What the data do not determine (rank deficiency, one speed) gets that variance.
- Where values of V_S a factor e away lie within the 90 % interval of the profile, V_S is not determined, and the
  covariance is widened along the profile's direction up to them.

All quantities are in the scaled units of `models.friction.variable_projection.ProjectionProblem`.

Source of HC2 and HC3: J. G. MacKinnon, H. White, J. Econometrics 29 (1985) 305-325.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from models.arrays import FloatArray
from models.friction import criteria
from models.friction.criteria import ACCEPTABLE_ERROR, ACCEPTABLE_MSE, ASSUMED_NOISE
from models.friction.stribeck import (
    GAMMA,
    PARAMETER_NAMES,
    STANDSTILL,
    StribeckParameters,
    gradient,
    slope,
    slope_gradient,
    torque,
)
from models.friction.variable_projection import ProjectionProblem, VelocityProfile, jacobian, make_problem, minimise
from models.records.runs import Curve

#: An eigenvalue of JᵀJ below this share of the largest is rounding.
_ROUNDING = 1e-14


@dataclass(frozen=True, slots=True, kw_only=True)
class FitNoise:
    """Noise of P curves: standard deviation sd [P] of a point of weight 1, widening [P]: Student's over the normal
    quantile, inflated [P], assumed [P].

    shaped [P]: part of the noise is taken to go with the torque, because deviations of the points were not given.
    """

    sd: FloatArray
    widening: FloatArray
    inflated: NDArray[np.bool_]
    assumed: NDArray[np.bool_]
    shaped: NDArray[np.bool_]


def estimate_noise(
    residual: FloatArray, freedom: FloatArray, given_sd: FloatArray, level: FloatArray, disbelieved: float = 0.01
) -> FitNoise:
    """The noise of P curves from the weighted sum of squares [P], degrees of freedom [P] and given deviation [P], NaN where
    it is not given; `level` [P] is the root mean square torque.

    A given deviation is `disbelieved` where the residuals exceed the 1 - this quantile of χ².
    """
    is_given, estimable = np.isfinite(given_sd), freedom >= 1
    spare = np.maximum(freedom, 1.0)
    given_sd = np.where(is_given, given_sd, 1.0)
    inflated = is_given & estimable & (residual / given_sd**2 > chdtri(spare, disbelieved))
    estimated = (estimable & ~is_given) | inflated
    sd = np.where(estimated, np.sqrt(residual / spare), np.where(is_given, given_sd, criteria.ASSUMED_NOISE * level))
    return FitNoise(
        sd=np.maximum(sd, 1e-6 * level),  # some noise there is
        widening=np.where(estimated, stdtrit(spare, 0.95) / criteria.Z90, 1.0),
        inflated=inflated,
        assumed=~estimated & ~is_given,
        shaped=estimated & ~is_given,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """Covariance [P, 4, 4] of (M_s, M̄_c, V_S, C_v), all but M̄_c scaled, as wide as the interval of one test needs it,
    and without that bias; undetermined [P, 4]."""

    covariance: FloatArray
    unbiased_covariance: FloatArray
    undetermined: NDArray[np.bool_]


def uncertainty(
    problem: ProjectionProblem,
    optimum: VelocityProfile,
    scan: VelocityProfile,
    noise: FitNoise,
    level: FloatArray,
    share: float = 0.5,
) -> Uncertainty:
    """Covariance of the optimum [P, 1] with a > 0, and which parameters the data do not determine: those with a standard
    error above a `share` of their scale, and V_S where values a factor e away are as likely as the 90 % interval allows."""
    columns = jacobian(problem, optimum)
    points = (problem.weight**2).sum(axis=1)
    size = np.sqrt((columns**2).sum(axis=1) / points[:, None])
    # so weak that they matter only to what the data do not determine
    prior = 3.0 * level[:, None] / np.where(size > 0, size, 1.0)
    prior[:, 3] = 5.0
    stray = _stray(optimum, scan, noise)
    transform = _transform(problem, optimum)
    covariance, unbiased = (
        _covariance(columns, prior, shape, noise.sd, stray, transform)
        for shape in _relative_variances(problem, columns, optimum, noise)
    )
    deviation = np.sqrt(np.maximum(np.einsum("pii->pi", covariance), 0.0))
    ratio = transform[:, 1, 1] * optimum.coefficients[:, 0, 1]
    viscous = np.sqrt((problem.viscous**2).sum(axis=1) / points)
    scale = np.stack([level, np.maximum(ratio, 1.0), transform[:, 2, 3], level / np.maximum(viscous, 1e-100)], axis=1)
    undetermined = deviation > share * scale
    undetermined[:, 2] |= stray > 1.0
    return Uncertainty(covariance=covariance, unbiased_covariance=unbiased, undetermined=undetermined)


def _covariance(
    columns: FloatArray, prior: FloatArray, shape: FloatArray, sd: FloatArray, stray: FloatArray, transform: FloatArray
) -> FloatArray:
    """Covariance [P, 4, 4] of the four parameters: columns J [P, n, 4] of the linearised fit, priors' deviations [P, 4] and
    variances of the points, `shape` [P, n] times sd² [P]; `transform` [P, 4, 4] leads from the fit's coordinates to the
    parameters. Where the 90 % interval of log V_S, the fourth coordinate, reaches further than a factor e (`stray` [P] > 1),
    the variance along it is widened to that half-range: the linearised fit is too sure."""
    inner = _sandwich(columns * prior[:, None, :], shape, sd)
    inner *= prior[:, :, None] * prior[:, None, :]
    variance = inner[:, 3, 3]
    missing = np.where(stray > 1.0, np.maximum((stray / criteria.Z90) ** 2 - variance, 0.0), 0.0)
    direction = inner[:, :, 3] / variance[:, None]
    inner += missing[:, None, None] * direction[:, :, None] * direction[:, None, :]
    covariance = transform @ inner @ transform.swapaxes(1, 2)
    return np.asarray((covariance + covariance.swapaxes(1, 2)) / 2)


def _relative_variances(
    problem: ProjectionProblem, columns: FloatArray, optimum: VelocityProfile, noise: FitNoise
) -> tuple[FloatArray, FloatArray]:
    """Two estimates [P, n] of the points' variances, relative to `noise.sd`², from residual r and leverage h: the wider
    r²/(1 - h)² (HC3), and the unbiased r²/(1 - h) (HC2).

    Where deviations are given both are 1, or the wider one the square of what they were raised by. A point that the fit
    passes through (h near 1) has no residual of its own: in the wider estimate 1 - h and the variance have a floor, in
    the unbiased one its variance is 1."""
    fitted = (columns[:, :, :3] @ optimum.coefficients[:, 0, :, None])[..., 0]
    left = 1.0 - _leverage(columns)
    residual = np.square((problem.torque - fitted) / noise.sd[:, None])
    least_left, least = 0.05, 1e-4
    floor = np.maximum(left, least_left)
    shaped = noise.shaped[:, None]
    wide = np.where(shaped, np.maximum(residual / floor**2, least), noise.widening[:, None] ** 2)
    return wide, np.where(shaped & (left >= least_left), np.maximum(residual / floor, least), 1.0)


def _leverage(columns: FloatArray) -> FloatArray:
    """Leverage h [P, n], the diagonal of J (JᵀJ)⁻¹ Jᵀ for columns J [P, n, 4]; directions whose eigenvalue of JᵀJ is
    rounding are left out."""
    values, vectors = np.linalg.eigh(columns.swapaxes(1, 2) @ columns)
    sound = values > _ROUNDING * values[:, -1:]
    scale = np.where(sound, 1.0 / np.sqrt(np.where(sound, values, 1.0)), 0.0)
    return np.asarray(np.square(columns @ (vectors * scale[:, None, :])).sum(axis=2))


def _sandwich(columns: FloatArray, relative_variance: FloatArray, sd: FloatArray) -> FloatArray:
    """The linearised covariance of the scaled terms [P, 4, 4]: M (CᵀDC/σ² + 1) M with M = (CᵀC/σ² + 1)^-1.

    C are the columns [P, n, 4] of the Jacobian, σ = `sd` [P] the noise, D the diagonal of each point's variance in units of
    σ² [P, n], and 1 the weak prior's. M goes by eigenvalues; those that are rounding are taken as zero.
    """
    columns = columns / sd[:, None, None]
    across = columns.swapaxes(1, 2)
    values, vectors = np.linalg.eigh(across @ columns)
    values = np.where(values > _ROUNDING * values[:, -1:], values, 0.0)
    inverse = (vectors / (values + 1)[:, None, :]) @ vectors.swapaxes(1, 2)
    middle = across @ (relative_variance[..., None] * columns) + np.eye(4)
    return np.asarray(inverse @ middle @ inverse)


def _stray(optimum: VelocityProfile, scan: VelocityProfile, noise: FitNoise) -> FloatArray:
    """Largest distance [P] in log V_S from the optimum at which the profile lies within the 90 % likelihood
    interval."""
    limit = optimum.residual + (criteria.Z90 * noise.widening * noise.sd)[:, None] ** 2
    distance = np.abs(scan.log_velocity - optimum.log_velocity)
    return np.asarray(np.where(scan.residual <= limit, distance, 0.0).max(axis=1))


def _transform(problem: ProjectionProblem, optimum: VelocityProfile) -> FloatArray:
    """Jacobian ∂(M_s, M̄_c, V_S, C_v)/∂(a, b e_max, c, log V_S) [P, 4, 4]."""
    a, b = optimum.coefficients[:, 0, :2].T
    v_s = np.exp(optimum.log_velocity[:, 0])
    peak = v_s * problem.fastest
    per_a = np.exp(peak) / a
    transform = np.zeros((len(a), 4, 4))
    transform[:, 0, 0] = transform[:, 3, 2] = 1.0
    transform[:, 1, 0], transform[:, 1, 1], transform[:, 1, 3] = -b * per_a / a, per_a, b * per_a * peak
    transform[:, 2, 3] = v_s
    return transform


class StribeckFitStatus(StrEnum):
    """DETERMINED; AT_BOUND: a parameter is zero; UNDETERMINED: the data do not determine some of them."""

    DETERMINED = "determined"
    AT_BOUND = "at_bound"
    UNDETERMINED = "undetermined"


@dataclass(frozen=True, slots=True, kw_only=True)
class StribeckFit:
    """The identified curve of one pressure [Pa].

    covariance [4, 4] in the order of PARAMETER_NAMES, finite always, is as wide as the interval of one test needs it;
    unbiased_covariance [4, 4] is that of the errors in the mean over tests, for who takes many together, where all four are
    determined (else both are as wide as what the data leave open); noise [Nm]: the deviation of a point; mse_percent: eq. 5,
    unweighted, on torque folded to v >= 0, None where that does not vary; rmse [Nm]; acceptable: mse_percent < 5, or rmse
    within what the scatter from point to point explains (`_within_noise`); undetermined: names of parameters.
    """

    pressure: float
    parameters: StribeckParameters
    covariance: FloatArray
    unbiased_covariance: FloatArray
    status: StribeckFitStatus
    undetermined: tuple[str, ...]
    noise: float
    mse_percent: float | None
    rmse: float
    acceptable: bool
    points: int
    message: str

    @property
    def standard_errors(self) -> FloatArray:
        """Standard errors [4] in the order of PARAMETER_NAMES; estimate ± 1.645 of them holds the truth in 90 % of
        tests."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Folded:
    """A curve folded to v >= 0 and scaled: speed [n] and torque [n] in 0..1 and -1..1 of their scales, weight [n]."""

    curve: Curve
    speed: FloatArray
    torque: FloatArray
    weight: FloatArray
    speed_scale: float
    torque_scale: float
    distinct: int  # speeds that differ by more than a millionth of the highest
    known_noise: float | None  # the deviation of a point of weight 1, in torque_scale


def fit_curves(curves: Sequence[Curve], at_once: int = 20_000) -> tuple[StribeckFit, ...]:
    """Eq. 4-5 for every curve: the global optimum with all four parameters >= 0, its covariance and status. So many points
    are fitted at once, which bounds the memory of a scan.

    Velocity [n] m/s of either sign (the model is odd: folded by the sign bit), torque [n] Nm, n >= 1.
    Raises ValueError where a curve is empty, has unequal lengths, a value that is not finite, or torque_sd <= 0;
    numerically hard input gets a status.
    """
    folded = [_fold(curve) for curve in curves]
    fits: list[StribeckFit] = []
    start = 0
    while start < len(folded):
        stop, longest = start, 0
        while stop < len(folded):
            longest = max(longest, folded[stop].speed.size)
            if stop > start and longest * (stop - start + 1) > at_once:
                break
            stop += 1
        fits.extend(_fit_batch(folded[start:stop]))
        start = stop
    return tuple(fits)


def mean_torques(fits: Sequence[StribeckFit], velocities: FloatArray, raised: FloatArray | float = 1.0) -> FloatArray:
    """Means of the fitted curves over velocities [m] m/s, and their standard deviations by the delta method [Nm];
    [n, 2]. `raised` [n, m] is the ratio of friction to eq. 3 [-]."""
    stacked = np.stack([fit.parameters.as_array() for fit in fits], axis=1)[:, :, None]
    parameters = StribeckParameters.from_array(stacked)
    factor = np.broadcast_to(raised, (len(fits), velocities.size))
    direction = (gradient(velocities, parameters) * factor[..., None]).mean(axis=1)
    variance = np.einsum("ni,nij,nj->n", direction, np.stack([fit.covariance for fit in fits]), direction)
    means = (torque(velocities, parameters) * factor).mean(axis=1)
    return np.stack([means, np.sqrt(np.maximum(variance, 0.0))], axis=1)


def _fold(curve: Curve) -> _Folded:
    """A curve with speed and torque in units of their largest, both directions folded onto one. Raises ValueError."""
    velocity, measured, sd = curve.velocity, curve.torque, curve.torque_sd
    if measured.ndim != 1 or measured.size == 0:
        raise ValueError(f"torque must be a column with at least one row, got shape {measured.shape}")
    for name, column, least in (("velocity", velocity, -np.inf), ("torque", measured, -np.inf), ("torque_sd", sd, 0.0)):
        if column is None:
            continue
        if column.shape != measured.shape:
            raise ValueError(f"{name} must have the shape of torque {measured.shape}, got {column.shape}")
        bad = ~(np.isfinite(column) & (column > least))
        if bad.any():
            row, rule = int(bad.argmax()), "finite and positive" if least == 0.0 else "finite"
            raise ValueError(f"{name}[{row}] must be {rule}, got {column[row]}")
    speed_scale = float(np.abs(velocity).max())
    speed_scale = speed_scale if speed_scale > STANDSTILL else 1.0
    torque_scale = max(float(np.abs(measured).max()), 1e-100)
    speed = np.where(np.abs(velocity) > STANDSTILL, np.abs(velocity) / speed_scale, 0.0)
    ordered = np.sort(speed)
    return _Folded(
        curve=curve,
        speed=speed,
        torque=np.copysign(1.0, velocity) * (measured / torque_scale),
        weight=np.ones_like(measured) if sd is None else sd.min() / sd,
        speed_scale=speed_scale,
        torque_scale=torque_scale,
        distinct=1 + int(np.count_nonzero(ordered[1:] - ordered[:-1] > 1e-6)),
        known_noise=None if sd is None else float(sd.min()) / torque_scale,
    )


def _fit_batch(folded: Sequence[_Folded]) -> list[StribeckFit]:
    """The fits of several curves, computed together as padded rows."""
    shape = (len(folded), max(curve.speed.size for curve in folded))
    speed, measured, weight = np.ones(shape), np.zeros(shape), np.zeros(shape)
    for row, curve in enumerate(folded):
        n = curve.speed.size
        speed[row, :n], measured[row, :n], weight[row, :n] = curve.speed, curve.torque, curve.weight
    problem = make_problem(speed, measured, weight)
    optimum, scan = minimise(problem)
    level = np.sqrt((problem.torque**2).sum(axis=1) / (weight**2).sum(axis=1))
    level = np.maximum(level, 1e-9)
    distinct = np.array([curve.distinct for curve in folded])
    optimum, bound = _at_bound(_constant(problem, optimum, distinct == 1), level)
    noise = estimate_noise(
        optimum.residual[:, 0],
        np.array([curve.speed.size for curve in folded]) - np.minimum(distinct, 4 - bound.sum(axis=1)),
        np.array([np.nan if curve.known_noise is None else curve.known_noise for curve in folded]),
        level,
    )
    uncertainties = uncertainty(problem, optimum, scan, noise, level)
    return [_describe(curve, row, optimum, bound, noise, uncertainties) for row, curve in enumerate(folded)]


def _constant(problem: ProjectionProblem, optimum: VelocityProfile, single: NDArray[np.bool_]) -> VelocityProfile:
    """The optimum at a single speed, where four parameters fit a mean: M_s is that mean, M̄_c = 1, V_S that speed,
    C_v = 0."""
    if not single.any():
        return optimum
    mean = (problem.torque * problem.weight).sum(axis=1) / (problem.weight**2).sum(axis=1)
    mean = np.maximum(mean, 0.0)
    share = np.exp(-problem.fastest)
    miss = ((problem.torque - mean[:, None] * problem.weight) ** 2).sum(axis=1)
    flat = np.stack([mean, mean * share, np.zeros_like(mean)], axis=1)[:, None]
    return replace(
        optimum,
        log_velocity=np.where(single[:, None], 0.0, optimum.log_velocity),
        coefficients=np.where(single[:, None, None], flat, optimum.coefficients),
        residual=np.where(single[:, None], miss[:, None], optimum.residual),
    )


def _at_bound(optimum: VelocityProfile, level: FloatArray) -> tuple[VelocityProfile, NDArray[np.bool_]]:
    """The optimum with M_s lifted off zero, and whether each of M_s, M̄_c, C_v is zero [P, 3]."""
    coefficients = optimum.coefficients[:, 0]
    least = 1e-6 * level  # M̄_c = b/M_s must exist where the optimum has M_s = 0
    bound = coefficients <= np.stack([least, 0 * least, 0 * least], axis=1)
    lifted = np.hstack([np.maximum(coefficients[:, :1], least[:, None]), coefficients[:, 1:]])
    return replace(optimum, coefficients=lifted[:, None]), bound


def _describe(
    folded: _Folded,
    row: int,
    optimum: VelocityProfile,
    bound: NDArray[np.bool_],
    noise: FitNoise,
    uncertainties: Uncertainty,
) -> StribeckFit:
    """The fit of one row of a batch, in physical units, with its uncertainty, status and message."""
    a, b, c = optimum.coefficients[row, 0].tolist()
    v_s = math.exp(optimum.log_velocity[row, 0])
    fastest = 1.0 if folded.speed.any() else 0.0
    scale = np.array([folded.torque_scale, 1.0, folded.speed_scale, folded.torque_scale / folded.speed_scale**GAMMA])
    values = np.array([a, b * math.exp(v_s * fastest) / a, v_s, c]) * scale
    largest = 1e300  # absurd torques or speeds can overflow a variance
    parameters = StribeckParameters.from_array(np.minimum(values, largest))
    with np.errstate(over="ignore"):
        covariance, unbiased = (
            np.clip(matrix[row] * (scale[:, None] * scale), -largest, largest)
            for matrix in (uncertainties.covariance, uncertainties.unbiased_covariance)
        )
    miss = folded.torque - np.abs(torque(folded.curve.velocity, parameters)) / folded.torque_scale
    mean_square = float((miss**2).mean())
    variance = float(folded.torque.var())
    varies = variance > (1e-9 * float(np.abs(folded.torque).max())) ** 2
    mse = 100 * mean_square / variance if varies else None
    undetermined = _undetermined(folded, uncertainties.undetermined[row])
    at_zero = tuple(PARAMETER_NAMES[i] for i, zero in zip((0, 1, 3), bound[row], strict=True) if zero)
    sd_share = 1.0 if folded.known_noise is None else math.sqrt(float((folded.weight**-2.0).mean()))
    return StribeckFit(
        pressure=folded.curve.pressure,
        parameters=parameters,
        covariance=covariance,
        unbiased_covariance=unbiased,
        status=StribeckFitStatus.UNDETERMINED
        if undetermined
        else StribeckFitStatus.AT_BOUND
        if at_zero
        else StribeckFitStatus.DETERMINED,
        undetermined=undetermined,
        noise=float(noise.sd[row]) * sd_share * folded.torque_scale,
        mse_percent=mse,
        rmse=math.sqrt(mean_square) * folded.torque_scale,
        acceptable=(mse is not None and mse < ACCEPTABLE_MSE) or _within_noise(folded, miss),
        points=folded.speed.size,
        message=_message(folded, undetermined, at_zero, noise, row),
    )


def _within_noise(folded: _Folded, miss: FloatArray) -> bool:
    """Whether the errors [n] are no more than the noise of the points leaves.

    The noise is Σ (e_i+1 - e_i)²/2(n - 1) over errors by speed: what the law misses is smooth along it and hardly changes
    from point to point; a deviation that was given counts where it is more. Too few speeds show nothing of it, and noise
    that is large beside the torque is no excuse.
    """
    if folded.distinct <= len(PARAMETER_NAMES):
        return False
    steps = np.diff(miss[np.argsort(folded.speed, kind="stable")])
    variance = float((steps**2).mean()) / 2
    if folded.known_noise is not None:
        variance = max(variance, folded.known_noise**2 * float((folded.weight**-2.0).mean()))
    rounding = 1e-12
    most = min(ACCEPTABLE_ERROR**2 * variance, ASSUMED_NOISE**2 * float((folded.torque**2).mean()))
    return float((miss**2).mean()) <= most + rounding


def _undetermined(folded: _Folded, too_wide: NDArray[np.bool_]) -> tuple[str, ...]:
    """Names of the undetermined parameters, by the width of their uncertainty; with fewer than four speeds all, except
    M_s where it was measured at rest."""
    too_few = folded.distinct < len(PARAMETER_NAMES)
    seen_at_rest = bool((folded.speed == 0).any())
    return tuple(
        name
        for name, wide in zip(PARAMETER_NAMES, too_wide, strict=True)
        if wide or (too_few and not (name == "static_torque" and seen_at_rest))
    )


def _message(
    folded: _Folded, undetermined: tuple[str, ...], at_zero: tuple[str, ...], noise: FitNoise, row: int
) -> str:
    """A sentence or two on the fit's status for a person."""
    parts, names = [], ", ".join(undetermined)
    if undetermined and folded.distinct < len(PARAMETER_NAMES):
        parts.append(f"Too few different speeds ({folded.distinct}) to determine {names}: test more speeds.")
    elif undetermined:
        parts.append(f"The measured speeds and torques do not determine {names}.")
    if at_zero:
        parts.append(f"The best fit has {', '.join(at_zero)} at zero.")
    if not parts:
        parts.append("All four parameters are determined.")
    if noise.inflated[row]:
        parts.append("The residuals are larger than torque_sd_nm, so the uncertainties come from the residuals.")
    if noise.assumed[row]:
        parts.append(f"Too few points to estimate the noise: {ASSUMED_NOISE:.0%} of the torque is assumed.")
    return " ".join(parts)


def cof_slope(fit: StribeckFit, velocity: float, torque_per_cof: float) -> tuple[float, float] | None:
    """dμ/dv [s/m] and its standard error at velocity > 0 [m/s] where a COF of one is `torque_per_cof` > 0 [Nm]; None of a
    curve without friction.

    Its variance is gᵀ Σ g, with g the `slope_gradient`. Its two terms have opposite signs, so that it passes through 0 as a
    clutch ages: it is tracked additively. A fit that leaves V_S open still has a slope: its covariance is as wide as that.
    Raises ValueError where an argument is not positive.
    """
    if not velocity > 0.0:
        raise ValueError(f"velocity must be positive, got {velocity}")
    if not torque_per_cof > 0.0:
        raise ValueError(f"torque_per_cof must be positive, got {torque_per_cof}")
    gradient = slope_gradient(velocity, fit.parameters)
    sd = math.sqrt(max(0.0, float(gradient @ fit.covariance @ gradient))) / torque_per_cof
    value = float(slope(np.array(velocity), fit.parameters)) / torque_per_cof
    viscous = float(fit.parameters.viscous_coefficient) * float(gradient[3]) / torque_per_cof
    return (value, sd) if sd > 0.0 and (value != viscous or viscous > 0.0) else None
