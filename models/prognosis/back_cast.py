"""What earlier forecasts of a clutch said about the tests since, and how much wider its intervals are to be for it.

A forecast is kept after the third, fourth, sixth, eighth … test: the median and the 90 % interval of ξ ahead. A later test
is judged by the newest forecast that was made at 80 % of its progress or before. Its miss is how far it lies above the
median, negative below it, in half widths of the interval on that side, with the scatter from run to run and the variance of
its fit; three at most, since a run may be outlying.

Where forecasts fared badly a prognosis is wider: remaining life is raised, as a multiple of its median, to the power

    w = max(1, the ⌈0.95 (m + 1)⌉-th smallest of m misses),

the largest where m is below 19: the quantile of split conformal prediction, of one side. Tests below their forecast say that
the end may come earlier, and widen what lies before the median; tests above it what lies after: a clutch that is better than
predicted is no less safe. The misses of one life are no independent draws, so it promises nothing here;
docs/appendix/prognosis.md says what it achieves.

Source: H. Papadopoulos, K. Proedrou, V. Vovk, A. Gammerman, ECML (2002) 345-356, for the quantile.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import bdtr

from models.arrays import FloatArray
from models.friction.criteria import Z90
from models.prognosis.criteria import AHEAD, COVERAGE
from models.prognosis.first_passage import bands
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior


@dataclass(frozen=True, slots=True, kw_only=True)
class BackCast:
    """Kept forecasts of a clutch and their misses by later tests. `forecasts` [f, 2 + 3 a]: progress and epoch of each,
    then at each of AHEAD its lower end, median and upper end; `misses` [m] of the tests that were judged, negative
    where they lay below the median; `innovation` of the newest test by those before it [1], or [0] where there is none
    (`models.tracking.innovation`)."""

    forecasts: FloatArray
    misses: FloatArray
    innovation: FloatArray

    @classmethod
    def nothing(cls) -> "BackCast":
        """The empty value, before the first test."""
        return cls(forecasts=np.zeros((0, 2 + 3 * len(AHEAD))), misses=np.zeros(0), innovation=np.zeros(0))

    @property
    def held(self) -> int:
        """The number of tests within the 90 % intervals that were forecast for them."""
        return int(np.count_nonzero(np.abs(self.misses) <= 1.0))

    @property
    def surprising(self) -> bool:
        """Whether so few tests within their intervals are improbable (p < 0.05) if each is within with a probability of
        90 %."""
        return bool(bdtr(self.held, self.misses.size, COVERAGE) < 0.05)

    @property
    def widening(self) -> tuple[float, float]:
        """Powers w >= 1 that widen remaining life below its median, from tests below their forecasts, and above it,
        from tests above them."""
        return _power(-self.misses), _power(self.misses)

    def judged(self, test: Measurement) -> "BackCast":
        """This count with the miss of one more test added: how far the test lies from the forecast that was kept for it,
        in half widths of its interval. Unchanged if no forecast reaches the test or an event lies between."""
        progress, epoch = self.forecasts[:, 0], self.forecasts[:, 1]
        usable = (
            (progress > 0.0)
            & (progress <= 0.8 * test.progress)  # made at 80 % of the test's progress or before
            & (epoch == test.epoch)
            & (test.progress <= AHEAD[-1] * progress)
        )
        if not usable.any():
            return self
        row = self.forecasts[usable][-1]
        low, median, high = (
            float(np.interp(test.progress, row[0] * np.array(AHEAD), ends)) for ends in row[2:].reshape(-1, 3).T
        )
        half = math.hypot(median - low if test.value < median else high - median, Z90 * math.sqrt(test.variance))
        miss = (test.value - median) / half if half > 0.0 else 0.0
        return replace(self, misses=np.append(self.misses, max(-3.0, min(miss, 3.0))))  # it may be outlying

    def forecast(self, posterior: TrackPosterior, newest: Measurement, prior: TrackPrior) -> "BackCast":
        """The value with the forecast of a posterior added that knows all tests up to the newest."""
        _, ahead = bands(posterior, newest.progress * np.array(AHEAD))
        medians = ahead[:, 1]
        scatter = [math.sqrt(float(posterior.weight @ posterior.scatter_variance(x, prior))) for x in medians.tolist()]
        half = np.hypot(ahead - medians[:, None], Z90 * np.array(scatter)[:, None])
        ends = medians[:, None] + np.array([-1.0, 0.0, 1.0]) * half
        row = np.concatenate([[newest.progress, newest.epoch], ends.ravel()])
        return replace(self, forecasts=np.vstack([self.forecasts, row]))


def _power(misses: FloatArray) -> float:
    """Power w of the widening from misses [m] that are positive on its side."""
    if misses.size == 0:
        return 1.0
    rank = min(math.ceil(0.5 * (1.0 + COVERAGE) * (misses.size + 1)), misses.size)
    return max(1.0, float(np.sort(misses)[rank - 1]))


def kept_after(tests: int) -> bool:
    """Whether a forecast is kept after so many tests: 3, 4, 6, 8, 12, 17, 24, …, each √2 times the one before."""
    return tests >= 3 and tests == round(3.0 * 2.0 ** (round(2.0 * math.log2(tests / 3.0)) / 2.0))
