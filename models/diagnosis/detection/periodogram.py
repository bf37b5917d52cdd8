"""Lines over the tests' clock: something swings while a test runs, with a phase of its own in every run.

    P(ω) = Σ_runs |Σ_i r_i m_i e^{-iωt_i}|² / Σ_i m_i²

with r the whitened residual of a run, its gain taken out, and m = 1/σ for a swing of so many Nm or M/σ for a share of the
torque, each at the plateaus' own times: noise in proportion to torque would smear a line out of a plain transform. P is a
sum of exponentials where there is no line, once it is measured against its neighbourhood.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import gamma

from models.arrays import FloatArray
from models.diagnosis.design.design import Design
from models.diagnosis.detection.alarm import Lead
from models.diagnosis.noise.covariance import Noise, whitened

#: False alarms allowed.
LINES_SHARE = 0.001
#: Steps are half a cycle a test: it starts at two and a half cycles, so many steps are looked at before, and a neighbourhood
#: is so many.
_FIRST, _SLOWER, _NEIGHBOURS = 5, 3, 61
#: Fewer plateaus in all, or in the longest run, show no line.
_FEWEST, _FEWEST_IN_A_RUN = 64, 32
#: Frequencies at most, and gaps between plateaus, in usual steps, beyond which a pause is taken for one of that length.
_MOST, _LONGEST_GAP = 4000, 5.0
_NOTHING = Lead(value=0.0, threshold=np.inf, p_value=1.0, index=-1)


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


def lines(design: Design, noise: Noise, residual: FloatArray) -> Lead:
    """The highest line, summed over the runs."""
    runs = _runs(design, noise, residual)
    longest = max((run.time.size for run in runs), default=0)
    if sum(run.time.size for run in runs) < _FEWEST or longest < _FEWEST_IN_A_RUN:
        return _NOTHING
    kept = [run for run in runs if run.time.size > 0.5 * longest]
    duration = float(np.median([run.time[-1] * run.time.size / (run.time.size - 1) for run in kept]))
    step = float(np.median([np.median(np.diff(run.time)) for run in kept]))
    last = min(int(duration / step), _MOST) if step > 0.0 else 0
    if last < _FEWEST_IN_A_RUN:
        return _NOTHING
    power = np.sum([run.power(_FIRST - _SLOWER, last, np.pi / duration) for run in kept], axis=0)
    # a line stands out of its neighbourhood: noise that remembers otherwise than was thought does not
    middle = float(gamma.ppf(0.5, len(kept)))
    for column in power.T:
        column /= np.maximum(median_filter(column, size=_NEIGHBOURS, mode="reflect") / middle, 1.0)
    # ... and above all that is slower: structure that grows the slower it is has no period
    slower = np.maximum.accumulate(power, axis=0)[_SLOWER - 1 : -1]
    power = np.where(power[_SLOWER:] >= slower, power[_SLOWER:], 0.0)
    index = int(np.argmax(power))
    highest = float(power.ravel()[index])
    tests = 1.5 * power.size
    return Lead(
        value=max(highest - middle, 0.0),
        threshold=float(gamma.isf(LINES_SHARE / tests, len(kept))) - middle,
        p_value=float(min(1.0, tests * np.exp(float(gamma.logsf(highest, len(kept)))))),
        index=index,
    )


def _runs(design: Design, noise: Noise, residual: FloatArray) -> list[_Run]:
    steady = slice(0, design.plateaus)
    white = whitened(np.column_stack([residual, design.torque]), design, noise)[steady]
    found = []
    for run in np.unique(design.rows.run[steady]):
        mine = np.flatnonzero(design.rows.run[steady] == run)
        left, along = white[mine].T
        deviation = noise.deviation[mine]
        steps = np.maximum(np.diff(design.rows.clock[mine], prepend=design.rows.clock[mine[0]]), 0.0)
        usual = float(np.median(steps[1:])) if mine.size > 1 else 0.0
        found.append(
            _Run(
                time=np.cumsum(np.minimum(steps, _LONGEST_GAP * usual)),
                left=left - along * float(along @ left) / max(float(along @ along), 1e-300),
                weights=np.stack([1 / deviation, np.abs(design.torque[mine]) / deviation], axis=1),
            )
        )
    return found
