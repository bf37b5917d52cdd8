"""Refits of screened candidates with everything else free: singles, seconds beside them, uncatalogued rig faults."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.diagnosis.attribution.evidence import STEPS, Hypothesis, Null, null_of, refitted
from models.diagnosis.attribution.screening import Screened, linear_drop, screen
from models.diagnosis.baseline.laws import Laws
from models.diagnosis.criteria import (
    FAULTS_REFITTED,
    FIRSTS_OF_PAIRS,
    LEAST_SECOND_PROMISE,
    MUCH_ABSORBED,
    OTHER_HALF_MARGIN,
    SCREEN_MARGIN,
    SCREEN_MARGIN_SHARE,
    SECONDS_OF_PAIRS,
    SINGLES_REFITTED,
    SINGLES_RESTARTED,
)
from models.diagnosis.detection.projected_fit import ProjectedFit
from models.diagnosis.effects.faults import FAULTS
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.effects.grid import Column, columns_at_rows, columns_of
from models.diagnosis.pooled_fit.gauss_newton import Fit, fit
from models.diagnosis.pooled_fit.gram import gram_of
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import Projected, project

#: Gauss-Newton steps after which starts are compared, and how many of them go on each time.
_ROUGH = ((3, 3), (3, 1))
#: Gauss-Newton steps that one half of the best pair is given alone before other partners are searched.
_STEPS_BESIDE = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Refits:
    """What every refit needs: the problem, laws that no effect has distorted, the null, the baseline's fit projected,
    and its projection at the likely gains."""

    problem: FitProblem
    start: Laws
    null: Null
    projected: ProjectedFit
    likely: Projected

    def refit(
        self,
        laws: Laws,
        effects: tuple[FittedEffect, ...],
        shape_evidence: float,
        linear: tuple[float, float],
        steps: int = STEPS,
    ) -> Hypothesis:
        """A hypothesis from laws and effects."""
        return refitted(self.problem, self.null, laws, effects, shape_evidence, linear, steps=steps)

    def null_from(self, laws: Laws) -> Null | None:
        """No effect, refitted from other laws, if that fits better."""
        fitted = fit(self.problem, laws, steps=STEPS)
        return null_of(self.problem, fitted) if fitted.cost <= self.null.fit.cost else None

    def from_screen(self, screened: Screened) -> Hypothesis:
        """A screened candidate refitted from its linear amplitudes and the null's laws."""
        effects, drop = self._linear(screened)
        return self.refit(self.null.fit.laws, effects, screened.shape_evidence, (screened.evidence, drop))

    def _linear(self, screened: Screened) -> tuple[tuple[FittedEffect, ...], float]:
        """A screened candidate's effects at their linear amplitudes, and the drop of the cost [nats]."""
        amplitudes, drop = linear_drop(self.projected.columns, self.likely, screened)
        effects = tuple(
            FittedEffect(effect=effect, amplitude=amplitude, shape=shape)
            for effect, amplitude, shape in zip(screened.effects, amplitudes.tolist(), screened.shapes, strict=True)
        )
        return effects, drop

    def singles(self, screened: Sequence[Screened], first: Screened) -> list[Hypothesis]:
        """The best single effects, the very best from several starts."""
        drop = linear_drop(self.projected.columns, self.likely, first)[1]
        margin = SCREEN_MARGIN + SCREEN_MARGIN_SHARE * max(drop, 0.0)
        near = [
            candidate for candidate in screened[:SINGLES_REFITTED] if candidate.evidence > screened[0].evidence - margin
        ]
        singles = [self.from_screen(candidate) for candidate in near]
        for k in sorted(range(len(singles)), key=lambda k: -singles[k].evidence)[:SINGLES_RESTARTED]:
            restarted = self._restarted(near[k], singles[k])
            singles[k] = max(singles[k], restarted, key=lambda hypothesis: hypothesis.usable_evidence)
        return singles

    def _restarted(self, screened: Screened, before: Hypothesis) -> Hypothesis:
        """A single effect followed to its end from the best of several starts; as it was where no start led anywhere."""
        starts = [(self.null.fit.laws, other) for other in screened.others]
        if self._absorbed(screened) > MUCH_ABSORBED:
            starts += [(self.start, other) for other in (screened, *screened.others)]
        racing = [(laws, self._linear(other)[0], other.shape_evidence) for laws, other in starts]
        reached = [] if before.fit is None else [(before.fit, before.shape_evidence)]
        for steps, left in _ROUGH:
            rough = [
                (fit(self.problem, laws, effects, steps=steps), shape_evidence)
                for laws, effects, shape_evidence in racing
            ]
            rough.sort(key=lambda trial: trial[0].cost - trial[1])
            racing = [(fitted.laws, fitted.effects, shape_evidence) for fitted, shape_evidence in rough[:left]]
        reached += rough[:1]
        if not reached:
            return before
        best, shape_evidence = min(reached, key=lambda trial: trial[0].cost - trial[1])
        return self.refit(best.laws, best.effects, shape_evidence, (before.evidence, before.drop))

    def _absorbed(self, screened: Screened) -> float:
        """λ [nats] that a single effect of its linear amplitude would have if the baseline absorbed nothing of it."""
        amplitude = self._linear(screened)[0][0].amplitude
        place = self.projected.gram.base + screened.places[0]
        return 0.5 * amplitude**2 * float(self.projected.gram.matrix[place, place])

    def pairs(self, singles: Sequence[Hypothesis]) -> list[Hypothesis]:
        """What stands out beside the best singles, refitted together with them."""
        usable = sorted((single for single in singles if single.usable), key=lambda single: -single.evidence)
        pairs: dict[frozenset[str], Hypothesis] = {}
        for first in usable[:FIRSTS_OF_PAIRS]:
            self._add_seconds(first, pairs)
        if pairs:  # what the best pair brought in may have a better partner
            best = max(pairs.values(), key=lambda pair: pair.usable_evidence)
            for first in usable[FIRSTS_OF_PAIRS:]:
                if first.slugs[0] in best.slugs:
                    self._add_seconds(first, pairs)
        return list(pairs.values())

    def _add_seconds(self, first: Hypothesis, pairs: dict[frozenset[str], Hypothesis]) -> None:
        """Refit what stands out beside a single effect together with it; better pairs replace those there are."""
        if first.fit is None:
            return
        others = [column for column in self.projected.columns if column.effect.slug != first.slugs[0]]
        projected = beside(self.problem, first.fit, others)
        for second in screen(others, [projected])[:SECONDS_OF_PAIRS]:
            slugs = frozenset((*first.slugs, *second.slugs))
            promised, before = first.evidence + second.evidence, pairs.get(slugs)
            if second.evidence < LEAST_SECOND_PROMISE or (
                before is not None and promised < before.evidence - OTHER_HALF_MARGIN
            ):
                continue
            added, drop = _added(others, projected, second)
            shape_evidence = first.shape_evidence + second.shape_evidence
            linear = (promised, first.drop + drop)
            pair = self.refit(first.fit.laws, (*first.fit.effects, added), shape_evidence, linear)
            if before is None or (pair.usable and pair.evidence > before.usable_evidence):
                pairs[slugs] = pair

    def faults(self, best: float) -> list[Hypothesis]:
        """Uncatalogued rig faults that come near the best [nats], refitted; less the log odds of the choice among them."""
        columns = columns_of(FAULTS, self.problem.design.facts)
        baseline = self.null.fit
        projected = beside(self.problem, baseline, columns)
        least = max(best, 0.0) * (1.0 - SCREEN_MARGIN_SHARE) - SCREEN_MARGIN
        near = [candidate for candidate in screen(columns, [projected]) if candidate.evidence > least]
        faults = []
        for candidate in near[:FAULTS_REFITTED]:
            added, drop = _added(columns, projected, candidate)
            linear = (candidate.evidence, drop)
            faults.append(self.refit(baseline.laws, (added,), candidate.shape_evidence, linear))
        return [fault.against(float(np.log(len(FAULTS))), 0.0) for fault in faults]

    def from_the_best_pair(
        self,
        best: Hypothesis | None,
        singles: list[Hypothesis],
        pairs: list[Hypothesis],
        linear: Mapping[tuple[str, ...], Hypothesis],
    ) -> tuple[list[Hypothesis], list[Hypothesis]]:
        """Singles searched once more from where the best pair has them, for what is missed alone may be found in company;
        and other partners beside those that are better so, for a pair may have ended in a wrong valley. `linear` are the
        screened singles, for those that were not refitted."""
        if best is None or best.fit is None:
            return singles, pairs
        alone = {single.slugs: single for single in singles}
        others = {frozenset(pair.slugs): pair for pair in pairs}
        for half in best.fit.effects:
            slugs = (half.effect.slug,)
            before = alone.get(slugs, linear.get(slugs))
            if before is None or before.evidence >= best.evidence:
                continue
            given = best.fit.laws, (half,), before.shape_evidence, (before.evidence, before.drop)
            if slugs in alone:
                again = self.refit(*given)
                alone[slugs] = again if again.usable and again.evidence > before.evidence else before
            self._add_seconds(self.refit(*given, _STEPS_BESIDE), others)  # before it leaves that valley
        return list(alone.values()), list(others.values())


def _added(columns: Sequence[Column], projected: Projected, screened: Screened) -> tuple[FittedEffect, float]:
    """A screened single effect at its linear amplitude, and the drop of the cost [nats]."""
    amplitudes, drop = linear_drop(columns, projected, screened)
    return FittedEffect(effect=screened.effects[0], amplitude=float(amplitudes[0]), shape=screened.shapes[0]), drop


def beside(problem: FitProblem, fitted: Fit, columns: Sequence[Column]) -> Projected:
    """The columns projected off a fit with its effects, at the noise's scatter of the gains."""
    gram = gram_of(problem, fitted, columns_at_rows(problem.design, fitted.prediction, columns))
    return project(gram, problem.noise.run_gain, problem.noise.curve_gain)
