"""A cloud of particles, the target that they stand for, and the bridge from one history's posterior to the next one's."""

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.tracking.courses import FORM_COURSE, SCALE_SIGN, basis, log_form_weight
from models.tracking.history import History
from models.tracking.linear_model import Points, evidence, last_outlying, log_outlying, pointwise
from models.tracking.prior import Prior

#: The log probability of measurements of a course that had ended before.
_NEVER = -1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class Cloud:
    """n particles: points [n, 3] of (log |φ|, log |ε|, log s), form [n] (`courses`), outlying [n, t] (0, 1), log_weight [n]
    and log_target [n] (log prior plus evidence)."""

    points: FloatArray
    form: FloatArray
    outlying: FloatArray
    log_weight: FloatArray
    log_target: FloatArray

    def taken(self, index: NDArray[np.intp]) -> "Cloud":
        """The particles at `index`, with equal weights."""
        cloud = Cloud(**{field.name: getattr(self, field.name)[index] for field in fields(self)})
        return replace(cloud, log_weight=np.zeros(index.size))

    @property
    def course(self) -> NDArray[np.intp]:
        """The course of every particle [n]."""
        return FORM_COURSE[self.form.astype(np.intp)]

    def placed(self) -> Points:
        """The particles as points of the closed form."""
        return Points(
            log_scale=self.points[:, 0],
            log_exponent=self.points[:, 1],
            log_scatter=self.points[:, 2],
            form=self.form.astype(np.intp),
            outlying=self.outlying.T,
        )


@dataclass(frozen=True, slots=True)
class Bridge:
    """From the posterior of one history to that of the next, which has one measurement more."""

    prior: Prior
    before: History
    after: History

    def entered(self, cloud: Cloud, rng: np.random.Generator) -> tuple[Cloud, FloatArray, FloatArray]:
        """The particles with a flag for the new run, drawn from its posterior given the rest of each; and their log targets
        before (with the prior of that flag) and after."""
        as_sound = replace(cloud, outlying=np.column_stack([cloud.outlying, np.zeros(cloud.form.size)]))
        points, table = as_sound.placed(), table_of(self.after, cloud)
        sums, terms = pointwise(self.after, self.prior, points, table)
        turned = last_outlying(self.after, self.prior, points, sums, terms, table[-1])
        others = _log_prior(self.prior, cloud) + _log_alive(self.after, cloud)
        flag_sound, flag_outlying = log_outlying(self.prior, np.array([[0.0, 1.0]]))
        sound = evidence(sums, self.prior) + others + flag_sound
        outlying = evidence(turned, self.prior) + others + flag_outlying
        total = np.logaddexp(sound, outlying)
        is_outlying = np.log(rng.random(total.size)) < outlying - total
        as_sound.outlying[:, -1] = is_outlying
        after = np.where(is_outlying, outlying, sound)
        before = cloud.log_target + np.where(is_outlying, flag_outlying, flag_sound)
        return replace(as_sound, log_weight=cloud.log_weight + total - cloud.log_target), before, after

    def log_before(self, cloud: Cloud, table: FloatArray) -> FloatArray:
        """The target before the new run, with the prior of its flag; `table` is that of the runs after."""
        without = replace(cloud, outlying=cloud.outlying[:, :-1])
        flag = log_outlying(self.prior, cloud.outlying[:, -1:].T)
        return log_target_of(self.before, self.prior, without, table[:-1]) + flag


def table_of(history: History, cloud: Cloud) -> FloatArray:
    """b of every run and particle, [t, n]."""
    return basis(history.progress[:, None], cloud.points[:, 0], cloud.points[:, 1], cloud.course)


def log_target_of(history: History, prior: Prior, cloud: Cloud, table: FloatArray) -> FloatArray:
    """Log posterior density of every particle, up to a constant."""
    return log_likelihood_of(history, prior, cloud, table) + _log_prior(prior, cloud)


def log_likelihood_of(history: History, prior: Prior, cloud: Cloud, table: FloatArray) -> FloatArray:
    """Log probability of the data given every particle."""
    return evidence(pointwise(history, prior, cloud.placed(), table)[0], prior) + _log_alive(history, cloud)


def _log_prior(prior: Prior, cloud: Cloud) -> FloatArray:
    flat = prior.log_density(*cloud.points.T) + log_form_weight(prior)[cloud.form.astype(np.intp)]
    return np.asarray(flat + log_outlying(prior, cloud.outlying.T))


def _log_alive(history: History, cloud: Cloud) -> FloatArray:
    """Of every particle whose course ended before the last measurement that it was never taken."""
    ended = (SCALE_SIGN[cloud.course] < 0.0) & (cloud.points[:, 0] <= math.log(history.span))
    return np.where(ended, _NEVER, 0.0)


def merged(old: Cloud, new: Cloud, accepted: NDArray[np.bool_]) -> Cloud:
    """The new particles where they were accepted, the old ones elsewhere."""
    columns = {}
    for field in fields(Cloud):
        kept, offered = getattr(old, field.name), getattr(new, field.name)
        columns[field.name] = np.where(accepted if kept.ndim == 1 else accepted[:, None], offered, kept)
    return Cloud(**columns)


def weights(log_weight: FloatArray) -> FloatArray:
    """Weights [n] that sum to one."""
    weight = np.exp(log_weight - log_weight.max())
    return np.asarray(weight / weight.sum())


def effective(log_weight: FloatArray) -> float:
    """Effective number of particles, (Σw)²/Σw²."""
    return float(1.0 / np.square(weights(log_weight)).sum())
