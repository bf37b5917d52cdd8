"""The search: which hypotheses are worth a full refit, the best singles, the best pairs, uncatalogued rig faults.

A linear screen sees everything from the baseline's fit, which a strong effect has distorted. So the best singles are also
searched from several shapes and, where the baseline has absorbed much of them, from laws without any effect; a second
effect is searched in what is left of the best singles once they are refitted, and a single from where the best pair has
it. The baseline itself is refitted from where the best of all has it: no effect gets credit for a valley that the
baseline had missed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from models.diagnosis.attribution.evidence import Hypothesis, HypothesisStatus, Null, null_of
from models.diagnosis.attribution.refits import Refits
from models.diagnosis.attribution.screening import Screened, screen, screen_pairs
from models.diagnosis.criteria import BETTER_BASELINE, LEAST_PAIR_PROMISE, LEAST_SECOND_PROMISE, PAIRS_REFITTED
from models.diagnosis.detection.projected_fit import ProjectedFit
from models.diagnosis.detection.raw_records.evidence import RawEvidence
from models.diagnosis.pooled_fit.baseline_fit import Baseline
from models.diagnosis.pooled_fit.gauss_newton import Fit, fit
from models.diagnosis.pooled_fit.problem import FitProblem


class SearchStatus(StrEnum):
    """How a search ended: no candidate that the data could show; the best refit ended by itself; it used all of its steps;
    or no refit was usable."""

    NO_CANDIDATE = "no_candidate"
    FINISHED = "finished"
    OUT_OF_STEPS = "out_of_steps"
    NONE_USABLE = "none_usable"


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchResult:
    """The problem with the likely gains; hypotheses, best first; the best uncatalogued rig fault, its evidence less the log
    odds of the choice among them (None where none comes near); the baseline refitted from where the best hypothesis has it,
    where that is better by BETTER_BASELINE."""

    problem: FitProblem
    hypotheses: tuple[Hypothesis, ...]
    fault: Hypothesis | None = None
    better_baseline: Fit | None = None

    @property
    def status(self) -> SearchStatus:
        """How the search ended."""
        if not self.hypotheses:
            return SearchStatus.NO_CANDIDATE
        best = best_of(self.hypotheses)
        if best is None:
            return SearchStatus.NONE_USABLE
        return SearchStatus.OUT_OF_STEPS if best.status is HypothesisStatus.OUT_OF_STEPS else SearchStatus.FINISHED


def best_of(hypotheses: Sequence[Hypothesis]) -> Hypothesis | None:
    """The usable hypothesis with the most evidence, None where none is usable."""
    usable = [hypothesis for hypothesis in hypotheses if hypothesis.usable]
    return max(usable, key=lambda hypothesis: hypothesis.evidence, default=None)


def search(baseline: Baseline, projected: ProjectedFit, raw: Sequence[RawEvidence]) -> SearchResult:
    """Singles and pairs refitted, and the rest as screened; raw records' evidence is added at the end."""
    screened = screen(projected.columns, projected.projections)
    screened_pairs = screen_pairs(projected.columns, projected.projections)[:PAIRS_REFITTED]
    first = max((*screened[:1], *screened_pairs[:1]), key=lambda candidate: candidate.evidence, default=None)
    if first is None:
        return SearchResult(problem=baseline.problem, hypotheses=())
    likely = projected.projections[first.gain]
    problem = baseline.problem.with_noise(likely.noise(baseline.problem.noise))
    null = null_of(problem, fit(problem, baseline.fit.laws))
    refits = Refits(problem=problem, start=baseline.start, null=null, projected=projected, likely=likely)
    singles, pairs = _singles_and_pairs(refits, screened, screened_pairs, first)
    refitted = {single.slugs for single in singles}
    faults = refits.faults(max((hypothesis.usable_evidence for hypothesis in (*singles, *pairs)), default=0.0))
    better = _better_null(refits, best_of([*singles, *pairs, *faults]))
    off = (0.0, 0.0)
    if better is not None:
        off = max(better.evidence - null.evidence, 0.0), max(better.profile - null.profile, 0.0)
    unfitted = [unrefitted(candidate) for candidate in screened if candidate.slugs not in refitted]
    hypotheses = [*(hypothesis.against(*off) for hypothesis in (*singles, *pairs)), *unfitted]
    evidence = added_by_raw(raw, hypotheses)
    return SearchResult(
        problem=problem,
        hypotheses=tuple(
            sorted(
                (hypothesis.with_raw(evidence) for hypothesis in hypotheses),
                key=lambda hypothesis: -hypothesis.evidence,
            )
        ),
        fault=best_of([fault.against(*off) for fault in faults]),
        better_baseline=None if better is None or off[0] < BETTER_BASELINE else better.fit,
    )


def added_by_raw(raw: Sequence[RawEvidence], hypotheses: Sequence[Hypothesis]) -> dict[str, float]:
    """Evidence [nats] by slug that raw records have of an effect beyond what it has alone by plateaus and bins: those are
    means of the same samples, and what both show counts once."""
    alone = {hypothesis.slugs[0]: hypothesis.evidence for hypothesis in hypotheses if len(hypothesis.effects) == 1}
    return {record.effect: max(record.log_evidence - max(alone.get(record.effect, 0.0), 0.0), 0.0) for record in raw}


def unrefitted(screened: Screened) -> Hypothesis:
    """A candidate as it was screened."""
    return Hypothesis(
        effects=screened.effects,
        evidence=screened.evidence,
        drop=0.0,
        fit=None,
        shape_evidence=screened.shape_evidence,
    )


def _singles_and_pairs(
    refits: Refits, screened: Sequence[Screened], screened_pairs: Sequence[Screened], first: Screened
) -> tuple[list[Hypothesis], list[Hypothesis]]:
    """The best of the screens refitted, seconds beside the best singles, and both again from where the best pair is."""
    singles = refits.singles(screened, first)
    pairs = refits.pairs(singles)
    alone = screened[0].evidence if screened else 0.0
    refitted = {frozenset(pair.slugs) for pair in pairs}
    pairs += [
        refits.from_screen(pair)
        for pair in screened_pairs
        if pair.evidence > alone + LEAST_PAIR_PROMISE and frozenset(pair.slugs) not in refitted
    ]
    linear = {candidate.slugs: unrefitted(candidate) for candidate in screened}
    return refits.from_the_best_pair(best_of(pairs), singles, pairs, linear)


def _better_null(refits: Refits, best: Hypothesis | None) -> Null | None:
    """No effect, refitted from where the best hypothesis has the baseline, if that fits better."""
    if best is None or best.fit is None or best.evidence < LEAST_SECOND_PROMISE:
        return None
    return refits.null_from(best.fit.laws)
