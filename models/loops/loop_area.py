"""The area of a loop of torque over speed, and its direction.

    A_lag = ∮ M dv                                                                                        (eq. 8)

taken in the direction of time over whole periods, a period's mean: positive where torque is higher while the speed rises
than while it falls (the reference's observation), negative the other way about. With θ the phase of the swing and
v, M = Σ_h a_h cos hθ + b_h sin hθ the integral is exact in the coefficients,

    A_lag = π Σ_h h (a_h^M b_h^v - b_h^M a_h^v)

and only harmonics that both have count. They are found by least squares over the samples of the whole periods, wherever
in time those lie, so neither the rate nor lost samples enter; where the speed comes near zero the torque's cusp
|v|^0.3, which has no area, is fitted beside them. A drift of torque within a single period counts as area.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, sections 2.3.4 and 3.2, eq. 8.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.friction.criteria import Z90
from models.friction.stribeck import GAMMA
from models.loops.criteria import FEWEST_SAMPLES, NEAR_ZERO, NOT_WHITE
from models.records.outliers import inliers
from models.records.periods import Cycle, harmonics


class Direction(StrEnum):
    """HIGHER_ACCELERATING: area above its noise (95 %, one-sided); HIGHER_DECELERATING: below minus that; else NONE."""

    HIGHER_ACCELERATING = "higher_accelerating"
    HIGHER_DECELERATING = "higher_decelerating"
    NONE = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Area:
    """The signed area of a loop by eq. 8 [Nm m/s], over a period, and its standard deviation."""

    area: float
    area_sd: float

    @property
    def direction(self) -> Direction:
        """Direction of the loop by the sign of its area, if that exceeds its noise."""
        if abs(self.area) <= Z90 * self.area_sd:
            return Direction.NONE
        return Direction.HIGHER_ACCELERATING if self.area > 0 else Direction.HIGHER_DECELERATING


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """The samples of the whole periods that are no outliers: phase [m] rad ascending, torque [m] Nm."""

    phase: FloatArray
    torque: FloatArray
    outliers: int


def clean_samples(cycle: Cycle, time: FloatArray, torque: FloatArray) -> Samples:
    """The samples of torque [n] Nm at time [n] s (ascending) within the whole periods, without outliers from the loop."""
    inside = (time >= cycle.start) & (time < cycle.stop)
    phase, measured = cycle.phase(time[inside]), torque[inside]
    keep = np.ones(phase.size, dtype=np.bool_)
    if phase.size >= FEWEST_SAMPLES:
        design = _design(cycle, phase, _harmonics_for(phase))
        for _ in range(4):
            before = keep
            keep = inliers(measured - design @ _solve(design, measured, keep)[1], measured)
            if (keep == before).all():
                break
    return Samples(phase=phase[keep], torque=measured[keep], outliers=int((~keep).sum()))


def area_of(cycle: Cycle, samples: Samples) -> Area:
    """Signed area of a loop by eq. 8, over the whole periods of a cycle of sliding velocity in m/s.

    The deviation is of the residual noise of torque and speed, and of the scatter from period to period where there are
    three or more and that is larger. Raises ValueError where there are fewer samples than FEWEST_SAMPLES.
    """
    phase, measured = samples.phase, samples.torque
    if phase.size < FEWEST_SAMPLES:
        raise ValueError(f"at least {FEWEST_SAMPLES} samples must lie in the whole periods, got {phase.size}")
    count = _harmonics_for(phase)
    design = _design(cycle, phase, count)
    inverse, solution = _solve(design, measured, np.ones(phase.size, dtype=np.bool_))
    along, by_speed = _area_gradients(cycle, solution, count)
    away = np.abs(cycle.value(phase)) > NEAR_ZERO * cycle.amplitude  # a cusp that harmonics miss is not noise
    noise = _noise(cycle, (measured - design @ solution)[away], design.shape[1])
    variance = noise**2 * float(along @ inverse @ along) + float(by_speed @ cycle.covariance @ by_speed)
    if cycle.periods >= 3:
        variance = max(variance, _between_periods(cycle, phase, measured, count))
    return Area(area=float(along @ solution), area_sd=math.sqrt(max(variance, 0.0)))


def _harmonics_for(phase: FloatArray) -> int:
    """Number of harmonics to fit, as many as a third of a period's samples and its widest gap allow."""
    turn = np.sort(np.mod(phase, 2 * math.pi))
    gap = max(float(np.diff(turn).max(initial=0.0)), float(turn[0] + 2 * math.pi - turn[-1]))
    return max(2, min(16, phase.size // 6, int(0.8 * math.pi / gap)))


def _design(cycle: Cycle, phase: FloatArray, count: int) -> FloatArray:
    """Design matrix: 1, `count` harmonics, the cusp where the speed comes near zero, a drift where periods repeat."""
    columns = [np.ones((phase.size, 1)), harmonics(phase, count)]
    turn = np.linspace(0.0, 2 * math.pi, 361)
    lowest = float(np.abs(cycle.value(turn)).min())
    if lowest < NEAR_ZERO * cycle.amplitude:
        speed = cycle.value(phase)
        columns.append((np.sign(speed) * (np.abs(speed) / cycle.amplitude) ** GAMMA)[:, np.newaxis])
    if cycle.periods >= 2:
        columns.append(phase[:, np.newaxis] / (2 * math.pi * cycle.periods))
    return np.concatenate(columns, axis=1)


def _solve(design: FloatArray, measured: FloatArray, keep: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Inverse normal matrix and coefficients over the kept rows, the latter refined once."""
    design_kept, target = design[keep], measured[keep]
    inverse = np.asarray(np.linalg.pinv(design_kept.T @ design_kept, rcond=1e-13, hermitian=True), dtype=np.float64)
    solution = inverse @ (design_kept.T @ target)
    return inverse, solution + inverse @ (design_kept.T @ (target - design_kept @ solution))


def _area_gradients(cycle: Cycle, solution: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Derivatives ∂A/∂(torque's coefficients), and ∂A/∂(the speed's cosines and sines) with the torque's course
    held."""
    used = min(count, cycle.cosine.size)
    weight = math.pi * np.arange(1, used + 1)
    along, by_speed = np.zeros(solution.size), np.zeros(2 * cycle.cosine.size)
    along[1 : used + 1] = weight * cycle.sine[:used]
    along[1 + count : 1 + count + used] = -weight * cycle.cosine[:used]
    size = cycle.cosine.size
    by_speed[:used] = -weight * solution[1 + count : 1 + count + used]
    by_speed[size : size + used] = weight * solution[1 : used + 1]
    return along, by_speed


def _noise(cycle: Cycle, residual: FloatArray, parameters: int) -> float:
    """Standard deviation of a sample, raised where block means scatter more than white noise would make them."""
    variance = float(residual @ residual) / max(residual.size - parameters, 1)
    blocks = min(64, residual.size // cycle.periods // 4) * cycle.periods
    freedom = blocks * (1 - parameters / max(residual.size, 1)) - parameters
    if freedom < 8:
        return math.sqrt(variance)
    edges = np.linspace(0, residual.size, blocks + 1).astype(np.int64)[:-1]
    size = np.diff(np.append(edges, residual.size))
    ratio = float((np.add.reduceat(residual, edges) ** 2 / size).sum()) / freedom / max(variance, 1e-300)
    factor = ratio if ratio > 1 + NOT_WHITE * math.sqrt(2 / freedom) else 1.0
    return math.sqrt(variance * factor)


def _between_periods(cycle: Cycle, phase: FloatArray, measured: FloatArray, count: int) -> float:
    """Variance of the mean of the periods' own areas; 0 where fewer than three periods hold enough samples."""
    number = np.floor((phase - cycle.phase(np.array([cycle.start]))[0]) / (2 * math.pi)).astype(np.int64)
    single = replace(cycle, periods=1)
    areas = []
    for period in range(cycle.periods):
        rows = number == period
        harmonics = min(count, _harmonics_for(phase[rows])) if rows.any() else 0
        if rows.sum() < 3 * (2 * harmonics + 2):
            continue
        design = _design(single, phase[rows], harmonics)
        _, solution = _solve(design, measured[rows], np.ones(int(rows.sum()), dtype=np.bool_))
        along, _ = _area_gradients(cycle, solution, harmonics)
        areas.append(float(along @ solution))
    return float(np.var(areas, ddof=1)) / len(areas) if len(areas) >= 3 else 0.0
