"""Periodogram over the tests' clock: a line is torque that oscillates while a test runs, with its own phase in every run.

    P(ω) = Σ_runs |Σ_i r_i m_i e^{-iωt_i}|² / Σ_i m_i²

with r the whitened residual of a run, its gain taken out, and m = 1/σ for an oscillation in Nm or M/σ for one in shares of
the torque, at the plateaus' own times: noise in proportion to torque would smear a line in a plain transform. Where there is
no line, P relative to its neighbourhood is a sum of exponential variables.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import gammaincc, gammaincinv

from models.arrays import FloatArray
from models.diagnosis.design.design import Design
from models.diagnosis.noise.covariance import Noise, whitened
from models.diagnosis.pooled_fit.problem import FitProblem

#: Steps of half a cycle a test: the first (two and a half cycles), slower ones that it must exceed, and the size of a
#: neighbourhood.
_FIRST, _SLOWER, _NEIGHBOURS = 5, 3, 61
#: Fewer plateaus in all, or in the longest run, show no line.
_FEWEST, _FEWEST_IN_A_RUN = 64, 32
#: Frequencies at most, and gaps between plateaus, in usual steps, beyond which a pause is shortened to that length.
_MOST, _LONGEST_GAP = 4000, 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class HighestLine:
    """The highest line: its power above the middle of its neighbourhood, its p-value among all that were looked at, and its
    place (frequency by frequency, in Nm and in shares of the torque)."""

    value: float = 0.0
    p_value: float = 1.0
    index: int = -1

    @property
    def evidence(self) -> float:
        """What the p-value is worth at most [nats], 1/(-e p ln p) (Sellke, Bayarri and Berger, Am. Stat. 55 (2001) 62)."""
        rare = -float(np.log(max(self.p_value, 1e-300)))
        return rare - 1.0 - float(np.log(rare)) if rare > 1.0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """Times [n] s from the run's start, pauses cut short; whitened residual [n] without the gain; weights m [n, 2]."""

    time: FloatArray
    left: FloatArray
    weights: FloatArray

    def power(self, first: int, last: int, spacing: float) -> FloatArray:
        """[last - first, 2] at angular frequencies `spacing` [rad/s] times first ... last - 1."""
        wave, step = np.exp(-1j * first * spacing * self.time), np.exp(-1j * spacing * self.time)
        sums, weighed = np.empty((last - first, 2), dtype=np.complex128), self.left[:, None] * self.weights
        for k in range(last - first):
            sums[k] = wave @ weighed
            wave *= step
        return np.asarray(np.abs(sums) ** 2 / np.maximum((self.weights**2).sum(axis=0), 1e-300), dtype=np.float64)


def lines(problem: FitProblem, residual: FloatArray) -> HighestLine:
    """The highest line, summed over the runs."""
    runs = _runs(problem.design, problem.noise, residual)
    longest = max((run.time.size for run in runs), default=0)
    if sum(run.time.size for run in runs) < _FEWEST or longest < _FEWEST_IN_A_RUN:
        return HighestLine()
    kept = [run for run in runs if run.time.size > 0.5 * longest]
    duration = float(np.median([run.time[-1] * run.time.size / (run.time.size - 1) for run in kept]))
    step = float(np.median([np.median(np.diff(run.time)) for run in kept]))
    last = min(int(duration / step), _MOST) if step > 0.0 else 0
    if last < _FEWEST_IN_A_RUN:
        return HighestLine()
    power = np.sum([run.power(_FIRST - _SLOWER, last, np.pi / duration) for run in kept], axis=0)
    # a line is above its neighbourhood: noise whose autocorrelation was misjudged is not
    middle = float(gammaincinv(len(kept), 0.5))
    for column in power.T:
        column /= np.maximum(median_filter(column, size=_NEIGHBOURS, mode="reflect") / middle, 1.0)
    # ... and above everything slower: structure that is larger the slower it is has no period
    slower = np.maximum.accumulate(power, axis=0)[_SLOWER - 1 : -1]
    power = np.where(power[_SLOWER:] >= slower, power[_SLOWER:], 0.0)
    index = int(np.argmax(power))
    highest = float(power.ravel()[index])
    tests = 1.5 * power.size
    return HighestLine(
        value=max(highest - middle, 0.0),
        p_value=min(1.0, tests * float(gammaincc(len(kept), highest))),
        index=index,
    )


def _runs(design: Design, noise: Noise, residual: FloatArray) -> list[_Run]:
    steady = slice(0, design.plateaus)
    white = whitened(np.column_stack([residual, design.torque]), design, noise)[steady]
    runs = []
    for run in np.unique(design.rows.run[steady]):
        mine = np.flatnonzero(design.rows.run[steady] == run)
        left, along = white[mine].T
        deviation = noise.deviation[mine]
        steps = np.maximum(np.diff(design.rows.clock[mine], prepend=design.rows.clock[mine[0]]), 0.0)
        usual = float(np.median(steps[1:])) if mine.size > 1 else 0.0
        runs.append(
            _Run(
                time=np.cumsum(np.minimum(steps, _LONGEST_GAP * usual)),
                left=left - along * float(along @ left) / max(float(along @ along), 1e-300),
                weights=np.stack([1 / deviation, np.abs(design.torque[mine]) / deviation], axis=1),
            )
        )
    return runs
