"""On which axes the structure lives that a fit leaves.

The evidence of an axis is that of all its contrasts together, with normal coefficients of deviation τ,

    ½ sᵀ (I + τ⁻²)⁻¹ s - ½ ln det(1 + τ² I)

averaged with that of its contrasts one by one; both are averaged over τ, so that an axis with many contrasts pays for them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.criteria import CONTRAST_SIZES
from models.diagnosis.design.axes import CLOCK, FREQUENCY
from models.diagnosis.detection.likelihood_ratio import AlarmStatistic
from models.diagnosis.detection.projected_fit import ProjectedFit
from models.diagnosis.detection.raw_records.evidence import FIXED_LINE, RawEvidence

_LARGEST_DEVIATE = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """An axis on which structure lives (`design.axes`), the evidence of it [nats], and its p-value."""

    axis: str
    strength: float
    p_value: float

    @classmethod
    def of_evidence(cls, axis: str, evidence: float) -> "Where":
        """With the p-value that a likelihood ratio of so many nats bounds, e^-evidence."""
        return cls(axis=axis, strength=evidence, p_value=float(np.exp(-np.clip(evidence, 0.0, 700.0))))


def axes_of(
    projected: ProjectedFit,
    line: AlarmStatistic | None = None,
    raw: Sequence[RawEvidence] = (),
    fault: Where | None = None,
) -> tuple[Where, ...]:
    """Where structure lives, most evidence first. `line` is that over the tests' clock, `raw` holds lines of one frequency,
    which are no effect's, `fault` is an uncatalogued rig fault that was refitted."""
    axes = _contrast_axes(projected)
    if line is not None and line.raised:
        slow = axes.get(CLOCK, Where(axis=CLOCK, strength=0.0, p_value=1.0))
        strength = max(-float(np.log(max(line.p_value, 1e-300))), slow.strength)
        axes[CLOCK] = Where(axis=CLOCK, strength=strength, p_value=min(line.p_value, slow.p_value))
    if fault is not None:
        smooth = axes.get(fault.axis)
        if smooth is None:
            axes[fault.axis] = fault
        elif fault.strength > smooth.strength:
            axes[fault.axis] = replace(fault, p_value=min(fault.p_value, smooth.p_value))
    for evidence in raw:
        if evidence.effect == FIXED_LINE:
            axes[FREQUENCY] = Where.of_evidence(FREQUENCY, evidence.log_evidence)
    ranked = sorted(axes.values(), key=lambda where: -where.strength)
    return tuple(replace(where, strength=max(where.strength, 0.0)) for where in ranked)


def _contrast_axes(projected: ProjectedFit) -> dict[str, Where]:
    """By axis, the evidence of its smooth contrasts."""
    likely, axes = projected.likely, np.array(projected.contrasts.axes)
    info = likely.info[projected.smooth, projected.smooth]
    score = likely.score[projected.smooth]
    deviates = np.abs(score) / np.sqrt(np.maximum(np.diag(info), 1e-300))
    ratios = 0.5 * np.minimum(deviates, _LARGEST_DEVIATE) ** 2
    by_axis = {}
    for axis in dict.fromkeys(projected.contrasts.axes):
        mine = np.flatnonzero(axes == axis)
        p_value = float(min(1.0, mine.size * np.exp(-float(ratios[mine].max()))))
        by_axis[axis] = Where(axis=axis, strength=_evidence(info[np.ix_(mine, mine)], score[mine]), p_value=p_value)
    return by_axis


def _evidence(info: FloatArray, score: FloatArray) -> float:
    """The mean of the two formulas above [nats]."""
    values, vectors = np.linalg.eigh(info)
    together = np.maximum(values, 0.0), vectors.T @ score
    alone = np.maximum(np.diag(info), 0.0), score
    logs = []
    for size in CONTRAST_SIZES:
        terms = _terms(size, *together)
        logs.append(float(terms.sum()))
        terms = _terms(size, *alone)
        logs.append(float(logsumexp(terms) - np.log(terms.size)))
    return float(np.clip(logsumexp(logs) - np.log(len(logs)), -_LARGEST_DEVIATE, _LARGEST_DEVIATE))


def _terms(size: float, info: FloatArray, score: FloatArray) -> FloatArray:
    """[m] nats: a normal coefficient of that deviation for each independent direction."""
    return np.asarray(0.5 * (size**2 * score**2 / (1 + size**2 * info) - np.log1p(size**2 * info)), dtype=np.float64)
