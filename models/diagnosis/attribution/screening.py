"""The linear screen: the evidence of every effect and of every two, without refitting anything.

    evidence = drop of the cost - ½ ln(1 + s² info) + ln prior of the shape,   summed over the shape grid

with s the prior deviation of the amplitude, a usual and a large one; the gains' scatter is summed over as well. The best are
refitted with everything else free (`attribution.refits`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, logsumexp

from models.arrays import FloatArray
from models.diagnosis.criteria import LEAST_INFORMATION, MOST_ALIKE, SHAPES_TRIED
from models.diagnosis.effects.amplitude_prior import SCALES
from models.diagnosis.effects.effect import Effect, Shape
from models.diagnosis.effects.grid import Column
from models.diagnosis.pooled_fit.projection import Projected

BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.intp]


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

    @property
    def slugs(self) -> tuple[str, ...]:
        """Public names."""
        return tuple(effect.slug for effect in self.effects)


def linear_drop(columns: Sequence[Column], projected: Projected, screened: Screened) -> tuple[FloatArray, float]:
    """Amplitudes and the drop of the cost [nats] of a screened candidate at one scatter of the gains."""
    places = list(screened.places)
    precision = np.diag([(SCALES[-1] * columns[place].effect.prior_sd) ** -2.0 for place in places])
    score = projected.score[places]
    amplitudes = np.linalg.solve(projected.info[np.ix_(places, places)] + precision, score)
    return np.asarray(amplitudes, dtype=np.float64), 0.5 * float(score @ amplitudes)


def screen(columns: Sequence[Column], projections: Sequence[Projected]) -> list[Screened]:
    """Every single effect that the data could show, best first."""
    null = float(logsumexp([projected.evidence for projected in projections]))
    sd = np.array([column.effect.prior_sd for column in columns])
    positive = np.array([column.effect.positive for column in columns], dtype=np.bool_)
    weight = np.array([column.log_weight for column in columns])
    likely = max(projections, key=lambda projected: projected.evidence)
    table = []
    for projected in projections:
        info, score = np.diag(projected.info)[: sd.size], projected.score[: sd.size]
        wide = np.outer(SCALES, sd)
        precision = np.maximum(info, 0.0) + wide**-2
        mean = score / precision
        gain = 0.5 * score * mean - 0.5 * np.log(precision * wide**2)
        gain = gain + np.where(positive, np.log(2.0) + log_ndtr(mean * np.sqrt(precision)), 0.0)
        table.append(projected.evidence + logsumexp(gain, axis=0) - np.log(len(SCALES)) + weight)
    stacked = np.stack(table)
    screened = []
    for slug in dict.fromkeys(column.effect.slug for column in columns):
        mine = np.array([i for i, column in enumerate(columns) if column.effect.slug == slug])
        if not (np.diag(likely.info)[mine] * sd[mine] ** 2 >= LEAST_INFORMATION).any():
            continue
        best, *others = _unlike(stacked, mine, likely)
        whole = float(logsumexp(stacked[:, mine]))
        around = [columns[place].log_weight_around for place in (best, *others)]
        of_best = whole - float(logsumexp(stacked[:, best])) + columns[best].log_weight
        screened.append(
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
    return sorted(screened, key=lambda candidate: -candidate.evidence)


def _unlike(table: FloatArray, mine: IntArray, projected: Projected) -> list[int]:
    """Of an effect's columns the best by evidence [gains, m], and the best that no better column resembles."""
    size = np.sqrt(np.maximum(np.diag(projected.info)[mine], 1e-300))
    alike = (projected.info[np.ix_(mine, mine)] / size[:, None] / size) ** 2
    chosen: list[int] = []
    for i in np.argsort(-table[:, mine].max(axis=0)).tolist():
        if len(chosen) < SHAPES_TRIED and all(alike[i, j] < MOST_ALIKE for j in chosen):
            chosen.append(i)
    return [int(mine[i]) for i in chosen]


def screen_pairs(columns: Sequence[Column], projections: Sequence[Projected]) -> list[Screened]:
    """Every two different effects, at the gain scatter that suits each pair best, best first."""
    null = float(logsumexp([projected.evidence for projected in projections]))
    slugs = [column.effect.slug for column in columns]
    members = {slug: np.array([i for i, s in enumerate(slugs) if s == slug]) for slug in dict.fromkeys(slugs)}
    sd = np.array([column.effect.prior_sd for column in columns])
    weight = np.array([column.log_weight for column in columns])
    positive = np.array([column.effect.positive for column in columns], dtype=np.bool_)
    order = np.argsort([-projected.evidence for projected in projections])[:1].tolist()
    likely = {int(k) for k in order} | {int(np.argmax([_best(projected, sd) for projected in projections]))}
    best: dict[tuple[str, str], Screened] = {}
    for k, width in product(sorted(likely), SCALES):
        projected = projections[k]
        value = _values(projected, width * sd, positive) + projected.evidence - null - np.log(len(SCALES))
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
    return sorted(best.values(), key=lambda pair: -pair.evidence)


def _values(projected: Projected, sd: FloatArray, positive: BoolArray) -> FloatArray:
    """Evidence [m, m] nats of every two columns with normal priors, -inf where a sign is wrong, an amplitude beyond four
    deviations, or one of them shows nothing."""
    scale = sd[:, None] * sd
    unit = projected.info[: sd.size, : sd.size] * scale
    u = projected.score[: sd.size] * sd
    single = np.diag(unit) + 1.0
    determinant = np.maximum(single[:, None] * single - unit**2, 1e-12)
    drop = 0.5 * (u[:, None] ** 2 * single + u**2 * single[:, None] - 2 * u[:, None] * u * unit) / determinant
    first = (u[:, None] * single - unit * u) / determinant
    wrong = (positive[:, None] & (first < 0)) | (positive & (first.T < 0)) | (np.abs(first) > 4) | (np.abs(first.T) > 4)
    hidden = np.diag(unit) < LEAST_INFORMATION
    wrong |= hidden[:, None] | hidden
    return np.where(wrong, -np.inf, drop - 0.5 * np.log(determinant))


def _best(projected: Projected, sd: FloatArray) -> float:
    info, score = np.diag(projected.info)[: sd.size], projected.score[: sd.size]
    return projected.evidence + float((0.5 * score**2 / (info + sd**-2)).max(initial=0.0))
