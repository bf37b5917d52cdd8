"""Which hypotheses are worth a full refit: the best singles, the best pairs, and what the best singles leave for a second.

A linear screen of pairs sees them from the baseline's fit, where a loud effect bends everything; so a second effect is also
looked for in what is left of the best singles once they are refitted.
"""

from collections.abc import Iterable

from models.diagnosis.design import Design
from models.diagnosis.effect import unit_change
from models.diagnosis.fitting import Fit, Fitted, Priors, fit
from models.diagnosis.projection import GAINS, Projected, change_columns, gram_of, project
from models.diagnosis.raw import RawEvidence
from models.diagnosis.refitting import Hypothesis, Null, at_gain, finite, null_of, refitted
from models.diagnosis.selection import Column, Screened, linear_drop, screen, screen_pairs
from models.diagnosis.viewing import View
from models.diagnosis.whitening import Noise

#: So many single effects and pairs of the linear screens are refitted at most.
SINGLES, PAIRS = 5, 4
#: So many of them are looked for from other shapes as well.
RESTARTED = 3
#: ... where the screen leaves them this close [nats] to the best, and this share of λ more.
MARGIN, MARGIN_SHARE = 9.0, 0.2
#: Pairs of the linear screen must promise this much [nats] over the best single.
PAIR_PROMISE = -1.0
#: A second effect is looked for beside so many of the best singles, so many of each are refitted, and each must promise
#: this much [nats].
FIRSTS, SECONDS, SECOND_PROMISE = 2, 3, 3.0


def hypotheses_of(
    design: Design, noise: Noise, priors: Priors, baseline: Fit, view: View, raw: tuple[RawEvidence, ...]
) -> tuple[Noise, list[Hypothesis]]:
    """Singles and pairs refitted, and the rest as screened, best first; the noise with the likely gains."""
    singles = screen(view.columns, view.projections)
    pairs = screen_pairs(view.columns, view.projections)[:PAIRS]
    first = max((*singles[:1], *pairs[:1]), key=lambda each: each.evidence, default=None)
    if first is None:
        return noise, []
    noise = at_gain(noise, float(GAINS[first.gain]))
    projected = view.projections[first.gain]
    null = null_of(design, noise, priors, fit(design, noise, baseline.laws, priors))
    margin = MARGIN + MARGIN_SHARE * max(linear_drop(view.columns, projected, first)[1], 0.0)
    tried = [each for each in singles[:SINGLES] if each.evidence > singles[0].evidence - margin]
    found = [_refitted_linearly(design, noise, priors, null, view.columns, projected, each) for each in tried]
    for k in sorted(range(len(found)), key=lambda k: -found[k].evidence)[:RESTARTED]:
        others = [
            _refitted_linearly(design, noise, priors, null, view.columns, projected, each) for each in tried[k].others
        ]
        found[k] = max((found[k], *others), key=lambda each: each.evidence if finite(each) else float("-inf"))
    seconds = _pairs_of(design, noise, priors, null, view.columns, found)
    linear = [each for each in pairs if each.evidence > singles[0].evidence + PAIR_PROMISE]
    held = {frozenset(each.slugs) for each in seconds}
    for each in linear:
        if frozenset(effect.slug for effect in each.effects) not in held:
            seconds.append(_refitted_linearly(design, noise, priors, null, view.columns, projected, each))
    found = _without_partners(design, noise, priors, null, found, seconds)
    known = {each.slugs for each in found}
    rest = [
        Hypothesis(effects=each.effects, evidence=each.evidence, drop=0.0, fit=None)
        for each in singles
        if tuple(effect.slug for effect in each.effects) not in known
    ]
    seen = {each.effect: each.log_evidence for each in raw}
    told = [each.seen_raw(seen) for each in (*found, *seconds, *rest)]
    return noise, sorted(told, key=lambda each: -each.evidence)


