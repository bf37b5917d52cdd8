"""Which hypotheses are worth a full refit: the best singles, the best pairs, and what the best singles leave for a second.

A linear screen sees everything from the baseline's fit, which a loud effect has bent. So the best singles are looked for
from several shapes, and, where the baseline has swallowed much of them, from laws that nothing has bent; a second effect
is also looked for in what is left of the best singles once they are refitted, and a single from where the best pair has it.
"""

from dataclasses import dataclass

import numpy as np

from models.diagnosis.attribution.evidence import MOST_STEPS, STEPS, Hypothesis, Null, finite, null_of, refitted
from models.diagnosis.attribution.screening import Column, Screened, columns_of, linear_drop, screen, screen_pairs
from models.diagnosis.baseline.laws import Laws
from models.diagnosis.design.design import Design
from models.diagnosis.detection.raw_records.evidence import RawEvidence
from models.diagnosis.detection.view import View, columns_at_rows
from models.diagnosis.effects.uncatalogued.catalogue import UNCATALOGUED
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import Fit, Fitted, Priors, fit
from models.diagnosis.pooled_fit.projection import Projected, gram_of, project

#: So many single effects and pairs of the linear screens are refitted at most.
SINGLES, PAIRS = 5, 4
#: ... where the screen leaves them this close [nats] to the best, and this share of λ more.
MARGIN, MARGIN_SHARE = 9.0, 0.2
#: So many of them are looked for from other shapes as well, and from other laws where so much [nats] of them would be there
#: to be seen if the baseline did not take it up: so far off, nothing is linear.
RESTARTED, SWALLOWED = 1, 1000.0
#: Gauss-Newton steps after which starts are compared, and how many of them go on each time.
ROUGH = ((3, 3), (3, 1))
#: Pairs of the linear screen must promise this much [nats] over the best single.
PAIR_PROMISE = -1.0
#: A second effect is looked for beside so many of the best singles, so many of each are refitted, and each must promise
#: this much [nats].
FIRSTS, SECONDS, SECOND_PROMISE = 2, 3, 3.0
#: A pair is refitted from its other half as well where that promises so much [nats] less than is known at most.
AGAIN = 6.0
#: Gauss-Newton steps that one half of the best pair is given alone before other partners are looked for.
STEPS_BESIDE = 2
#: A baseline that is better by so much [nats] is another one.
CLEARLY = 1.0
#: So many of what the catalogue does not hold are refitted at most, where they promise to come near the best.
STRANGE = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """The noise with the likely gains; hypotheses, best first; the best of what is not in the catalogue, its evidence
    less what the choice among so many costs (None where none comes near); and the baseline seen from where the best of all
    has it, where that is better by CLEARLY."""

    noise: Noise
    hypotheses: list[Hypothesis]
    stranger: Hypothesis | None = None
    better: Fit | None = None


def hypotheses_of(
    design: Design, noise: Noise, priors: Priors, start: Laws, baseline: Fit, view: View, raw: tuple[RawEvidence, ...]
) -> Found:
    """Singles and pairs refitted, and the rest as screened. `start`: laws that no effect has bent."""
    singles = screen(view.columns, view.projections)
    pairs = screen_pairs(view.columns, view.projections)[:PAIRS]
    first = max((*singles[:1], *pairs[:1]), key=lambda each: each.evidence, default=None)
    if first is None:
        return Found(noise=noise, hypotheses=[])
    noise = view.projections[first.gain].noise(noise)
    null = null_of(design, noise, priors, fit(design, noise, baseline.laws, priors))
    search = _Search(
        design=design, noise=noise, priors=priors, start=start, null=null, view=view,
        projected=view.projections[first.gain],
    )  # fmt: skip
    found = search.singles(singles, first)
    seconds = search.pairs(found)
    alone = singles[0].evidence if singles else 0.0
    linear = [each for each in pairs if each.evidence > alone + PAIR_PROMISE]
    held = {frozenset(each.slugs) for each in seconds}
    seconds += [search.from_screen(each) for each in linear if frozenset(_slugs(each)) not in held]
    found, seconds = search.from_the_best_pair(found, seconds, singles)
    known = {each.slugs for each in found}
    strange = search.strangers(max((_evidence(each) for each in (*found, *seconds)), default=0.0))
    better = search.better_null([*found, *seconds, *strange])
    off = search.better_by(better)
    found, seconds, strange = ([each.less(*off) for each in some] for some in (found, seconds, strange))
    rest = [_unfitted(each) for each in singles if _slugs(each) not in known]
    seen = {each.effect: each.log_evidence for each in raw}
    told = [each.seen_raw(seen) for each in (*found, *seconds, *rest)]
    return Found(
        noise=noise,
        hypotheses=sorted(told, key=lambda each: -each.evidence),
        stranger=max(filter(finite, strange), key=lambda each: each.evidence, default=None),
        better=None if better is None or off[0] < CLEARLY else better.fit,
    )


