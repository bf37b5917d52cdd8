"""The global optimum of eq. 4-5 by variable projection: a scan over V_S, with the rest solved exactly at every V_S.

Given V_S, eq. 3 is linear in a = M_s, b = M_s M̄_c, c = C_v:

    |S| = a (1 - e) + b e + c |v|^γ,    e = exp(-V_S/|v|),    a, b, c >= 0

a non-negative least squares problem of three columns. Its optimum is the best of the seven sets of columns whose own
least squares solution is not negative, and each has a closed form. So eq. 4 in four dimensions becomes a search over
the one variable log V_S, which can be scanned densely: no start value, no local optimum that is missed.

Conditioning: e is divided by its value at the highest speed, e_max, so that it does not underflow as V_S grows, and is
taken by expm1, so that 1 - e does not cancel as V_S shrinks: with one array z [n],

    V_S < v_max:  z = expm1(-V_S/v) = e - 1               V_S >= v_max:  z = expm1(V_S/v_max - V_S/v) = e/e_max - 1

1 - e and e/e_max are each α + β z. All three columns at once span {1, |v|^γ, z}; the first two do not depend on V_S, so
they are made orthonormal once and z is projected off them.

Everything is vectorised over the P curves of a test and K values of V_S. Padding rows carry weight 0.

Source of the method: G. H. Golub, V. Pereyra, "Separable nonlinear least squares", Inverse Problems 19 (2003) R1.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.friction.stribeck import GAMMA

#: V_S is sought from LOW times the lowest to HIGH times the highest speed of a curve. Below, e is 1 - V_S/v to 1e-5 and
#: M_s V_S is all that can be known; above, e^-100 has left only the highest speed in e.
LOW, HIGH = 1e-5, 100.0
#: The lowest speed that is distinguished from standstill, as a share of the highest.
SLOWEST = 1e-6
#: Scan points over log V_S; the spacing is 0.33 for speeds that span a factor 100. The curve e(log V_S) is 1 wide.
SCAN = 64
#: Local minima that are refined, points of a refinement round, and rounds: each narrows the bracket four times, to
#: 0.02 in log V_S. The best goes on alone for as many rounds, its points crowded about the vertex of a parabola: the
#: profile's slope is continuous (the envelope theorem), but its curvature jumps where a column drops out.
MINIMA, POINTS, ROUNDS = 3, 9, 2
#: Two columns whose squared sine is below this are one column; the third is in the span of two below its square root.
PARALLEL = 1e-12
#: The pairs of columns (1 - e, e, |v|^γ), and the rows of each set of one or two columns; 3 stands for none.
_PAIRS = list(itertools.combinations(range(3), 2))
_FIRST, _SECOND = np.array(_PAIRS).T.tolist()
_MEMBERS = np.array([(3, 3), *((column, 3) for column in range(3)), *_PAIRS])


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectionProblem:
    """P curves of up to n points, folded to v >= 0, scaled and padded.

    inverse_speed [P, n] and its least value fastest [P] (0 where all stand still), weight [P, n] = 1/sd (0: padding),
    viscous |v|^γ [P, n] and torque [P, n] times weight, low and high [P]: the limits of log V_S. basis [P, n, 2] and
    triangle [P, 3] (r11, r12, r22): the QR factors of weighted {1, |v|^γ}; remainder [P, n]: torque off that basis.
    """

    inverse_speed: FloatArray
    fastest: FloatArray
    weight: FloatArray
    viscous: FloatArray
    torque: FloatArray
    low: FloatArray
    high: FloatArray
    basis: FloatArray
    triangle: FloatArray
    remainder: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityProfile:
    """The non-negative least squares solution at each log V_S [P, K].

    coefficients [P, K, 3] of (1 - e, e/e_max, |v|^γ), residual [P, K]: the weighted sum of squares.
    """

    log_velocity: FloatArray
    coefficients: FloatArray
    residual: FloatArray


def make_problem(speed: FloatArray, torque: FloatArray, weight: FloatArray) -> ProjectionProblem:
    """The scaled and padded problem of P curves: speed [P, n] >= 0 as a share of the highest, torque [P, n], weight
    [P, n] (0: padding)."""
    moving = (weight > 0) & (speed > 0)
    fast = speed.max(axis=1, where=moving, initial=0.0)
    still = fast == 0
    fast = np.where(still, 1.0, fast)
    slow = np.clip(speed.min(axis=1, where=moving, initial=np.inf), SLOWEST, fast)
    floor = SLOWEST**2 / 100  # at a speed so low e is 0 for every V_S that is scanned, as it is at rest
    viscous, y = speed**GAMMA * weight, torque * weight
    basis, triangle = _orthonormal(weight, viscous)
    return ProjectionProblem(
        inverse_speed=1 / np.where(moving, np.maximum(speed, floor), floor),
        fastest=np.where(still, 0.0, 1 / fast),
        weight=weight,
        viscous=viscous,
        torque=y,
        low=np.log(LOW * slow),
        high=np.log(HIGH * fast),
        basis=basis,
        triangle=triangle,
        remainder=y - (basis @ (y[:, None, :] @ basis).swapaxes(1, 2))[..., 0],
    )


def _orthonormal(first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """QR of two columns [P, n]: basis [P, n, 2] and (r11, r12, r22) [P, 3]; r22 is 0 where they are parallel."""
    r11 = np.sqrt((first**2).sum(axis=1, keepdims=True))
    q1 = first / r11
    r12 = (q1 * second).sum(axis=1, keepdims=True)
    off = second - r12 * q1
    square, limit = (off**2).sum(axis=1, keepdims=True), PARALLEL * (second**2).sum(axis=1, keepdims=True)
    r22 = np.where(square > limit, np.sqrt(square), 0.0)
    q2 = np.divide(off, r22, out=np.zeros_like(off), where=r22 > 0)
    return np.stack([q1, q2], axis=2), np.hstack([r11, r12, r22])


def _decay(problem: ProjectionProblem, log_velocity: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weighted z [P, K, n] at log V_S [P, K], V_S/v_max, and α, β, δ of 1 - e = α + β z and e/e_max = δ (1 + z)."""
    v_s = np.exp(log_velocity)
    peak = v_s * problem.fastest[:, None]
    large = peak >= 1.0
    shift = np.where(large, peak, 0.0)
    z = v_s[..., None] * -problem.inverse_speed[:, None, :]
    z += shift[..., None]
    np.expm1(z, out=z)
    z *= problem.weight[:, None, :]
    share = np.exp(-shift)
    return z, peak, np.stack([np.where(large, 1 - share, 0.0), -share, np.exp(np.where(large, 0.0, peak))], axis=2)


