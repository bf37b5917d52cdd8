"""What a clutch does beside eq. 6: a smooth discrepancy δ(ζ), and steps of the level at events.

No clutch follows eq. 6 exactly, and its deviation is no scatter: it is smooth. δ starts at 0 with slope 0, and its
curvature is drawn again on each of a few stretches of progress (an integrated random walk). With T the progress measured
so far, its deviation at T is q · size: q = 0 is eq. 6 itself, and the data choose among a few others. Beyond T it
continues with the slope it has and further curvature on stretches that grow with ζ, so that its deviation grows as
(ζ/T)^1.5: a discrepancy observed today widens every forecast, the further ahead the more. At ten times T it levels off:
what is observed over a tenth of a course must not make every course pass every threshold in the end.

A course that has a discrepancy, or shows no wear yet, may also have a knee ahead: from ζ_k > T on it does not rise, and
falls faster by g times its mean pace of wear until then,

    ξ(ζ) = min(ξ(ζ), ξ(ζ_k)) - g w/ζ_k (ζ - ζ_k),   w = max(ξ0 - ξ(ζ_k), 0) + u ξ0,

where a small share u of the value when new counts as worn whatever is seen: what runs in or stays level will wear.
Before any sign of it, a knee may come at any time: P(none until ζ) = (T/ζ)^h; to eq. 6 alone, while it shows no wear, up to
twice T: that it has not worn says nothing of how soon it may. Before a second test there is none. A knee that is behind is
part of δ, whose slope goes on.

An event such as an oil change begins an epoch, whose level is off by a normal step from the one before. The step of a
sensor that was zeroed is one of the readings: the clutch is as it was.

Source: the integrated Wiener process as a prior of smooth functions is G. Wahba, J. R. Statist. Soc. B 40 (1978) 364;
a discrepancy beside a law of physics is M. C. Kennedy, A. O'Hagan, J. R. Statist. Soc. B 63 (2001) 425.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.tracking.criteria import KNEE_PACE, KNEE_REACH, LEVELLING, LOG_KNEE_PACE_SD, UNSEEN_WEAR
from models.tracking.history import LEAST_SPAN, History, later_epochs, span_of
from models.tracking.prior import TrackPrior

#: Stretches of constant curvature: equal ones up to T, then growing ones, up to LEVELLING times T; there δ levels off.
PAST, FUTURE = 6, 16
_EDGES = np.concatenate([np.arange(PAST) / PAST, np.geomspace(1.0, LEVELLING, FUTURE + 1)])
_LENGTHS = np.diff(_EDGES)
#: The deviation of the curvature on each stretch.
_GAIN = np.sqrt(3.0 / _LENGTHS)


def smooth(progress: FloatArray, span: float, stretches: int = PAST + FUTURE) -> FloatArray:
    """δ [..., stretches] at ζ [...] for curvature of one standard deviation on each stretch alone, of a course with
    q · size = 1.

    On a stretch of length h, in units of T, curvature has the deviation √(3/h): the deviation of δ at T is then 1.
    """
    u = np.minimum(np.asarray(progress)[..., None] / span, LEVELLING)
    low, length = _EDGES[:stretches], _LENGTHS[:stretches]
    within = np.clip(u - low, 0.0, length)
    return np.asarray((0.5 * within**2 + length * np.maximum(u - low - length, 0.0)) * _GAIN[:stretches])


#: The slope and the level of δ where each stretch begins, for curvature of one deviation on each stretch; [22, 2 · 22].
_BEGUN = np.concatenate(
    [np.triu(np.outer(_GAIN * _LENGTHS, np.ones(PAST + FUTURE)), 1), smooth(_EDGES[:-1], 1.0).T], axis=1
)


def value_and_slope(progress: float, span: float) -> FloatArray:
    """δ(ζ), row 0, and ζ δ'(ζ), row 1, at progress ζ up to T, for curvature of one standard deviation on each stretch of the
    past alone; [2, PAST]."""
    u = progress / span
    slope = u * _GAIN[:PAST] * np.clip(u - _EDGES[:PAST], 0.0, _LENGTHS[:PAST])
    return np.stack([smooth(np.asarray(progress), span, PAST), slope])


def columns(history: History) -> FloatArray:
    """Design matrix [t, PAST + e] of the further linear terms at every measurement: PAST columns of δ, then one for
    each step."""
    return _columns(history.progress.tobytes(), history.epoch.tobytes())


@lru_cache(maxsize=16)
def _columns(progress: bytes, epoch: bytes) -> FloatArray:
    """Design matrix of the further linear terms, cached by progress and epochs alone, because the filters ask for it
    again and again."""
    history = np.frombuffer(progress), np.frombuffer(epoch)
    shifted = history[1][:, None] >= np.array(later_epochs(history[1]))
    terms = np.concatenate([smooth(history[0], span_of(history[0]), PAST), shifted], axis=1)
    terms.setflags(write=False)
    return terms


def column_sds(prior: TrackPrior, size: FloatArray, history: History) -> FloatArray:
    """Prior standard deviations [n, PAST + e] of the further terms of a history for discrepancies of relative size q
    [n]."""
    steps = history.step_sizes(prior)
    sds = np.empty((size.size, PAST + steps.size))
    sds[:, :PAST] = (size * prior.size)[:, None]
    sds[:, PAST:] = steps * prior.size
    return sds


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseDiscrepancy:
    """Smooth discrepancies, steps and knees beside the courses of n draws, in the unit of the quantity.

    `span` is T; `size` [n] is q; `curvature` [n, PAST + FUTURE] multiplies `smooth`; the level steps by `height`
    [n, e] at progress `at` [e], and where `of_readings` [e] says so (None: nowhere) a sensor's alone. From the progress
    `knee` [n] on, inf where there is none, a course falls faster by `steepening` [n] times its mean pace of wear until then.
    """

    span: float
    size: FloatArray
    curvature: FloatArray
    at: FloatArray
    height: FloatArray
    knee: FloatArray
    steepening: FloatArray
    of_readings: NDArray[np.bool_] | None = None

    @property
    def of_clutch(self) -> "CourseDiscrepancy":
        """The discrepancies without the steps of zeroed sensors: the clutch's own deviation, not that of its
        readings."""
        if self.of_readings is None or not self.of_readings.any():
            return self
        return replace(self, height=np.where(self.of_readings, 0.0, self.height))

    def __call__(self, own: FloatArray, progress: FloatArray) -> FloatArray:
        """Discrepancy [k, n]: δ at each draw's own time [k, n] plus the steps up to ζ, [k, n] or [k, 1]."""
        smooth_part = self._smooth_part(own)
        if self.at.size == 0:
            return smooth_part
        begun = np.broadcast_to(progress[..., None] >= self.at, (*own.shape, self.at.size))
        return np.asarray(smooth_part + np.einsum("kne,ne->kn", begun, self.height))

    def measured(self, progress: FloatArray) -> FloatArray:
        """Discrepancy [k, n] of every draw at measured progress [k], up to T, where all draws' own time is ζ."""
        terms = np.concatenate([smooth(progress, self.span, PAST), progress[:, None] >= self.at], axis=1)
        return np.asarray(terms @ np.concatenate([self.curvature[:, :PAST], self.height], axis=1).T)

    def _smooth_part(self, own: FloatArray) -> FloatArray:
        """δ at each draw's own time [k, n]; where q = 0, which is most of the draws of a young clutch, it is 0."""
        present = self.size > 0.0
        if present.all():
            return _stretchwise(self.curvature, own / self.span)
        smooth_part = np.zeros(own.shape)
        smooth_part[:, present] = _stretchwise(self.curvature[present], own[:, present] / self.span)
        return smooth_part

    @property
    def present(self) -> NDArray[np.bool_]:
        """Whether each draw [n] has a discrepancy, a knee or a step."""
        return np.asarray((self.size > 0.0) | np.isfinite(self.knee) | self.height.any(axis=1))

    def taken(self, index: NDArray[np.intp]) -> "CourseDiscrepancy":
        """The discrepancies of the draws at `index`."""
        rows = {name: getattr(self, name)[index] for name in BY_DRAW}
        return replace(self, **rows)


