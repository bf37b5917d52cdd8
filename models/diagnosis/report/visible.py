"""The amplitudes that a campaign would have shown, effect by effect."""

import numpy as np

from models.diagnosis.criteria import DETECTED_NINE_IN_TEN
from models.diagnosis.detection.projected_fit import ProjectedFit
from models.diagnosis.report.report import Visible


def visible_of(projected: ProjectedFit) -> tuple[Visible, ...]:
    """The smallest amplitude of each effect that would have been detected, a = √(2 λ/info) with λ =
    DETECTED_NINE_IN_TEN, at the middle one of the shapes that show at all, and at the best of them."""
    info = np.diag(projected.likely.info)[projected.effects]
    sizes: dict[str, list[float]] = {}
    effects = {column.effect.slug: column.effect for column in projected.columns}
    for column, shown in zip(projected.columns, info, strict=True):
        size = float(np.sqrt(2 * DETECTED_NINE_IN_TEN / shown)) * column.effect.scale if shown > 0 else np.inf
        if np.isfinite(size):
            sizes.setdefault(column.effect.slug, []).append(size)
    return tuple(
        Visible(
            effect=slug,
            amplitude=float(np.quantile(by_shape, 0.5, method="higher")),
            least=min(by_shape),
            usual=effects[slug].prior_sd * effects[slug].scale,
            unit=effects[slug].unit,
        )
        for slug, by_shape in sizes.items()
    )
