"""What a period of a loop differs by from those before it: noise, however slow, for all that is locked to the swing is the
same in every period. (What drifts over the clock differs too, by what it does within some periods.)

What harmonics leave of a single period says little of noise that is slow, for they take it for part of the loop; periods
that are held against each other say it all. With ȳ_b the mean of n_b samples in a bin of this period and m̄_b that of the
N_b samples in the periods before,

    d_b = (ȳ_b - m̄_b)/(1/n_b + 1/N_b)^{1/2}

has the variance of a sample and the correlation of neighbouring bins. Where a period fills a bin by less than two thirds of
what another does it is left out there: the record begins or ends, and the samples lie elsewhere in the bin.
"""

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray

#: A bin's filling in a period is this share of its fullest at least.
ALIKE = 2 / 3


def repeats_of(torque: FloatArray, bins: NDArray[np.intp], turns: FloatArray, count: int) -> FloatArray:
    """d [p - 1, count] Nm of torque [n] Nm in its bins [n] (0 ... count - 1) and whole turns since its start [n]; NaN where
    a bin was not met before, or not again. p is how many turns were begun."""
    turn = np.floor(turns).astype(np.intp)
    periods = int(turn.max(initial=0)) + 1
    place = turn * count + bins
    samples = np.bincount(place, minlength=periods * count).reshape(periods, count).astype(np.float64)
    sums = np.bincount(place, weights=torque, minlength=periods * count).reshape(periods, count)
    full = samples >= ALIKE * samples.max(axis=0)
    samples, sums = np.where(full, samples, 0.0), np.where(full, sums, 0.0)
    before, sum_before = np.cumsum(samples, axis=0)[:-1], np.cumsum(sums, axis=0)[:-1]
    here, sum_here = samples[1:], sums[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((sum_here / here - sum_before / before) / np.sqrt(1 / here + 1 / before), dtype=np.float64)
