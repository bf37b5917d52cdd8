"""How well a fit does, and on which axes what it leaves lives.

The scatter of gains is no misfit: each run's gain, and in the same way each curve's, is taken out of its residual at its
best linear prediction,

    r - M ĝ,     ĝ = σ_g² Mᵀ V⁻¹ r / (1 + σ_g² Mᵀ V⁻¹ M)

and rows weigh by their precision, so that a loop's bin of a hundred samples is not one of a plateau's readings.

The evidence of an axis is that of all its contrasts together, with normal coefficients of deviation τ,

    ½ sᵀ (I + τ⁻²)⁻¹ s - ½ ln det(1 + τ² I)

or that of one of them, whichever; both averaged over τ, so that an axis with many contrasts pays for them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.attribution.evidence import Hypothesis
from models.diagnosis.design.axes import CLOCK
from models.diagnosis.design.design import Design
from models.diagnosis.detection.alarm import Lead
from models.diagnosis.detection.raw_records.evidence import RawEvidence
from models.diagnosis.detection.view import View
from models.diagnosis.effects.uncatalogued.catalogue import UNCATALOGUED_BY_SLUG
from models.diagnosis.noise.covariance import Noise, by_curve, gains_of, whitened
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.report.report import Misfit, Where

#: Deviations τ of a contrast's coefficient that are averaged over, as shares of the torque.
SIZES = (0.001, 0.003, 0.01, 0.03)
#: What raw records call a line of one frequency at all speeds, and the axis on which it lives.
FIXED_LINE, FREQUENCY = "fixed_line", "frequency_hz"
_LARGEST_DEVIATE = 1e9


def misfit_of(design: Design, noise: Noise, fitted: Fit, where: Sequence[Where] = ()) -> Misfit:
    """The misfit of a fit: rmse and noise [Nm], the gains taken out."""
    left = without_likely_gains(design, noise, fitted) / noise.deviation
    actual = float((left**2).mean())
    unit = float(np.sqrt((noise.deviation**-2.0).mean()))
    return Misfit(
        rmse=float(np.sqrt(actual)) / unit,
        noise=1.0 / unit,
        unexplained_share=max(0.0, 1 - 1 / actual) if actual > 0 else 0.0,
        where=tuple(where),
    )


def without_likely_gains(design: Design, noise: Noise, fitted: Fit) -> FloatArray:
    """The residual [N] Nm less what the likeliest gains of runs and curves make of it."""
    gains = gains_of(design, fitted.torque, noise)
    white = whitened(fitted.residual[:, None], design, noise)
    along = by_curve(white, gains)[:, 0]
    freed = 1 / (1 + noise.curve_gain**2 * gains.squares)
    squares, told = gains.by_run(freed * gains.squares), gains.by_run(freed * along)
    of_run = (noise.run_gain**2 * told / (1 + noise.run_gain**2 * squares))[gains.run_of_curve]
    of_curve = noise.curve_gain**2 * freed * (along - gains.squares * of_run)
    return np.asarray(fitted.residual - fitted.torque * (of_run + of_curve)[gains.curve], dtype=np.float64)


def axes_of(
    view: View, leads: dict[str, Lead], raw: Sequence[RawEvidence] = (), stranger: Hypothesis | None = None
) -> tuple[Where, ...]:
    """Where structure lives, most evidence first; `raw` holds lines of one frequency, which are no effect's, `stranger` is
    what the catalogue does not hold (`effects.uncatalogued`)."""
    projected, axes = view.likely, np.array(view.contrasts.axes)
    info = projected.info[view.smooth, view.smooth]
    score = projected.score[view.smooth]
    deviates = np.abs(score) / np.sqrt(np.maximum(np.diag(info), 1e-300))
    ratios = 0.5 * np.minimum(deviates, _LARGEST_DEVIATE) ** 2
    found = {}
    for axis in dict.fromkeys(view.contrasts.axes):
        mine = np.flatnonzero(axes == axis)
        p_value = float(min(1.0, mine.size * np.exp(-float(ratios[mine].max()))))
        strength = _evidence(info[np.ix_(mine, mine)], score[mine])
        found[axis] = Where(axis=axis, strength=strength, p_value=p_value)
    line = leads.get("lines")
    if line is not None and line.raised:
        slow = found.get(CLOCK, Where(axis=CLOCK, strength=0.0, p_value=1.0))
        strength = max(-float(np.log(max(line.p_value, 1e-300))), slow.strength)
        found[CLOCK] = Where(axis=CLOCK, strength=strength, p_value=min(line.p_value, slow.p_value))
    if stranger is not None:
        axis = UNCATALOGUED_BY_SLUG[stranger.slugs[0]].axis
        known, p_value = found.get(axis), float(np.exp(-np.clip(stranger.evidence, 0.0, 700.0)))
        if known is None or stranger.evidence > known.strength:
            p_value = p_value if known is None else min(p_value, known.p_value)
            found[axis] = Where(axis=axis, strength=stranger.evidence, p_value=p_value)
    for each in raw:
        if each.effect == FIXED_LINE:
            p_value = float(np.exp(-np.clip(each.log_evidence, 0.0, 700.0)))
            found[FREQUENCY] = Where(axis=FREQUENCY, strength=each.log_evidence, p_value=p_value)
    ranked = sorted(found.values(), key=lambda each: -each.strength)
    return tuple(replace(each, strength=max(each.strength, 0.0)) for each in ranked)


def _evidence(info: FloatArray, score: FloatArray) -> float:
    """The mean of the two formulas above [nats]."""
    values, vectors = np.linalg.eigh(info)
    values, along = np.maximum(values, 0.0), vectors.T @ score
    alone = np.maximum(np.diag(info), 0.0)
    logs = []
    for size in SIZES:
        for each, weight in ((values, along), (alone, score)):
            terms = 0.5 * (size**2 * weight**2 / (1 + size**2 * each) - np.log1p(size**2 * each))
            logs.append(float(terms.sum() if each is values else logsumexp(terms) - np.log(terms.size)))
    return float(np.clip(logsumexp(logs) - np.log(len(logs)), -_LARGEST_DEVIATE, _LARGEST_DEVIATE))
