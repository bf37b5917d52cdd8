"""At which cycles runs are made: the probability of a set of cycles, whatever the order in which the runs arrived.

Runs are taken by ascending cycles, kind by kind. Each is made at the cycles of a run of another kind, or ends a block of
duty that begins where another run was made or is one of equal blocks, or comes a gap after the one before of its kind:

    p(g) = a Σ r_k [g = g_k] + R (b Σ r_k LN(g; g_k, σ) + c LN(g; ḡ, Σ) + d / (g log(1e8/1e1)))

with g_k the last few gaps, r_k how recent they are, ḡ their geometric mean, and LN the log normal density. No scale of
cycles is assumed: the last term gives every gap from 10 to 1e8 its share. Maintenance comes at the cycles of any other run,
or at any time of the life. R is how much more probable round numbers are (`roundness`).
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln

from models.arrays import FloatArray
from models.plausibility import criteria

#: Kinds in the order in which they are made at the same cycles; others come last.
ORDER = ("run_in", "duty_cycles", "maintenance", "stationary_stribeck", "dynamic_stribeck")
_FREE = ORDER.index("maintenance")
#: What numbers are rounded to: 1, 2, 2.5, 5 times the powers of ten up to the most cycles.
_GRAINS = np.outer(10.0 ** np.arange(round(math.log10(criteria.MAX_CYCLES))), (1.0, 2.0, 2.5, 5.0)).ravel()
_RECENCY = 0.7 ** np.arange(criteria.MEMORY)
#: The least probability of a run's cycles.
_LEAST = 1e-30


def rank_of(kind: str) -> int:
    """The position of a kind in `ORDER`; after the last for a kind that is not listed."""
    return ORDER.index(kind) if kind in ORDER else len(ORDER)


def roundness(cycles: FloatArray | float, scale: FloatArray | float) -> FloatArray:
    """Factor by which round cycles are more probable than under a law without round numbers, of the shape of cycles and
    `scale`; they are rounded by `scale` at most.

    People and rigs plan in round numbers: a share ROUND of all numbers are multiples of 1, 2, 2.5, 5, 10, 20 and so on, each
    grain G from a thousandth of `scale` on as probable as the others. R = 1 - ROUND + ROUND mean(G [G divides the cycles]).
    """
    distinct, place = np.unique(np.where(np.isfinite(cycles), cycles, 0.0), return_inverse=True)
    times = distinct[:, None] / _GRAINS
    up_to = np.concatenate(
        [np.zeros((distinct.size, 1)), np.cumsum(_GRAINS * (times == np.rint(times)), axis=1)], axis=1
    )
    grains = np.searchsorted(_GRAINS, scale, side="right")
    place, least = place.reshape(np.shape(cycles)), np.maximum(grains - 12, 0)
    mean = (up_to[place, grains] - up_to[place, least]) / np.maximum(grains - least, 1)
    return np.asarray(1.0 - criteria.ROUND + criteria.ROUND * mean)


def log_anywhere(cycles: FloatArray | float) -> FloatArray:
    """Log density of a number of cycles of which nothing is known, any shape: log-uniform except for round numbers, and
    falling beyond the usual life of clutches."""
    return np.asarray(_log_uninformed(cycles) + np.log(roundness(cycles, cycles)))


def _log_uninformed(cycles: FloatArray | float) -> FloatArray:
    """Log density of a number of cycles of which nothing is known, round numbers not preferred: log-uniform between 10
    and 1e8 cycles, times a normal of deviation 0.7 in the logarithm beyond MAX_CYCLES."""
    at = np.maximum(cycles, 1.0)
    beyond = np.maximum(np.log(at / criteria.MAX_CYCLES), 0.0) / 0.7
    return np.asarray(-np.log(at * math.log(1e8 / 1e1)) - 0.5 * beyond**2)


def log_probability(cycles: FloatArray, rank: NDArray[np.intp], block: FloatArray) -> FloatArray:
    """Log probability [h] of h sets of cycles [h, n] of runs of kind `rank` [n] with block lengths `block` [n] (nan: no
    block).

    Cycles are infinite where a run is not among a set.
    """
    is_known = np.isfinite(cycles)
    finite = np.where(is_known, cycles, -1.0)
    meets, left, in_life = _meets(cycles, finite, rank, block)
    total = np.zeros(cycles.shape[0])
    for kind in set(rank.tolist()):
        of_kind = np.flatnonzero(rank == kind)
        law = in_life[:, of_kind] if kind == _FREE else _by_gaps(cycles[:, of_kind])
        p = meets[:, of_kind] + left[of_kind] * law
        total += np.where(is_known[:, of_kind], np.log(np.maximum(p, _LEAST)), 0.0).sum(axis=1)
    return total


def log_given_others(cycles: FloatArray, rank: NDArray[np.intp], block: FloatArray) -> FloatArray:
    """Log probability [n] of each run's cycles [n] given those of the others; 0 for a run that is left out (infinite
    cycles)."""
    is_known = np.isfinite(cycles)
    finite = np.where(is_known, cycles, -1.0)
    meets, left, in_life = _meets(cycles[None], finite[None], rank, block)
    total = np.zeros(cycles.size)
    for kind in set(rank.tolist()):
        of_kind = np.flatnonzero(rank == kind)
        if kind == _FREE:
            total[of_kind] = np.log(in_life[0, of_kind])
            continue
        sets = np.tile(cycles[of_kind], (1 + of_kind.size, 1))
        sets[1:][np.diag_indices(of_kind.size)] = math.inf
        log_gaps = np.where(np.isfinite(sets), np.log(np.maximum(_by_gaps(sets), _LEAST)), 0.0).sum(axis=1)
        total[of_kind] = log_gaps[0] - log_gaps[1:]
    return np.where(is_known, np.log(meets[0] + left * np.exp(np.minimum(total, 0.0))), 0.0)


def _meets(
    cycles: FloatArray, finite: FloatArray, rank: NDArray[np.intp], block: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Probability [h, n] that a run is made at cycles given by other runs, the remaining share [n] for other cycles,
    and the density [h, n] of cycles anywhere in the life."""
    is_block = np.isfinite(block)
    length = np.where(is_block, block, 1.0)
    with np.errstate(invalid="ignore"):
        coincide = np.abs(cycles[:, :, None] - cycles[:, None, :]) < 0.5
    free = rank == _FREE
    joins = np.where(free[:, None], rank != _FREE, rank[:, None] > np.where(free, math.inf, rank))
    joined = (coincide & joins).any(axis=2)
    in_life = _anywhere_in_life(finite)
    meets = np.asarray(criteria.JOINS * joined, dtype=np.float64)
    meets[:, free] /= np.maximum((finite[:, ~free] >= 0.0).sum(axis=1), 1)[:, None]  # any one of them
    if is_block.any():
        begin = (finite - length)[:, is_block]
        tiled = ((np.abs(begin[:, :, None] - finite[:, None, :]) < 0.5) & np.isfinite(cycles)[:, None, :]).any(axis=2)
        equal = np.abs(begin - length[is_block] * np.round(begin / length[is_block])) < 0.5
        of_blocks = criteria.TILES * tiled + criteria.STARTS * (np.abs(begin) < 0.5)
        of_blocks += criteria.EQUALS * equal * np.minimum(length[is_block] * in_life[:, is_block], 1.0)
        meets[:, is_block] = of_blocks
    in_life[:, free] = np.minimum(in_life[:, free] * roundness(finite[:, free], finite[:, free]), 1.0)
    left = np.where(is_block, 1.0 - criteria.TILES - criteria.STARTS - criteria.EQUALS, 1.0 - criteria.JOINS)
    return meets, left, in_life


