"""The investigation of a baseline: its alarms, and where they call for it a search of hypotheses.

What the baseline had missed may raise an alarm, or hide what did, and passes for noise. So where the search finds a better
baseline, everything is computed once more against that, its noise first.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.diagnosis.attribution.decide import CaseEvidence, calls_for_search
from models.diagnosis.attribution.search import SearchResult, search
from models.diagnosis.attribution.unmeasured_temperature import temperature_evidence
from models.diagnosis.detection.alarm import Alarms, alarms_of
from models.diagnosis.detection.projected_fit import ProjectedFit, project_fit
from models.diagnosis.detection.raw_records.evidence import RawEvidence
from models.diagnosis.detection.structure_axes import Where, axes_of
from models.diagnosis.effects.catalogued import oil_temperature
from models.diagnosis.effects.faults import FAULT_BY_SLUG
from models.diagnosis.effects.grid import Column
from models.diagnosis.pooled_fit.baseline_fit import Baseline, from_better
from models.diagnosis.pooled_fit.problem import FitProblem


@dataclass(frozen=True, slots=True, kw_only=True)
class Investigation:
    """A baseline's fit with everything projected off it, its alarms, the search (None where nothing called for one), raw
    records' evidence, the axes on which structure lives, and the first baseline where the search found a better one."""

    baseline: Baseline
    projected: ProjectedFit
    alarms: Alarms
    search: SearchResult | None
    raw: tuple[RawEvidence, ...]
    where: tuple[Where, ...]
    first: Baseline | None = None

    @property
    def problem(self) -> FitProblem:
        """The fit problem, with the likely gains where there was a search."""
        return self.baseline.problem if self.search is None else self.search.problem

    def evidence(self, without: frozenset[str]) -> CaseEvidence:
        """What the verdict is decided on; effects `without` do not compete."""
        unmeasured = -np.inf
        facts = self.problem.design.facts
        left_out = facts.temperature_measured or oil_temperature.EFFECT.slug in without
        if self.search is not None and not left_out:
            unmeasured = temperature_evidence(self.problem, self.projected.fit)
        return CaseEvidence(
            alarms=self.alarms,
            search=self.search,
            structure=max((axis.strength for axis in self.where), default=0.0),
            unmeasured=unmeasured,
            raw=self.raw,
            facts=facts,
        )


def investigate(
    baseline: Baseline, columns: Sequence[Column], raw: tuple[RawEvidence, ...], rng: np.random.Generator
) -> Investigation:
    """Investigate a baseline, and once more the better one that the search may find."""
    first = _investigated(baseline, columns, raw, rng)
    if first.search is None or first.search.better_baseline is None:
        return first
    again = _investigated(from_better(baseline, first.search.better_baseline), columns, raw, rng)
    return replace(again, first=baseline)


def _investigated(
    baseline: Baseline, columns: Sequence[Column], raw: tuple[RawEvidence, ...], rng: np.random.Generator
) -> Investigation:
    projected = project_fit(baseline.problem, baseline.fit, columns)
    alarms = alarms_of(baseline.problem, projected, rng)
    result = search(baseline, projected, raw) if calls_for_search(alarms, raw) else None
    fault = None
    if result is not None and result.fault is not None:
        fault = Where.of_evidence(FAULT_BY_SLUG[result.fault.slugs[0]].axis, result.fault.evidence)
    return Investigation(
        baseline=baseline,
        projected=projected,
        alarms=alarms,
        search=result,
        raw=raw,
        where=axes_of(projected, alarms.lines, raw, fault),
    )