def profile(problem: ProjectionProblem, log_velocity: FloatArray) -> VelocityProfile:
    """Non-negative least squares in a, b, c at log V_S [P, K], by comparison of all eight sets of columns."""
    z, peak, linear = _decay(problem, log_velocity)
    coefficients, residual, valid = _three_columns(problem, z, peak)
    negative = ~valid
    if negative.any():
        curve = np.nonzero(negative)[0]
        fewer = _fewer_columns(problem, curve, z[negative], linear[negative])
        coefficients[negative], residual[negative] = fewer
    return VelocityProfile(log_velocity=log_velocity, coefficients=coefficients, residual=residual)


def _fewer_columns(
    problem: ProjectionProblem, curve: NDArray[np.intp], z: FloatArray, linear: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Coefficients [M, 3] and sum of squared residuals [M] of the best fit with two columns, one or none, for M cases z
    [M, n] of curves [M]."""
    weight, torque = problem.weight[curve], problem.torque[curve]
    alpha, beta, delta = linear.T[..., None]
    x = np.empty((3, *z.shape))
    np.multiply(beta, z, out=x[0])
    x[0] += alpha * weight
    np.add(weight, z, out=x[1])
    x[1] *= delta
    x[2] = problem.viscous[curve]
    square = np.einsum("imn,imn->im", x, x)
    size = np.sqrt(np.where(square > 0, square, 1.0))
    cosine = np.stack([np.einsum("mn,mn->m", x[i], x[j]) for i, j in zip(_FIRST, _SECOND, strict=True)])
    unit = _best_set(np.einsum("imn,mn->im", x, torque) / size, cosine / (size[_FIRST] * size[_SECOND]))
    coefficients = unit / size
    miss = torque - np.einsum("im,imn->mn", coefficients, x)
    return coefficients.T, np.einsum("mn,mn->m", miss, miss)


def _best_set(y: FloatArray, cosine: FloatArray) -> FloatArray:
    """Coefficients [3, M] of unit columns, by their products with torque y [3, M] and by pairs, cosine [3, M]."""
    alone = np.maximum(y, 0.0)
    determinant = 1 - cosine**2
    usable = determinant > PARALLEL
    determinant = np.where(usable, determinant, 1.0)
    first = (y[_FIRST] - cosine * y[_SECOND]) / determinant
    second = (y[_SECOND] - cosine * y[_FIRST]) / determinant
    usable &= (first >= 0) & (second >= 0)
    both = np.where(usable, first * y[_FIRST] + second * y[_SECOND], 0.0)
    none = np.zeros((1, *y.shape[1:]))
    best = np.concatenate([none, alone**2, both]).argmax(axis=0)
    values = np.concatenate([none, alone, first]), np.concatenate([none, none, none, none, second])
    unit, case = np.zeros((4, *y.shape[1:])), np.arange(y.shape[1])
    for place in (0, 1):
        unit[_MEMBERS[best, place], case] = values[place][best, case]
    return unit[:3]


def _three_columns(
    problem: ProjectionProblem, z: FloatArray, peak: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Coefficients [P, K, 3] of the least-squares fit with all three columns, its sum of squared residuals [P, K], and a
    mask [P, K] of the fits whose columns are independent and whose coefficients are not negative.

    The squares are those of the residual itself, for differences of large sums would lose its digits."""
    along = z @ problem.basis
    r11, r12, r22 = problem.triangle.T[:, :, None]
    off = along @ problem.basis.swapaxes(1, 2)
    np.subtract(z, off, out=off)
    square = np.einsum("pkn,pkn->pk", off, off)
    usable = (square > PARALLEL * ((along**2).sum(axis=2) + square)) & (r22 > 0)
    beta = (off @ problem.remainder[..., None])[..., 0] / np.where(usable, square, 1.0)
    left = problem.torque[:, None, :] @ problem.basis - beta[..., None] * along
    c = left[..., 1] / np.where(r22 > 0, r22, 1.0)
    constant = (left[..., 0] - c * r12) / r11
    off *= -beta[..., None]
    off += problem.remainder[:, None, :]
    a = constant - beta
    b = np.where(peak >= 1.0, beta + a * np.exp(-peak), constant * np.exp(-np.minimum(peak, 1.0)))
    valid = usable & (a >= 0) & (b >= 0) & (c >= 0)
    return np.stack([a, b, c], axis=2), np.einsum("pkn,pkn->pk", off, off), valid


def minimise(problem: ProjectionProblem) -> tuple[VelocityProfile, VelocityProfile]:
    """The global optimum [P, 1] and the scan [P, SCAN] over log V_S that found it.

    The lowest local minima of the scan are refined, and the best of them ends on a parabola's vertex.
    """
    width = problem.high - problem.low
    scan = profile(problem, problem.low[:, None] + width[:, None] * np.linspace(0.0, 1.0, SCAN))
    edge = np.full((len(width), 1), np.inf)
    f = np.hstack([edge, scan.residual, edge])
    depth = np.where((f[:, 1:-1] <= f[:, :-2]) & (f[:, 1:-1] <= f[:, 2:]), scan.residual, np.inf)
    lowest = np.argpartition(depth, MINIMA, axis=1)[:, :MINIMA]
    centre = np.take_along_axis(scan.log_velocity, lowest, axis=1)
    half = width / (SCAN - 1)
    for _ in range(ROUNDS):
        points, f = _bracket(problem, centre, half, np.linspace(-1.0, 1.0, POINTS))
        centre = np.take_along_axis(points, f.argmin(axis=2)[..., None], axis=2)[..., 0]
        half = half * (2 / (POINTS - 1))
    winner = f.min(axis=2).argmin(axis=1)[:, None, None]
    points, f = (np.take_along_axis(array, winner, axis=1)[:, 0] for array in (points, f))
    for _ in range(ROUNDS):
        _, vertex, half = _narrow(points, f)
        points, f = (
            array[:, 0] for array in _bracket(problem, vertex, half[:, 0], np.linspace(-1.0, 1.0, POINTS) ** 3)
        )
    bottom, vertex, _ = _narrow(points, f)
    candidates = profile(problem, np.hstack([bottom, vertex, _tie(problem, scan, f.min(axis=1))]))
    best = candidates.residual.argmin(axis=1)[:, None]
    tied = candidates.residual[:, 2:] <= candidates.residual.min(axis=1, keepdims=True) + _tolerance(problem)[:, None]
    best = np.where(tied, 2, best)
    optimum = VelocityProfile(
        log_velocity=np.take_along_axis(candidates.log_velocity, best, axis=1),
        coefficients=np.take_along_axis(candidates.coefficients, best[..., None], axis=1),
        residual=np.take_along_axis(candidates.residual, best, axis=1),
    )
    return optimum, scan


def _bracket(
    problem: ProjectionProblem, centre: FloatArray, half: FloatArray, offsets: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Values of log V_S at centre [P, M] + half [P] · offsets [N] and their residuals, each [P, M, N]."""
    points = centre[..., None] + half[:, None, None] * offsets
    points = np.clip(points, problem.low[:, None, None], problem.high[:, None, None])
    return points, profile(problem, points.reshape(len(half), -1)).residual.reshape(points.shape)


def _tolerance(problem: ProjectionProblem) -> FloatArray:
    """Tolerance [P] within which residuals count as equal: V_S does not matter there."""
    return np.asarray(1e-13 * (problem.torque**2).sum(axis=1))


def _tie(problem: ProjectionProblem, scan: VelocityProfile, lowest: FloatArray) -> FloatArray:
    """The scanned log V_S [P, 1] nearest to the middle of the speeds, among those within the tolerance of the lowest
    residual [P].

    Where none ties (V_S matters), the middle itself.
    """
    middle = (problem.low - np.log(LOW) + problem.high - np.log(HIGH))[:, None] / 2
    distance = np.abs(scan.log_velocity - middle)
    tied = scan.residual <= (lowest + _tolerance(problem))[:, None]
    nearest = np.where(tied, distance, np.inf).argmin(axis=1)[:, None]
    return np.where(tied.any(axis=1, keepdims=True), np.take_along_axis(scan.log_velocity, nearest, axis=1), middle)


def _narrow(points: FloatArray, f: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The lowest of points [P, N], the vertex of the parabola through it and its neighbours, and how far they are."""
    row, last = np.arange(len(points))[:, None], points.shape[1] - 1
    low = f.argmin(axis=1)[:, None]
    middle = np.clip(low, 1, last - 1)
    (t0, f0), (t1, f1), (t2, f2) = ((points[row, middle + k], f[row, middle + k]) for k in (-1, 0, 1))
    falling, rising = (f1 - f0) * (t2 - t1), (f2 - f1) * (t1 - t0)
    curvature = (rising - falling) * 2
    step = np.divide(falling * (t2 - t0), curvature, out=np.zeros_like(f0), where=curvature > 0)
    left, right = (points[row, np.clip(low + k, 0, last)] for k in (-1, 1))
    lowest = points[row, low]
    vertex = np.clip(np.where(curvature > 0, (t0 + t1) / 2 - step, lowest), left, right)
    return lowest, vertex, np.maximum(right - vertex, vertex - left)


def jacobian(problem: ProjectionProblem, optimum: VelocityProfile) -> FloatArray:
    """Weighted derivatives [P, n, 4] of the torque to a, b e_max, c and log V_S at an optimum [P, 1].

    The last is taken at constant b e_max: b e_max (e/e_max) (V_S/v_max - V_S/v) + a e V_S/v.
    """
    z, peak, linear = _decay(problem, optimum.log_velocity)
    alpha, beta, delta = np.moveaxis(linear, 2, 0)[..., None]
    weight = problem.weight[:, None, :]
    rising, decay = alpha * weight + beta * z, delta * (weight + z)
    a, b = optimum.coefficients[..., :1], optimum.coefficients[..., 1:2]
    x = np.exp(optimum.log_velocity)[..., None] * problem.inverse_speed[:, None, :]
    turning = (b * (peak[..., None] - x) + a * np.exp(-peak)[..., None] * x) * decay
    return np.stack([rising[:, 0], decay[:, 0], problem.viscous, turning[:, 0]], axis=2)