def _refitted_linearly(
    design: Design,
    noise: Noise,
    priors: Priors,
    null: Null,
    columns: list[Column],
    projected: Projected,
    screened: Screened,
) -> Hypothesis:
    """A screened candidate refitted from its linear amplitudes."""
    amplitudes, drop = linear_drop(columns, projected, screened)
    start = _start(screened, amplitudes.tolist())
    return refitted(
        design, noise, priors, null, null.fit.laws, start, screened.shape_evidence, (screened.evidence, drop)
    )


def _start(screened: Screened, amplitudes: Iterable[float]) -> tuple[Fitted, ...]:
    return tuple(
        Fitted(effect=effect, amplitude=amplitude, shape=shape)
        for effect, amplitude, shape in zip(screened.effects, amplitudes, screened.shapes, strict=True)
    )


def _pairs_of(
    design: Design, noise: Noise, priors: Priors, null: Null, columns: list[Column], found: list[Hypothesis]
) -> list[Hypothesis]:
    """What stands out beside the best singles, refitted together with them."""
    usable = sorted((each for each in found if finite(each)), key=lambda each: -each.evidence)
    pairs: dict[frozenset[str], Hypothesis] = {}
    for one in usable[:FIRSTS]:
        _add_seconds(design, noise, priors, null, columns, one, pairs)
    if pairs:  # what the best pair brought in may have a better partner
        best = max(pairs.values(), key=lambda each: each.evidence)
        for one in usable[FIRSTS:]:
            if one.slugs[0] in best.slugs:
                _add_seconds(design, noise, priors, null, columns, one, pairs)
    return list(pairs.values())


def _without_partners(
    design: Design, noise: Noise, priors: Priors, null: Null, found: list[Hypothesis], pairs: list[Hypothesis]
) -> list[Hypothesis]:
    """Singles looked for once more from where the best pair has them: what is missed alone may be found in company."""
    best = max((each for each in pairs if finite(each)), key=lambda each: each.evidence, default=None)
    if best is None or best.fit is None:
        return found
    alone = {each.slugs: each for each in found}
    for each in best.fit.effects:
        known = alone.get((each.effect.slug,))
        if known is not None and known.evidence < best.evidence:
            linear = (known.evidence, known.drop)
            again = refitted(design, noise, priors, null, best.fit.laws, (each,), known.shape_evidence, linear)
            if finite(again) and again.evidence > known.evidence:
                alone[known.slugs] = again
    return list(alone.values())


def _add_seconds(
    design: Design,
    noise: Noise,
    priors: Priors,
    null: Null,
    columns: list[Column],
    one: Hypothesis,
    pairs: dict[frozenset[str], Hypothesis],
) -> None:
    if one.fit is None:
        return
    others = [column for column in columns if column.effect.slug != one.slugs[0]]
    projected = beside(design, noise, priors, one.fit, others)
    for second in screen(others, [projected])[:SECONDS]:
        slugs = frozenset((*one.slugs, second.effects[0].slug))
        if second.evidence < SECOND_PROMISE or slugs in pairs:
            continue
        amplitudes, drop = linear_drop(others, projected, second)
        start = (*one.fit.effects, *_start(second, amplitudes.tolist()))
        shape_evidence = one.shape_evidence + second.shape_evidence
        linear = (one.evidence + second.evidence, one.drop + drop)
        pairs[slugs] = refitted(design, noise, priors, null, one.fit.laws, start, shape_evidence, linear)


def beside(design: Design, noise: Noise, priors: Priors, fitted: Fit, columns: list[Column]) -> Projected:
    """The catalogue's columns projected off a fit with its effects, at the noise's scatter of the gains."""
    scene = fitted.prediction.scene
    changes = [(unit_change(each.effect, scene, each.shape), each.effect.lags(each.shape)) for each in columns]
    gram = gram_of(design, noise, priors, fitted, change_columns(design, fitted.prediction, changes))
    return project(gram, noise.run_gain)