def _anywhere_in_life(finite: FloatArray) -> FloatArray:
    """Density [h, n] of cycles anywhere in a life: uniform up to the latest of the other runs, and to twice that, with
    a log-uniform rest."""
    ordered = np.sort(finite, axis=1)
    latest = np.where(finite >= ordered[:, -1:], ordered[:, -2:-1] if finite.shape[1] > 1 else 0.0, ordered[:, -1:])
    share = np.where(finite <= latest, criteria.WITHIN, np.where(finite <= 2.0 * latest, criteria.BEYOND, 0.0))
    remaining_share = np.where(latest >= 1.0, 1.0 - criteria.WITHIN - criteria.BEYOND, 1.0)
    return np.asarray(share / np.maximum(latest, 1.0) + remaining_share * np.exp(_log_uninformed(finite)))


def _by_gaps(cycles: FloatArray) -> FloatArray:
    """Probability p [h, k] of each run's gap to the run before of its kind, in the order of the runs."""
    order = np.argsort(cycles, axis=1)
    ascending = np.take_along_axis(cycles, order, axis=1)
    first = ascending[:, :1]
    with np.errstate(invalid="ignore"):
        gaps = np.diff(ascending, axis=1)
    gaps = np.where(np.isfinite(gaps), gaps, 0.0)
    round_by = roundness(ascending, np.concatenate([first, gaps], axis=1))
    of_first = (1.0 - criteria.AT_START) * np.exp(_log_uninformed(first)) * round_by[:, :1]
    law = np.concatenate([criteria.AT_START * (first < 0.5) + of_first, _of_gaps(gaps, round_by[:, 1:])], axis=1)
    back = np.empty(law.shape)
    np.put_along_axis(back, order, law, axis=1)
    return back


