"""Which runs may be outlying: the few sets of runs that hold nearly all of the posterior's mass.

A run is outlying with a small probability, and then off by a normal as wide as a misread gain. Whether a set of runs is
outlying is decided by the evidence of the whole history, with φ, ε, s and all else summed out on a coarse grid. The search
starts from the empty set, best set first, and turns one run at a time (from sound to outlying or back), or all that a node
would turn: the gain of turning a run has a closed form at every node, by how far the run is off the others' prediction.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.tracking.criteria import MOST
from models.tracking.discrepancy import column_sds, columns
from models.tracking.history import History
from models.tracking.linear_model import log_outlying
from models.tracking.merged_tests import MergedHistory
from models.tracking.prior import TrackPrior

#: Nodes of each level of s at which turning a run is weighed up, and the power of their mass by which they are drawn.
NODES, TEMPER = 16, 0.25
#: The gain of turning tests that were merged: that they are sound, or outlying, was decided before.
_NEVER = -1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class Nodes:
    """A weighted sample of nodes that represents the posterior: b [n, t], the variance of scatter and blur [n, t], q
    [n], and the log share of the mass that each represents [n]."""

    b: FloatArray
    noise: FloatArray
    size: FloatArray
    log_weight: FloatArray


def _most_examined(history: History) -> int:
    """Largest number of sets examined: where runs beyond doubt are merged few are possible. Of 34 lives of 1,000 tests
    none had other quantiles with 24 or 5."""
    return 4 if isinstance(history, MergedHistory) else 24


def verdicts(prior: TrackPrior, history: History, outlying: FloatArray, nodes: Nodes) -> tuple[FloatArray, FloatArray]:
    """Gain [n, t] of log posterior at every node by turning a run's outlier flag, and the log probability of the data
    at the node [n]; for sets of outlying runs, one for all [t] or one a node [n, t], of 0 and 1.

    With the rows x = (1, b, Z)σ of the linear terms, H = X (XᵀRX + I)⁻¹ Xᵀ and h = rH: a run lies off the prediction of
    the others by e/(1 - h), e being its residual, with the variance d/(1 - h).
    """
    further = (prior.outlying_size * prior.size) ** 2
    d = history.variance + further * outlying + nodes.noise
    sd = column_sds(prior, nodes.size, history)
    needed = np.flatnonzero(sd.any(axis=0))
    sd, terms = sd[:, needed], columns(history)[:, needed]
    z = np.broadcast_to(terms, (nodes.b.shape[0], *terms.shape))
    x = np.concatenate(
        [np.full((*nodes.b.shape, 1), prior.initial_sd), prior.change_sd * nodes.b[..., None], z * sd[:, None, :]],
        axis=2,
    )
    y = history.value - prior.initial_mean - prior.change_mean * nodes.b
    count = history.count if isinstance(history, MergedHistory) else np.ones(history.value.size)
    weighted = x / (d / count)[..., None]
    precision = np.eye(x.shape[2]) + np.swapaxes(x, 1, 2) @ weighted
    inverse = np.linalg.inv(precision)
    leverage = np.minimum(((weighted @ inverse) * x).sum(axis=2), 1.0 - 1e-9)
    pull = np.swapaxes(weighted, 1, 2) @ y[..., None]
    solved = inverse @ pull
    off = (y - (x @ solved)[..., 0]) / (1.0 - leverage)
    variance = d / (1.0 - leverage)
    turned = variance + np.where(outlying > 0, -further, further)
    odds = math.log(prior.outlying_share) - math.log1p(-prior.outlying_share)
    gain = 0.5 * (np.log(variance / turned) + off**2 / variance - off**2 / turned)
    gain += np.where(outlying > 0, -odds, odds)
    squares, log_d = y**2 / d, np.log(2.0 * math.pi * d)
    if isinstance(history, MergedHistory):
        squares, log_d = history.count * squares + history.within / d, history.count * log_d
        gain[:, ~history.single] = _NEVER
    quadratic = squares.sum(axis=1) - (pull * solved).sum(axis=(1, 2))
    log_volume = np.linalg.slogdet(precision)[1] + log_d.sum(axis=1)
    return gain, -0.5 * (log_volume + quadratic)


def gains(prior: TrackPrior, history: History, outlying: FloatArray, nodes: Nodes) -> FloatArray:
    """Gain [t] of log posterior by turning each run's outlier flag in one set [t], summed over the nodes."""
    total = nodes.log_weight[:, None] + verdicts(prior, history, outlying, nodes)[0]
    top = total.max(axis=0)
    return np.asarray(top + np.log(np.exp(total - top).sum(axis=0)))


