"""Differences between the periods of a loop. What is locked to the speed cycle is the same in every period, so what differs
is noise, however slow. (A drift over the test's clock differs too, by what it does within some periods.)

The residual about the harmonics of a single period says little about slow noise, for the harmonics absorb it. With ȳ_b the
mean of n_b samples in a bin of this period and m̄_b that of the N_b samples of the bin in all periods before,

    d_b = (ȳ_b - m̄_b)/(1/n_b + 1/N_b)^{1/2}

has the variance of a single sample and the correlation of neighbouring bins.
"""

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.design.criteria import FULL_BIN


def period_differences(torque: FloatArray, bins: NDArray[np.intp], turns: FloatArray, count: int) -> FloatArray:
    """d [p - 1, count] Nm of torque [n] Nm in its bins [n] (0 ... count - 1) and turns since its start [n]; p is how many
    turns were begun. NaN where no earlier period holds samples in the bin, or this period too few (FULL_BIN)."""
    turn = np.floor(turns).astype(np.intp)
    periods = int(turn.max(initial=0)) + 1
    cell = turn * count + bins
    samples = np.bincount(cell, minlength=periods * count).reshape(periods, count).astype(np.float64)
    sums = np.bincount(cell, weights=torque, minlength=periods * count).reshape(periods, count)
    full = samples >= FULL_BIN * samples.max(axis=0)
    samples, sums = np.where(full, samples, 0.0), np.where(full, sums, 0.0)
    before, sum_before = np.cumsum(samples, axis=0)[:-1], np.cumsum(sums, axis=0)[:-1]
    here, sum_here = samples[1:], sums[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((sum_here / here - sum_before / before) / np.sqrt(1 / here + 1 / before), dtype=np.float64)
