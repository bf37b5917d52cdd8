"""The amplitudes that a campaign would have shown, effect by effect.

An effect of amplitude a raises λ = ½ a² info nats where the gains' scatter σ is known. It is not: a larger one may take up
what the effect does, and costs evidence. So an amplitude counts as visible where no scatter can explain it,

    a = max over σ of √(2 (λ_90 - L* + L(σ))₊/info(σ)),     λ_90 = ½ (√(2 t) + 1.28)²

with L(σ) the evidence of a scatter, L* the largest, and t the alarm's threshold [nats]: the alarm is a maximum over normal
deviates, and that of an effect with λ_90 exceeds √(2 t) nine times in ten.
"""

import numpy as np
from scipy.special import ndtri

from models.arrays import FloatArray
from models.diagnosis.criteria import LEAST_VISIBLE_SHARE, VISIBLE_POWER
from models.diagnosis.detection.projected_fit import ProjectedFit
from models.diagnosis.report.report import Visible


def visible_of(projected: ProjectedFit, threshold: float) -> tuple[Visible, ...]:
    """What each effect's alarm, raised beyond `threshold` [nats], shows with a probability of VISIBLE_POWER: in whatever of
    its shapes, and in the one that shows best. Infinite where a shape would be absorbed at any amplitude; effects of which
    nothing shows are left out."""
    amplitudes = _amplitudes(projected, threshold)
    sizes: dict[str, list[float]] = {}
    effects = {column.effect.slug: column.effect for column in projected.columns}
    for column, amplitude in zip(projected.columns, amplitudes.tolist(), strict=True):
        sizes.setdefault(column.effect.slug, []).append(amplitude * column.effect.scale)
    return tuple(
        Visible(
            effect=slug,
            amplitude=max(by_shape),
            least=min(by_shape),
            usual=effects[slug].prior_sd * effects[slug].scale,
            unit=effects[slug].unit,
        )
        for slug, by_shape in sizes.items()
        if np.isfinite(min(by_shape))
    )


def _amplitudes(projected: ProjectedFit, threshold: float) -> FloatArray:
    """The formula above for each column [m], in SI units."""
    needed = 0.5 * (np.sqrt(2 * threshold) + float(ndtri(VISIBLE_POWER))) ** 2
    best = projected.likely.evidence
    largest = np.zeros(len(projected.columns))
    for projection in projected.projections:
        info = np.diag(projection.info)[projected.effects]
        shown = info > LEAST_VISIBLE_SHARE * projection.whole[projected.effects]
        left = max(needed - best + projection.evidence, 0.0)
        amplitude = np.sqrt(2 * left / np.where(shown, info, 1.0))
        largest = np.maximum(largest, np.where(shown, amplitude, np.inf if left > 0 else 0.0))
    return largest