def at_once(prior: TrackPrior, history: History, outlying: FloatArray, nodes: Nodes) -> tuple[FloatArray, FloatArray]:
    """The set [n, t] at which each node arrives by repeatedly turning all flags of positive gain, from `outlying` [t];
    and a lower bound of that set's gain in log posterior, summed over nodes.

    Where several runs hide one another no single one of them is worth turning.
    """
    gain, start = verdicts(prior, history, outlying, nodes)
    sets, log_evidence = np.tile(outlying, (nodes.b.shape[0], 1)), start
    for _ in range(4):
        if not (gain > 0.0).any():
            break
        sets = np.where(gain > 0.0, 1.0 - sets, sets)
        gain, log_evidence = verdicts(prior, history, sets, nodes)
    change = log_outlying(prior, sets.T) - log_outlying(prior, outlying)
    return sets, nodes.log_weight + log_evidence - start + change


@dataclass(slots=True)
class OutlierSearch:
    """A best-first search over sets of outlying runs: the sets examined so far, as bytes of their flags [t], with their
    log probability."""

    prior: TrackPrior
    history: History
    log_probability: dict[bytes, float]
    expanded: set[bytes]

    @classmethod
    def begun(cls, prior: TrackPrior, history: History) -> "OutlierSearch":
        """A search that begins from the empty set."""
        none = np.zeros(history.value.size)
        return cls(prior=prior, history=history, log_probability={none.tobytes(): 0.0}, expanded=set())

    def next(self) -> FloatArray | None:
        """The most promising set not yet expanded, or None where nothing is left to gain."""
        best = max(self.log_probability.values())
        left = [key for key, value in self.log_probability.items() if key not in self.expanded and value > best - 1.5]
        enough = len(self.expanded) >= _most_examined(self.history)
        if not left or enough or self.prior.outlying_share == 0.0 or self.history.value.size < 2:
            return None
        return np.frombuffer(max(left, key=self.log_probability.__getitem__))

    def learn(self, outlying: FloatArray, log_evidence: float, nodes: Nodes, best: Nodes) -> None:
        """Records a set's own evidence, and estimates for its neighbours and for the sets at which the `best` nodes
        arrive."""
        total = log_evidence + float(log_outlying(self.prior, outlying))
        self.log_probability[outlying.tobytes()] = total
        self.expanded.add(outlying.tobytes())
        count = outlying.size
        turned = np.abs(np.eye(count) - outlying)
        sets, leap = at_once(self.prior, self.history, outlying, best)
        estimates = np.concatenate([gains(self.prior, self.history, outlying, nodes), leap])
        for neighbour, gain in zip(np.concatenate([turned, sets]), estimates, strict=True):
            if neighbour.tobytes() not in self.expanded:
                known = self.log_probability.get(neighbour.tobytes(), -math.inf)
                self.log_probability[neighbour.tobytes()] = max(total + float(gain), known)

    def kept(self) -> FloatArray:
        """The sets [c, t] that hold nearly all of the mass, most probable first."""
        best = max(self.log_probability.values())
        within = [key for key, value in self.log_probability.items() if value > best - 4.5]
        within.sort(key=self.log_probability.__getitem__, reverse=True)
        return np.stack([np.frombuffer(key) for key in within[:MOST]])
