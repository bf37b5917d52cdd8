"""What a campaign can show: which amplitude of each effect, and which causes it can tell apart.

An effect of amplitude a raises λ = ½ a² info nats where the gains' scatter σ is known. It is not: a larger one may take up
what the effect does, and costs evidence. So an amplitude counts as visible where no scatter can explain it,

    a = max over σ of √(2 (λ_90 - L* + L(σ))₊/info(σ)),     λ_90 = ½ (√(2 t) + 1.28)²

with L(σ) the evidence of a scatter and L* the largest. The model is called wrong where the effect's posterior odds against
nothing are even: where the drop of the cost pays for the prior odds of the effect, for that of its shape and for the
freedom of its amplitude, of prior deviation s in the narrower or the wider of two (`effects.effect.SCALES`),

    t = -ln(prior odds) - ln p(shape) + ln 2 + min over s of ½ ln(1 + s² info).

Which causes it can tell apart is known from its design alone, before anything is hidden in it. Each effect is thought to be
at work at twice the amplitude that the data show with 90 % power, in its most probable shape. What of its change another
effect, in whatever of its shapes, cannot imitate beside the baseline is

    λ_ab = min over shapes of b of ½ dᵀ V⁻¹ (1 - P_b) d      [nats]

(`experiments.information`), and what that says of the two is normal as in the plan of tests (`experiments.test_plan`).
Vibrations are not in the table: they are seen in raw records, where nothing of the rest is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations, groupby

import numpy as np
from scipy.special import ndtri

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.campaign import Campaign
from models.diagnosis.effects.catalogue import CATALOGUE, Column, columns_at_rows
from models.diagnosis.effects.effect import SCALES, EffectKind
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.experiments.candidates import TRIALS, runs_of
from models.diagnosis.experiments.information import CandidateDistances
from models.diagnosis.experiments.test_plan import bare, distinguished, trials_of
from models.diagnosis.explanations.posterior import Posterior, screen_of
from models.diagnosis.explanations.verdict import Alternative
from models.diagnosis.pooled_fit.gauss_newton import PooledFit
from models.diagnosis.pooled_fit.projection import gram_of, project
from models.diagnosis.raw_records.evidence import RawEvidence
from models.diagnosis.report.report import Isolability, Pair, Visible


def visible_of(posterior: Posterior) -> tuple[Visible, ...]:
    """Detectable amplitudes of each effect at a power of VISIBLE_POWER: in its hardest shape, and in the easiest one.
    Infinite where a shape would be absorbed at any amplitude; effects that are absorbed in every shape are left out."""
    sizes: dict[str, list[float]] = {}
    effects = {column.effect.slug: column.effect for column in posterior.columns}
    for column, amplitude in zip(posterior.columns, detectable_amplitudes(posterior).tolist(), strict=True):
        if column.effect.named:
            sizes.setdefault(column.effect.slug, []).append(amplitude * column.effect.scale)
    return tuple(
        Visible(
            effect=slug,
            amplitude=max(by_shape),
            least=min(by_shape),
            usual=effects[slug].prior_sd * effects[slug].scale,
            unit=effects[slug].unit,
            isolability=posterior.isolability[slug],
        )
        for slug, by_shape in sizes.items()
        if np.isfinite(min(by_shape))
    )


def unseen_of(posterior: Posterior, visible: Sequence[Visible], raw: Sequence[RawEvidence]) -> tuple[str, ...]:
    """Slugs of the catalogue's effects that these data cannot show at any size; an oil temperature that nobody measured
    competes without a shape."""
    shaped = {column.effect.slug for column in posterior.columns}
    shapeless = {slug for alternative in posterior.weights for slug in alternative.causes} - shaped
    shown = shapeless | {effect.effect for effect in visible} | {record.effect for record in raw}
    return tuple(effect.slug for effect in CATALOGUE if effect.slug not in shown)


def detectable_amplitudes(posterior: Posterior) -> FloatArray:
    """Smallest amplitude a [m] of each screened column (an effect in one shape) that the data show at VISIBLE_POWER, by
    the formula above, in the effect's SI unit; infinite where the baseline absorbs any amplitude."""
    columns, projections = posterior.columns, posterior.null.evidence.screened
    best = max(projected.evidence for projected in projections)  # L*
    sd = np.array([column.effect.prior_sd for column in columns])
    odds = posterior.prior(Alternative(("",)))
    price = np.array([-odds - column.log_weight for column in columns]) + np.log(len(SCALES))
    largest = np.zeros(len(columns))
    for projected in projections:
        info, whole = screen_of(projected).info, screen_of(projected).whole
        freedom = 0.5 * np.min([np.log1p((scale * sd) ** 2 * info) for scale in SCALES], axis=0)
        needed = 0.5 * (np.sqrt(2 * (price + freedom)) + float(ndtri(criteria.VISIBLE_POWER))) ** 2  # λ_90
        left = np.maximum(needed - best + projected.evidence, 0.0)
        shown = info > 1e-6 * whole  # the rest is rounding
        amplitude = np.sqrt(2 * left / np.where(shown, info, 1.0))
        largest = np.maximum(largest, np.where(shown, amplitude, np.where(left > 0, np.inf, 0.0)))
    return largest


