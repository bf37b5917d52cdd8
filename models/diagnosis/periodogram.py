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
from models.diagnosis.alarm import Lead
from models.diagnosis.design import Design
from models.diagnosis.whitening import Noise, whitened

#: False alarms allowed.
LINES_SHARE = 0.001
#: Steps are half a cycle a test: it starts at two cycles, and a neighbourhood is so many steps.
_FIRST, _NEIGHBOURS = 4, 61
#: Fewer plateaus in all, or in the longest run, show no line.
_FEWEST, _FEWEST_IN_A_RUN = 64, 32


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """Times [n] s from the run's first plateau, whitened residual [n] without the gain, and weights m [n, 2]."""

    time: FloatArray
    left: FloatArray
    weights: FloatArray

    def power(self, angular: FloatArray) -> FloatArray:
        """[f, 2] at angular frequencies [f] rad/s."""
        waves = np.exp(-1j * np.outer(angular, self.time))
        sums = waves @ (self.left[:, None] * self.weights)
        return np.asarray(np.abs(sums) ** 2 / np.maximum((self.weights**2).sum(axis=0), 1e-300), dtype=np.float64)


def lines(design: Design, noise: Noise, residual: FloatArray) -> Lead:
    """The highest line, summed over the runs."""
    runs = _runs(design, noise, residual)
    length = max((run.time.size for run in runs), default=0)
    duration = max((float(run.time[-1]) * (1 + 1 / run.time.size) for run in runs), default=0.0)
    if sum(run.time.size for run in runs) < _FEWEST or length < _FEWEST_IN_A_RUN or not duration > 0.0:
        return Lead(value=0.0, threshold=np.inf, p_value=1.0, index=-1)
    kept = [run for run in runs if run.time.size > 0.5 * length]
    angular = np.asarray(np.pi * np.arange(_FIRST, length) / duration, dtype=np.float64)
    power = np.sum([run.power(angular) for run in kept], axis=0)
    # a line stands out of its neighbourhood: noise that remembers otherwise than was thought does not
    middle = float(gamma.ppf(0.5, len(kept)))
    for column in power.T:
        column /= np.maximum(median_filter(column, size=_NEIGHBOURS, mode="nearest") / middle, 1.0)
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
        found.append(
            _Run(
                time=design.rows.clock[mine] - design.rows.clock[mine[0]],
                left=left - along * float(along @ left) / max(float(along @ along), 1e-300),
                weights=np.stack([1 / deviation, np.abs(design.torque[mine]) / deviation], axis=1),
            )
        )
    return found
