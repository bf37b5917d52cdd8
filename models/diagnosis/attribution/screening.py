"""Which effect, or which two: marginal likelihood after a linear screen, the best refitted with everything else.

    evidence = drop of the cost - ½ ln(1 + s² info) + ln prior of the shape,   summed over the shape grid

with s the prior deviation of the amplitude, a usual and a large one; the gains' scatter is summed over as well. Every
template is a little wrong, so evidence saturates (`attribution.decide`).
"""

from dataclasses import dataclass
from itertools import combinations, product
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, logsumexp

from models.arrays import FloatArray
from models.diagnosis.effects.amplitude_prior import SCALES
from models.diagnosis.effects.effect import Effect, Shape, Tried
from models.diagnosis.pooled_fit.projection import Projected

BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.intp]

#: Twice λ [nats] of an effect of usual size: what shows less cannot be judged.
LEAST_SEEN = 0.01
#: An effect is looked for from so many of its shapes, of which no two share more than this of what is visible of them.
STARTS, ALIKE = 4, 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One point of an effect's grid: what was tried, its log prior weight (normalised over the effect's grid), and that of
    all points that differ from it in smooth shapes only."""

    effect: Effect
    shape: Shape
    log_weight: float
    log_weight_around: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Screened:
    """One or two effects, judged linearly: evidence [nats] over none, the best shapes (and their places among the
    columns), the index of the gain scatter at which that is, and what the best shapes' prior and the rest of the grid add
    to the evidence of the best shapes [nats]. `others`: the same effect by shapes unlike the best ones, best first."""

    effects: tuple[Effect, ...]
    evidence: float
    shape_evidence: float
    shapes: tuple[Shape, ...]
    places: tuple[int, ...]
    gain: int
    others: tuple["Screened", ...] = ()


def linear_drop(columns: list[Column], projected: Projected, screened: Screened) -> tuple[FloatArray, float]:
    """Amplitudes and the drop of the cost [nats] of a screened candidate at one scatter of the gains."""
    places = list(screened.places)
    precision = np.diag([(SCALES[-1] * columns[place].effect.prior_sd) ** -2.0 for place in places])
    score = projected.score[places]
    amplitudes = np.linalg.solve(projected.info[np.ix_(places, places)] + precision, score)
    return np.asarray(amplitudes, dtype=np.float64), 0.5 * float(score @ amplitudes)


def columns_of(effects: list[Effect], grids: list[tuple[Tried, ...]]) -> list[Column]:
    """The flat list of all that is tried."""
    found = []
    for effect, grid in zip(effects, grids, strict=True):
        if grid:
            total = float(logsumexp([tried.log_weight for tried in grid]))
            kinds: dict[Shape, list[float]] = {}
            for tried in grid:
                kinds.setdefault(_stiff(effect, tried.shape), []).append(tried.log_weight - total)
            around = {kind: float(logsumexp(logs)) for kind, logs in kinds.items()}
            found += [
                Column(
                    effect=effect,
                    shape=tried.shape,
                    log_weight=tried.log_weight - total,
                    log_weight_around=around[_stiff(effect, tried.shape)],
                )
                for tried in grid
            ]
    return found


def _stiff(effect: Effect, shape: Shape) -> Shape:
    """The shapes that a refit does not move."""
    return tuple(value for value, parameter in zip(shape, effect.shapes, strict=True) if not parameter.smooth)


def screen(columns: list[Column], projections: list[Projected]) -> list[Screened]:
    """Every effect alone that the data could show, best first."""
    null = float(logsumexp([each.evidence for each in projections]))
    sd = np.array([column.effect.prior_sd for column in columns])
    positive = np.array([column.effect.positive for column in columns])
    weight = np.array([column.log_weight for column in columns])
    likely = max(projections, key=lambda each: each.evidence)
    table = []
    for each in projections:
        info, score = np.diag(each.info)[: sd.size], each.score[: sd.size]
        wide = np.outer(SCALES, sd)
        precision = np.maximum(info, 0.0) + wide**-2
        mean = score / precision
        gain = 0.5 * score * mean - 0.5 * np.log(precision * wide**2)
        gain = gain + np.where(positive, np.log(2.0) + log_ndtr(mean * np.sqrt(precision)), 0.0)
        table.append(each.evidence + logsumexp(gain, axis=0) - np.log(len(SCALES)) + weight)
    stacked = np.stack(table)
    found = []
    for effect in dict.fromkeys(column.effect.slug for column in columns):
        mine = np.array([i for i, column in enumerate(columns) if column.effect.slug == effect])
        if not (np.diag(likely.info)[mine] * sd[mine] ** 2 >= LEAST_SEEN).any():
            continue
        best, *others = _unlike(stacked, mine, likely)
        whole = float(logsumexp(stacked[:, mine]))
        around = [columns[place].log_weight_around for place in (best, *others)]
        of_best = whole - float(logsumexp(stacked[:, best])) + columns[best].log_weight
        found.append(
            Screened(
                effects=(columns[best].effect,),
                evidence=whole - null,
                shape_evidence=max(of_best, around[0]),
                shapes=(columns[best].shape,),
                places=(best,),
                gain=int(np.argmax(stacked[:, best])),
                others=tuple(
                    Screened(
                        effects=(columns[place].effect,),
                        evidence=float(logsumexp(stacked[:, place])) - columns[place].log_weight + weight_ - null,
                        shape_evidence=weight_,
                        shapes=(columns[place].shape,),
                        places=(place,),
                        gain=int(np.argmax(stacked[:, place])),
                    )
                    for place, weight_ in zip(others, around[1:], strict=True)
                ),
            )
        )
    return sorted(found, key=lambda each: -each.evidence)


def _unlike(table: FloatArray, mine: IntArray, projected: Projected) -> list[int]:
    """Of an effect's columns the best by evidence [gains, m], and the best ones that no better one resembles."""
    size = np.sqrt(np.maximum(np.diag(projected.info)[mine], 1e-300))
    alike = (projected.info[np.ix_(mine, mine)] / size[:, None] / size) ** 2
    chosen: list[int] = []
    for i in np.argsort(-table[:, mine].max(axis=0)).tolist():
        if len(chosen) < STARTS and all(alike[i, j] < ALIKE for j in chosen):
            chosen.append(i)
    return [int(mine[i]) for i in chosen]