def _of_gaps(gaps: FloatArray, round_by: FloatArray) -> FloatArray:
    """Probability p [h, k] of gaps [h, k] given the gaps before each, times the roundness `round_by` [h, k] of the
    cycles at their ends: a mixture of the same gap as before, a similar one, one that goes on growing, one of the same
    order, and any."""
    before, weight = _gaps_before(gaps)
    present = before >= 0.5
    log_gap = np.log(np.maximum(gaps, 0.5))
    log_before = np.log(np.maximum(before, 0.5))
    same = (weight * (np.abs(before - gaps[:, :, None]) < 0.5)).sum(axis=2)
    like = (weight * _log_normal(log_gap[:, :, None], log_before, criteria.LIKE_GAP_SD)).sum(axis=2)
    growing = present[:, :, 0] & present[:, :, 1]
    grown = 2.0 * log_before[:, :, 0] - log_before[:, :, 1]
    further = _log_normal(log_gap, grown, criteria.LIKE_GAP_SD)
    like = np.where(growing, (1.0 - criteria.GROWING) * like + criteria.GROWING * further, like)
    similar = _log_normal(log_gap, (weight * log_before).sum(axis=2), 1.5)  # of their order
    anything = np.exp(_log_uninformed(gaps))
    remaining_share = 1.0 - criteria.SAME_GAP - criteria.LIKE_GAP - criteria.SIMILAR_GAP
    spread = criteria.LIKE_GAP * like + criteria.SIMILAR_GAP * similar + remaining_share * anything
    earlier = present.any(axis=2)
    law = criteria.SAME_GAP * same + np.minimum(round_by * np.where(earlier, spread, anything), 1.0 - criteria.SAME_GAP)
    return np.where(gaps < 0.5, 0.02, law)  # it repeats another of its kind


def _gaps_before(gaps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The MEMORY gaps before each gap [h, k, memory], the last one first and 0 where there is none, and their weights,
    which fall with their age and sum to one."""
    sets, count = gaps.shape
    padded = np.concatenate([np.zeros((sets, criteria.MEMORY)), gaps], axis=1)
    places = np.arange(count)[:, None] + criteria.MEMORY - 1 - np.arange(criteria.MEMORY)
    before = padded[:, places]
    weight = (before >= 0.5) * _RECENCY
    return before, weight / np.maximum(weight.sum(axis=2, keepdims=True), 1e-12)


def _log_normal(log_gap: FloatArray, centre: FloatArray, deviation: float) -> FloatArray:
    """Log-normal density [1/cycle] of a gap with centre and deviation of its logarithm."""
    z = (log_gap - centre) / deviation
    return np.asarray(np.exp(-0.5 * z * z - log_gap) / (deviation * math.sqrt(2 * math.pi)))


def log_order(start: FloatArray, moment: FloatArray) -> FloatArray:
    """Log probability [h] of the order of the dates [n] of runs that begin at cycles [h, n], infinite where a run is
    not in a set.

    How often a rig's runs are out of order is learned from them: a beta prior on it is integrated out.
    """
    if moment.size < 2:
        return np.zeros(start.shape[0])
    by_moment = np.argsort(moment, kind="stable")
    begun = start[:, by_moment]
    is_known = np.isfinite(begun)
    # a run is out of order where it lies below its predecessor: one misplaced run makes one or two such steps
    last = _last_seen(begun)
    wrong = (is_known[:, 1:] & (begun[:, 1:] < last[:, :-1] - 0.5)).sum(axis=1)
    count = is_known.sum(axis=1)
    a, b = (2e-3, 1.0)  # so many wrong among so many right: clocks are set wrongly at times
    return np.asarray(betaln(a + wrong, b + np.maximum(count - wrong, 0)) - betaln(a, b))


def _last_seen(values: FloatArray) -> FloatArray:
    """Each value [h, n], or the last finite one before it; -inf before the first."""
    is_known = np.isfinite(values)
    index = np.maximum.accumulate(np.where(is_known, np.arange(values.shape[1]), -1), axis=1)
    latest = np.take_along_axis(values, np.maximum(index, 0), axis=1)
    return np.where(index >= 0, latest, -np.inf)
