"""The amplitudes that a campaign would have shown, effect by effect.

An effect of amplitude a raises λ = ½ a² info nats where the gains' scatter σ is known. It is not: a larger one may take up
what the effect does, and costs evidence. So an amplitude counts as visible where no scatter can explain it,

    a = max over σ of √(2 (λ_90 - L* + L(σ))₊/info(σ)),     λ_90 = ½ (√(2 t) + 1.28)²

with L(σ) the evidence of a scatter and L* the largest. The model is called wrong where the effect's posterior odds against
nothing are even: where the drop of the cost pays for the prior odds of the effect, for that of its shape and for the freedom
of its amplitude, of prior deviation s in the narrower or the wider of two (`amplitude_prior.SCALES`),

    t = -ln(prior odds) - ln p(shape) + ln 2 + min over s of ½ ln(1 + s² info).
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from models.arrays import FloatArray
from models.diagnosis.criteria import LEAST_VISIBLE_SHARE, VISIBLE_POWER
from models.diagnosis.effects.amplitude_prior import SCALES
from models.diagnosis.effects.catalogue import CATALOGUE
from models.diagnosis.explanations.alternative import Alternative
from models.diagnosis.explanations.posterior import Posterior
from models.diagnosis.raw_records.evidence import RawEvidence
from models.diagnosis.report.report import Visible


def visible_of(posterior: Posterior) -> tuple[Visible, ...]:
    """What each effect would be seen by with a probability of VISIBLE_POWER: in whatever of its shapes, and in the one that
    shows best. Infinite where a shape would be absorbed at any amplitude; effects of which nothing shows are left out."""
    sizes: dict[str, list[float]] = {}
    effects = {column.effect.slug: column.effect for column in posterior.columns}
    for column, amplitude in zip(posterior.columns, amplitudes_of(posterior).tolist(), strict=True):
        if column.effect.named:
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


def unseen_of(posterior: Posterior, visible: Sequence[Visible], raw: Sequence[RawEvidence]) -> tuple[str, ...]:
    """The effects of the catalogue of which these data show nothing at any size; an oil temperature that nobody measured
    competes without a shape."""
    shaped = {column.effect.slug for column in posterior.columns}
    shapeless = {slug for alternative in posterior.weights for slug in alternative.causes} - shaped
    shown = shapeless | {effect.effect for effect in visible} | {record.effect for record in raw}
    return tuple(effect.slug for effect in CATALOGUE if effect.slug not in shown)


def amplitudes_of(posterior: Posterior) -> FloatArray:
    """The formula above for each column [m], in SI units."""
    columns, projections = posterior.columns, posterior.null.evidence.screened
    best = max(projected.evidence for projected in projections)
    sd = np.array([column.effect.prior_sd for column in columns])
    odds = posterior.prior(Alternative(("",)))
    paid = np.array([-odds - column.log_weight for column in columns]) + np.log(len(SCALES))
    largest = np.zeros(len(columns))
    for projected in projections:
        info = np.maximum(np.diag(projected.info), 0.0)
        freedom = 0.5 * np.min([np.log1p((scale * sd) ** 2 * info) for scale in SCALES], axis=0)
        needed = 0.5 * (np.sqrt(2 * (paid + freedom)) + float(ndtri(VISIBLE_POWER))) ** 2
        left = np.maximum(needed - best + projected.evidence, 0.0)
        shown = info > LEAST_VISIBLE_SHARE * projected.whole
        amplitude = np.sqrt(2 * left / np.where(shown, info, 1.0))
        largest = np.maximum(largest, np.where(shown, amplitude, np.where(left > 0, np.inf, 0.0)))
    return largest
