"""The diagnosis of a campaign, and its table of contents: one call a chapter, in the order of the folders.

design -> baseline, noise, pooled_fit -> effects -> detection, attribution -> validation -> experiments -> report
"""

import numpy as np

from models.diagnosis.attribution.check import Checks
from models.diagnosis.attribution.decide import decide, revise
from models.diagnosis.attribution.investigate import investigate
from models.diagnosis.attribution.sizes import sizes_of
from models.diagnosis.attribution.verdict import Verdict
from models.diagnosis.campaign import Campaign
from models.diagnosis.design.design import build_design
from models.diagnosis.detection.raw_records.evidence import raw_evidence
from models.diagnosis.effects.catalogue import effects_for
from models.diagnosis.effects.grid import columns_of
from models.diagnosis.experiments.rivals import rivals_of
from models.diagnosis.experiments.test_plan import advise
from models.diagnosis.explanations.decide import decide as read_off
from models.diagnosis.explanations.decide import explanations_of
from models.diagnosis.explanations.posterior import posterior_of
from models.diagnosis.pooled_fit.baseline_fit import IndeterminateError, fit_baseline, missing_for_baseline
from models.diagnosis.report.assemble import insufficient, report_of
from models.diagnosis.report.report import Report
from models.diagnosis.validation.extended_model import validate


def diagnose(campaign: Campaign, *, rng: np.random.Generator, without: frozenset[str] = frozenset()) -> Report:
    """What the baseline gets wrong in this campaign, why, and what an extension gains. The same rng, the same answer; each
    part that draws has a stream of its own.

    Effects whose slugs are in `without` are taken out of the catalogue. What data lack is a verdict, `insufficient_data`; an
    exception is a bug.
    """
    design = build_design(campaign)
    missing = missing_for_baseline(design)
    if missing:
        return insufficient(missing, design)
    try:
        baseline = fit_baseline(design)
    except IndeterminateError as lacking:
        return insufficient(str(lacking), design)
    columns = columns_of(effects_for(design.facts, without), design.facts)
    raw = tuple(record for record in raw_evidence(campaign) if record.effect not in without)
    of_alarms, of_checks, of_gain, of_sizes = rng.spawn(4)
    investigation = investigate(baseline, columns, raw, of_alarms)
    problem = investigation.problem
    first = decide(investigation.evidence(without), Checks(problem, of_checks))
    validation = validate(problem, investigation.projected.fit, first, investigation.where, of_gain)
    judgement = revise(first, validation.held_out)
    sizes = sizes_of(problem, judgement, of_sizes)
    hypotheses = () if investigation.search is None else investigation.search.hypotheses
    advice = advise(campaign, problem, *rivals_of(judgement, hypotheses))
    return report_of(investigation, judgement, validation, sizes, advice)


def verdict_by_posterior(campaign: Campaign, without: frozenset[str] = frozenset()) -> tuple[Verdict, tuple[str, ...]]:
    """Verdict and causes as one posterior has them (`explanations`), which makes no verdict of a report yet; it draws no
    random numbers. Effects whose slugs are in `without` are taken out of the catalogue."""
    design = build_design(campaign)
    if missing_for_baseline(design):
        return Verdict.INSUFFICIENT_DATA, ()
    try:
        baseline = fit_baseline(design)
    except IndeterminateError:
        return Verdict.INSUFFICIENT_DATA, ()
    raw = tuple(record for record in raw_evidence(campaign) if record.effect not in without)
    return read_off(explanations_of(posterior_of(baseline, raw, without)))