#: The amplitude that is thought to be at work, in visible ones: what `make visible` promises to be seen.
_TIMES_VISIBLE = 2.0


def isolability_of(campaign: Campaign, posterior: Posterior) -> Isolability:
    """The pairs of the catalogue's effects with the probability that this design tells them apart, and the effects it
    cannot show."""
    slugs = [effect.slug for effect in CATALOGUE if effect.kind is not EffectKind.VIBRATION]
    grouped = {
        slug: [(column, float(size)) for column, size in places]
        for slug, places in groupby(
            zip(posterior.columns, detectable_amplitudes(posterior), strict=True),
            key=lambda place: place[0].effect.slug,
        )
        if slug in slugs
    }
    visible = {slug: shapes for slug, shapes in grouped.items() if any(np.isfinite(size) for _, size in shapes)}
    problem, null = posterior.problem, posterior.null.fit
    noise, changes = problem.noise, columns_at_rows(problem.design, null.prediction, posterior.columns)
    info = project(gram_of(problem, null, changes), noise.run_gain, noise.curve_gain, noise.law).info
    place_of = {id(column): place for place, column in enumerate(posterior.columns)}
    likeliest = {}  # the most probable shape in which an effect is seen, and its amplitude [SI] there
    for slug, shapes in visible.items():
        seen = [shape for shape in shapes if np.isfinite(shape[1])]
        column, size = max(seen, key=lambda shape: shape[0].log_weight)
        likeliest[slug] = column, _TIMES_VISIBLE * size
    pairs = []
    for first, second in combinations(visible, 2):
        ways = []
        for true, rival in ((first, second), (second, first)):
            column, size = likeliest[true]
            at, others = place_of[id(column)], [place_of[id(other)] for other, _ in visible[rival]]
            # the rival's column that imitates it best, at the amplitude at which it does
            absorbed = np.maximum(np.diag(info)[others], 1e-300)
            best = int(np.argmax(info[at, others] ** 2 / absorbed))
            likest, imitated = others[best], float(size * info[at, others[best]] / absorbed[best])
            ways.append((_with(null, column, size), _with(null, posterior.columns[likest], imitated)))
        pairs.append(_pair(campaign, posterior, (first, second), ways))
    return Isolability(
        pairs=tuple(sorted(pairs, key=lambda pair: pair.probability)),
        unseen=tuple(slug for slug in slugs if slug not in visible),
    )


def _with(null: PooledFit, column: Column, amplitude: float) -> PooledFit:
    """The baseline's fit with one effect added."""
    amplitude = abs(amplitude) if column.effect.positive else amplitude
    return replace(bare(null), effects=(FittedEffect(effect=column.effect, amplitude=amplitude, shape=column.shape),))


def _pair(
    campaign: Campaign, posterior: Posterior, effects: tuple[str, str], ways: Sequence[tuple[PooledFit, PooledFit]]
) -> Pair:
    """The pair of two effects: the lower probability of both ways round that they are told apart, now and with the best
    trial."""
    after = dict[str, float]()
    distances = [CandidateDistances(posterior.problem, way) for way in ways]
    now = min(float(distinguished(distance.distances(())[0, 1])) for distance in distances)
    for distance in distances if now < criteria.SURE else ():
        for key, rows in trials_of(campaign, posterior.problem.design, distance).items():
            chance = float(distinguished(distance.distances(rows)[0, 1]))
            after[key] = min(after.get(key, 1.0), chance)
    trial = _parting(after, now)
    return Pair(
        effects=effects,
        probability=now,
        apart=now >= criteria.SURE,
        trial=trial,
        test=TRIALS[trial].text if trial else "",
        with_trial=after.get(trial, now),
    )


def _parting(after: Mapping[str, float], now: float) -> str:
    """Key of the trial of least work that is sure to distinguish two effects, else of the most helpful one; empty where
    none helps."""
    sure = [key for key, chance in after.items() if chance >= criteria.SURE]
    if sure:
        return min(sure, key=runs_of)
    best = max(after, key=after.__getitem__, default="")
    return best if best and after[best] > now else ""