def _evidence(hypothesis: Hypothesis) -> float:
    return hypothesis.evidence if finite(hypothesis) else -np.inf


def _unfitted(screened: Screened) -> Hypothesis:
    return Hypothesis(
        effects=screened.effects,
        evidence=screened.evidence,
        drop=0.0,
        fit=None,
        shape_evidence=screened.shape_evidence,
    )


def _slugs(screened: Screened) -> tuple[str, ...]:
    return tuple(effect.slug for effect in screened.effects)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Search:
    """What every refit needs: the null, laws that nothing has bent, the view of the baseline and its projection at the
    likely gains."""

    design: Design
    noise: Noise
    priors: Priors
    start: Laws
    null: Null
    view: View
    projected: Projected

    def refitted(
        self,
        laws: Laws,
        effects: tuple[Fitted, ...],
        shape_evidence: float,
        linear: tuple[float, float],
        steps: int,
    ) -> Hypothesis:
        """A hypothesis from laws and effects."""
        return refitted(
            self.design, self.noise, self.priors, self.null, laws, effects, shape_evidence, linear, steps=steps
        )

    def linear(self, screened: Screened) -> tuple[tuple[Fitted, ...], float]:
        """A screened candidate's effects at their linear amplitudes, and the drop of the cost [nats]."""
        amplitudes, drop = linear_drop(self.view.columns, self.projected, screened)
        effects = tuple(
            Fitted(effect=effect, amplitude=amplitude, shape=shape)
            for effect, amplitude, shape in zip(screened.effects, amplitudes.tolist(), screened.shapes, strict=True)
        )
        return effects, drop

    def from_screen(self, screened: Screened) -> Hypothesis:
        """A screened candidate refitted from its linear amplitudes and the null's laws."""
        effects, drop = self.linear(screened)
        return self.refitted(self.null.fit.laws, effects, screened.shape_evidence, (screened.evidence, drop), STEPS)

    def singles(self, screened: list[Screened], first: Screened) -> list[Hypothesis]:
        """The best single effects, the very best from several starts."""
        margin = MARGIN + MARGIN_SHARE * max(linear_drop(self.view.columns, self.projected, first)[1], 0.0)
        tried = [each for each in screened[:SINGLES] if each.evidence > screened[0].evidence - margin]
        found = [self.from_screen(each) for each in tried]
        for k in sorted(range(len(found)), key=lambda k: -found[k].evidence)[:RESTARTED]:
            found[k] = max(found[k], self.restarted(tried[k], found[k]), key=_evidence)
        return found

    def restarted(self, screened: Screened, known: Hypothesis) -> Hypothesis:
        """A single effect followed to the end from the best of several starts."""
        starts = [(self.null.fit.laws, each) for each in screened.others]
        if self.swallowed(screened) > SWALLOWED:
            starts += [(self.start, each) for each in (screened, *screened.others)]
        racing = [(laws, self.linear(each)[0], each.shape_evidence) for laws, each in starts]
        reached = [] if known.fit is None else [(known.fit, known.shape_evidence)]
        for steps, left in ROUGH:
            rough = [
                (fit(self.design, self.noise, laws, self.priors, effects, steps=steps), shape_evidence)
                for laws, effects, shape_evidence in racing
            ]
            rough.sort(key=lambda each: each[0].cost - each[1])
            racing = [(each.laws, each.effects, shape_evidence) for each, shape_evidence in rough[:left]]
        reached += rough[:1]
        if not reached:
            return known
        best, shape_evidence = min(reached, key=lambda each: each[0].cost - each[1])
        return self.refitted(best.laws, best.effects, shape_evidence, (known.evidence, known.drop), MOST_STEPS)

    def swallowed(self, screened: Screened) -> float:
        """λ [nats] that a single effect of its linear amplitude had if the baseline took nothing of it up."""
        amplitude = self.linear(screened)[0][0].amplitude
        place = self.view.gram.base + screened.places[0]
        return 0.5 * amplitude**2 * float(self.view.gram.matrix[place, place])

    def pairs(self, found: list[Hypothesis]) -> list[Hypothesis]:
        """What stands out beside the best singles, refitted together with them."""
        usable = sorted((each for each in found if finite(each)), key=lambda each: -each.evidence)
        pairs: dict[frozenset[str], Hypothesis] = {}
        for one in usable[:FIRSTS]:
            self._add_seconds(one, pairs)
        if pairs:  # what the best pair brought in may have a better partner
            best = max(pairs.values(), key=_evidence)
            for one in usable[FIRSTS:]:
                if one.slugs[0] in best.slugs:
                    self._add_seconds(one, pairs)
        return list(pairs.values())

    def _add_seconds(self, one: Hypothesis, pairs: dict[frozenset[str], Hypothesis]) -> None:
        if one.fit is None:
            return
        others = [column for column in self.view.columns if column.effect.slug != one.slugs[0]]
        projected = beside(self.design, self.noise, self.priors, one.fit, others)
        for second in screen(others, [projected])[:SECONDS]:
            slugs = frozenset((*one.slugs, *_slugs(second)))
            promised, known = one.evidence + second.evidence, pairs.get(slugs)
            if second.evidence < SECOND_PROMISE or (known is not None and promised < known.evidence - AGAIN):
                continue
            amplitudes, drop = linear_drop(others, projected, second)
            added = Fitted(effect=second.effects[0], amplitude=float(amplitudes[0]), shape=second.shapes[0])
            shape_evidence = one.shape_evidence + second.shape_evidence
            linear = (promised, one.drop + drop)
            again = self.refitted(one.fit.laws, (*one.fit.effects, added), shape_evidence, linear, STEPS)
            if known is None or (finite(again) and again.evidence > _evidence(known)):
                pairs[slugs] = again

    def strangers(self, best: float) -> list[Hypothesis]:
        """What is not in the catalogue and comes near the best [nats], refitted."""
        effects = [each.effect for each in UNCATALOGUED]
        columns = columns_of(effects, [effect.grid(self.design.facts) for effect in effects])
        fitted = self.null.fit
        projected = beside(self.design, self.noise, self.priors, fitted, columns)
        least = max(best, 0.0) * (1.0 - MARGIN_SHARE) - MARGIN
        near = [each for each in screen(columns, [projected]) if each.evidence > least]
        found = []
        for each in near[:STRANGE]:
            amplitudes, drop = linear_drop(columns, projected, each)
            added = Fitted(effect=each.effects[0], amplitude=float(amplitudes[0]), shape=each.shapes[0])
            linear = (each.evidence, drop)
            found.append(self.refitted(fitted.laws, (added,), each.shape_evidence, linear, STEPS))
        return [each.less(float(np.log(len(UNCATALOGUED))), 0.0) for each in found]

    def from_the_best_pair(
        self, found: list[Hypothesis], pairs: list[Hypothesis], screened: list[Screened]
    ) -> tuple[list[Hypothesis], list[Hypothesis]]:
        """Singles looked for once more from where the best pair has them, for what is missed alone may be found in company;
        and other partners beside those that are better so, for a pair may have ended in a wrong valley."""
        best = max((each for each in pairs if finite(each)), key=lambda each: each.evidence, default=None)
        if best is None or best.fit is None:
            return found, pairs
        alone = {each.slugs: each for each in found}
        others = {frozenset(each.slugs): each for each in pairs}
        linear = {_slugs(each): _unfitted(each) for each in screened}
        for each in best.fit.effects:
            slugs = (each.effect.slug,)
            known = alone.get(slugs, linear.get(slugs))
            if known is None or known.evidence >= best.evidence:
                continue
            shown = (known.evidence, known.drop)
            given = best.fit.laws, (each,), known.shape_evidence, shown
            if slugs in alone:
                again = self.refitted(*given, MOST_STEPS)
                alone[slugs] = again if finite(again) and again.evidence > known.evidence else known
            self._add_seconds(self.refitted(*given, STEPS_BESIDE), others)  # before it leaves that valley
        return list(alone.values()), list(others.values())

    def better_null(self, hypotheses: list[Hypothesis]) -> Null | None:
        """Nothing at all, seen from where the best hypothesis has the baseline, if it fits better there: no effect is
        praised for a valley that the baseline had missed."""
        best = max((each for each in hypotheses if finite(each)), key=lambda each: each.evidence, default=None)
        if best is None or best.fit is None or best.evidence < SECOND_PROMISE:
            return None
        again = fit(self.design, self.noise, best.fit.laws, self.priors, steps=STEPS)
        return null_of(self.design, self.noise, self.priors, again) if again.cost <= self.null.fit.cost else None

    def better_by(self, found: Null | None) -> tuple[float, float]:
        """By how much evidence and likelihood [nats] of nothing at all are better than was thought."""
        if found is None:
            return 0.0, 0.0
        return max(found.evidence - self.null.evidence, 0.0), max(found.profile - self.null.profile, 0.0)


def beside(design: Design, noise: Noise, priors: Priors, fitted: Fit, columns: list[Column]) -> Projected:
    """The catalogue's columns projected off a fit with its effects, at the noise's scatter of the gains."""
    gram = gram_of(design, noise, priors, fitted, columns_at_rows(design, fitted.prediction, columns))
    return project(gram, noise.run_gain, noise.curve_gain)