#: What of a discrepancy has a row a draw.
BY_DRAW = ("size", "curvature", "height", "knee", "steepening")


def _stretchwise(curvature: FloatArray, time: FloatArray) -> FloatArray:
    """δ [k, n] at each draw's own time in units of T, from its level, slope and curvature at the beginning of the
    stretch."""
    u = np.minimum(time, LEVELLING)
    stretch = np.minimum(np.searchsorted(_EDGES, u, side="right") - 1, PAST + FUTURE - 1)
    begun, draws = curvature @ _BEGUN, np.arange(curvature.shape[0])
    slope = stretch + 2 * (PAST + FUTURE) * draws
    bend = stretch + (PAST + FUTURE) * draws
    x = u - _EDGES[stretch]
    bent = begun.take(slope) + 0.5 * x * (curvature * _GAIN).take(bend)
    return np.asarray(begun.take(slope + PAST + FUTURE) + x * bent)


def drawn_discrepancy(
    history: History,
    prior: TrackPrior,
    size: FloatArray,
    terms: FloatArray,
    worn: FloatArray,
    rng: np.random.Generator,
) -> CourseDiscrepancy:
    """Discrepancy δ of n draws, in the unit of the quantity: `terms` [n, PAST + e] has what the tests determined, the
    curvature of the past stretches and the steps; curvature ahead and knees are drawn from their priors. `worn` [n] is
    the share of ξ0 worn so far."""
    ahead = np.zeros((size.size, FUTURE))
    alive = size > 0.0
    ahead[alive] = rng.standard_normal((int(alive.sum()), FUTURE)) * (size[alive] * prior.size)[:, None]
    knee, steepening = np.full(size.size, np.inf), np.ones(size.size)
    if prior.knee_hazard > 0.0 and history.progress.max(initial=0.0) > LEAST_SPAN:
        times = rng.random(size.size) ** (-1.0 / prior.knee_hazard)
        begins = alive | ((worn < UNSEEN_WEAR) & (times < KNEE_REACH))
        knee[begins] = history.span * times[begins]
        steepening = KNEE_PACE * np.exp(LOG_KNEE_PACE_SD * rng.standard_normal(size.size))
    return CourseDiscrepancy(
        span=history.span,
        size=size,
        curvature=np.concatenate([terms[:, :PAST], ahead], axis=1),
        at=history.steps,
        height=terms[:, PAST:],
        knee=knee,
        steepening=steepening,
        of_readings=history.reading_steps,
    )
