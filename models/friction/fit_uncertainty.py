"""How uncertain an identified Stribeck curve is: noise, covariance and the parameters that the data do not determine.

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

All quantities are in the scaled units of `models.friction.variable_projection.Problem`.

Source of HC2 and HC3: J. G. MacKinnon, H. White, J. Econometrics 29 (1985) 305-325.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from models.arrays import FloatArray
from models.friction import criteria
from models.friction.variable_projection import Problem, Profile, jacobian

#: An eigenvalue of JᵀJ below this share of the largest is rounding.
_ROUNDING = 1e-14
#: A point that the fit passes through has no residual of its own: its 1 - h, and its variance over that of the others, are
#: taken as no less than this in HC3; HC2 takes it for a point like the others.
_LEAST_LEFT, _LEAST_SHARE = 0.05, 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """sd [P] of a point of weight 1, widening [P]: Student's over the normal quantile, inflated [P], assumed [P].

    shaped [P]: part of the noise is taken to go with the torque, because deviations of the points were not given.
    """

    sd: FloatArray
    widening: FloatArray
    inflated: NDArray[np.bool_]
    assumed: NDArray[np.bool_]
    shaped: NDArray[np.bool_]


def estimate_noise(residual: FloatArray, freedom: FloatArray, given_sd: FloatArray, level: FloatArray) -> Noise:
    """The noise of P curves from the weighted sum of squares [P], degrees of freedom [P] and known deviation [P].

    `known` is NaN where it is not given; `level` [P] is the root mean square torque.
    """
    given, estimable = np.isfinite(given_sd), freedom >= 1
    spare = np.maximum(freedom, 1.0)
    given_sd = np.where(given, given_sd, 1.0)
    inflated = given & estimable & (residual / given_sd**2 > chdtri(spare, criteria.DISBELIEVED))
    estimated = (estimable & ~given) | inflated
    sd = np.where(estimated, np.sqrt(residual / spare), np.where(given, given_sd, criteria.ASSUMED_NOISE * level))
    return Noise(
        sd=np.maximum(sd, 1e-6 * level),  # some noise there is
        widening=np.where(estimated, stdtrit(spare, 0.95) / criteria.Z90, 1.0),
        inflated=inflated,
        assumed=~estimated & ~given,
        shaped=estimated & ~given,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """covariance [P, 4, 4] of (M_s, M̄_c, V_S, C_v), all but M̄_c scaled, as wide as the interval of one test needs it, and
    without that bias; undetermined [P, 4]."""

    covariance: FloatArray
    unbiased_covariance: FloatArray
    undetermined: NDArray[np.bool_]


def uncertainty(problem: Problem, optimum: Profile, scan: Profile, noise: Noise, level: FloatArray) -> Uncertainty:
    """Covariance of the optimum [P, 1] with a > 0, and which parameters the data do not determine."""
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
        for shape in _shapes(problem, columns, optimum, noise)
    )
    deviation = np.sqrt(np.maximum(np.einsum("pii->pi", covariance), 0.0))
    ratio = transform[:, 1, 1] * optimum.coefficients[:, 0, 1]
    viscous = np.sqrt((problem.viscous**2).sum(axis=1) / points)
    scale = np.stack([level, np.maximum(ratio, 1.0), transform[:, 2, 3], level / np.maximum(viscous, 1e-100)], axis=1)
    undetermined = deviation > criteria.UNDETERMINED_SHARE * scale
    undetermined[:, 2] |= stray > criteria.STRAY
    return Uncertainty(covariance=covariance, unbiased_covariance=unbiased, undetermined=undetermined)


def _covariance(
    columns: FloatArray, prior: FloatArray, shape: FloatArray, sd: FloatArray, stray: FloatArray, transform: FloatArray
) -> FloatArray:
    """Of the four parameters [P, 4, 4], for columns J [P, n, 4], their priors' deviations [P, 4] and points of variance
    `shape` [P, n] times sd² [P], widened where V_S strays [P]."""
    inner = _linearised(columns * prior[:, None, :], shape, sd)
    inner *= prior[:, :, None] * prior[:, None, :]
    variance = inner[:, 3, 3]
    missing = np.where(stray > criteria.STRAY, np.maximum((stray / criteria.Z90) ** 2 - variance, 0.0), 0.0)
    direction = inner[:, :, 3] / variance[:, None]
    inner += missing[:, None, None] * direction[:, :, None] * direction[:, None, :]
    covariance = transform @ inner @ transform.swapaxes(1, 2)
    return np.asarray((covariance + covariance.swapaxes(1, 2)) / 2)


def _shapes(problem: Problem, columns: FloatArray, optimum: Profile, noise: Noise) -> tuple[FloatArray, FloatArray]:
    """Variance of each point [P, n] over `noise.sd`²: its own r²/(1 - h)², and r²/(1 - h); both 1 where the deviations are
    given, the first wider where they were raised. Where 1 - h is next to nothing so is r², whatever the noise: in the second
    such a point has the variance of the others."""
    fitted = (columns[:, :, :3] @ optimum.coefficients[:, 0, :, None])[..., 0]
    left = 1.0 - _leverage(columns)
    residual = np.square((problem.torque - fitted) / noise.sd[:, None])
    floor = np.maximum(left, _LEAST_LEFT)
    shaped = noise.shaped[:, None]
    wide = np.where(shaped, np.maximum(residual / floor**2, _LEAST_SHARE), noise.widening[:, None] ** 2)
    return wide, np.where(shaped & (left >= _LEAST_LEFT), np.maximum(residual / floor, _LEAST_SHARE), 1.0)


def _leverage(columns: FloatArray) -> FloatArray:
    """h [P, n], the diagonal of J (JᵀJ)⁻¹ Jᵀ for columns J [P, n, 4]; what is rounding of JᵀJ has none."""
    values, vectors = np.linalg.eigh(columns.swapaxes(1, 2) @ columns)
    sound = values > _ROUNDING * values[:, -1:]
    scale = np.where(sound, 1.0 / np.sqrt(np.where(sound, values, 1.0)), 0.0)
    return np.asarray(np.square(columns @ (vectors * scale[:, None, :])).sum(axis=2))


def _linearised(columns: FloatArray, shape: FloatArray, sd: FloatArray) -> FloatArray:
    """M (CᵀDC/σ² + 1) M, M = (CᵀC/σ² + 1)^-1, for columns C [P, n, 4] and D = diag(shape [P, n]): [P, 4, 4].

    The inverse goes by eigenvalues, those that are rounding taken as zero.
    """
    columns = columns / sd[:, None, None]
    across = columns.swapaxes(1, 2)
    values, vectors = np.linalg.eigh(across @ columns)
    values = np.where(values > _ROUNDING * values[:, -1:], values, 0.0)
    inverse = (vectors / (values + 1)[:, None, :]) @ vectors.swapaxes(1, 2)
    middle = across @ (shape[..., None] * columns) + np.eye(4)
    return np.asarray(inverse @ middle @ inverse)


def _stray(optimum: Profile, scan: Profile, noise: Noise) -> FloatArray:
    """How far [P] from the optimum, in log V_S, the profile still lies within the 90 % likelihood interval."""
    limit = optimum.residual + (criteria.Z90 * noise.widening * noise.sd)[:, None] ** 2
    distance = np.abs(scan.log_velocity - optimum.log_velocity)
    return np.asarray(np.where(scan.residual <= limit, distance, 0.0).max(axis=1))


def _transform(problem: Problem, optimum: Profile) -> FloatArray:
    """∂(M_s, M̄_c, V_S, C_v)/∂(a, b e_max, c, log V_S) [P, 4, 4]."""
    a, b = optimum.coefficients[:, 0, :2].T
    v_s = np.exp(optimum.log_velocity[:, 0])
    peak = v_s * problem.fastest
    per_a = np.exp(peak) / a
    transform = np.zeros((len(a), 4, 4))
    transform[:, 0, 0] = transform[:, 3, 2] = 1.0
    transform[:, 1, 0], transform[:, 1, 1], transform[:, 1, 3] = -b * per_a / a, per_a, b * per_a * peak
    transform[:, 2, 3] = v_s
    return transform