def screen_pairs(columns: list[Column], projections: list[Projected]) -> list[Screened]:
    """Every two different effects, at the gain scatter that suits each pair best, best first."""
    null = float(logsumexp([each.evidence for each in projections]))
    slugs = [column.effect.slug for column in columns]
    members = {slug: np.array([i for i, s in enumerate(slugs) if s == slug]) for slug in dict.fromkeys(slugs)}
    sd = np.array([column.effect.prior_sd for column in columns])
    weight = np.array([column.log_weight for column in columns])
    positive = np.array([column.effect.positive for column in columns])
    order = np.argsort([-each.evidence for each in projections])[:1].tolist()
    likely = {int(k) for k in order} | {int(np.argmax([_best(each, sd) for each in projections]))}
    best: dict[tuple[str, str], Screened] = {}
    for k, width in product(sorted(likely), SCALES):
        each = projections[k]
        value = _values(each, width * sd, positive) + each.evidence - null - np.log(len(SCALES))
        value += weight[:, None] + weight
        for a, b in combinations(members, 2):
            block = value[np.ix_(members[a], members[b])]
            total = float(logsumexp(block)) if np.isfinite(block).any() else -np.inf
            if not np.isfinite(total) or ((a, b) in best and best[a, b].evidence >= total):
                continue
            i, j = np.unravel_index(int(np.argmax(block)), block.shape)
            p, q = int(members[a][i]), int(members[b][j])
            best[a, b] = Screened(
                effects=(columns[p].effect, columns[q].effect),
                evidence=total,
                shape_evidence=max(
                    total - float(value[p, q]) + columns[p].log_weight + columns[q].log_weight,
                    columns[p].log_weight_around + columns[q].log_weight_around,
                ),
                shapes=(columns[p].shape, columns[q].shape),
                places=(p, q),
                gain=k,
            )
    return sorted(best.values(), key=lambda each: -each.evidence)


def _values(projected: Projected, sd: FloatArray, positive: BoolArray) -> FloatArray:
    """Evidence [m, m] nats of every two columns with normal priors, -inf where a sign is wrong, a size unheard of, or one of
    them shows nothing."""
    scale = sd[:, None] * sd
    unit = projected.info[: sd.size, : sd.size] * scale
    u = projected.score[: sd.size] * sd
    one = np.diag(unit) + 1.0
    determinant = np.maximum(one[:, None] * one - unit**2, 1e-12)
    drop = 0.5 * (u[:, None] ** 2 * one + u**2 * one[:, None] - 2 * u[:, None] * u * unit) / determinant
    first = (u[:, None] * one - unit * u) / determinant
    wrong = (positive[:, None] & (first < 0)) | (positive & (first.T < 0)) | (np.abs(first) > 4) | (np.abs(first.T) > 4)
    hidden = np.diag(unit) < LEAST_SEEN
    wrong |= hidden[:, None] | hidden
    return np.where(wrong, -np.inf, drop - 0.5 * np.log(determinant))


def _best(projected: Projected, sd: FloatArray) -> float:
    info, score = np.diag(projected.info)[: sd.size], projected.score[: sd.size]
    return projected.evidence + float((0.5 * score**2 / (info + sd**-2)).max(initial=0.0))
