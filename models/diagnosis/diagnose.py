"""The diagnosis of a campaign: calls one chapter after the other, in the order of the folders.

design -> baseline, noise, pooled_fit -> effects, raw_records -> explanations -> validation -> experiments -> report
"""

from dataclasses import replace

import numpy as np

from models.diagnosis.campaign import Campaign
from models.diagnosis.design.design import build_design
from models.diagnosis.experiments.test_plan import advise, rivals_of
from models.diagnosis.explanations.decide import judge
from models.diagnosis.explanations.posterior import posterior_of
from models.diagnosis.explanations.sizes import sizes_of
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.pooled_fit.baseline_fit import IndeterminateError, fit_baseline, missing_for_baseline
from models.diagnosis.raw_records.evidence import raw_evidence
from models.diagnosis.report.assemble import insufficient, report_of
from models.diagnosis.report.friction_law import friction_law_of
from models.diagnosis.report.isolability import isolability_of
from models.diagnosis.report.report import Report
from models.diagnosis.validation.extended_model import validate


def diagnose(
    campaign: Campaign,
    *,
    rng: np.random.Generator,
    without: frozenset[str] = frozenset(),
    isolability: bool = False,
) -> Report:
    """The report of a campaign: the baseline's model discrepancy, its likely causes, and the gain of an extended model.
    The same data, the same verdict: `rng` only makes the error of a gain and the sample of sizes, each from a stream of
    its own.

    Effects whose slugs are in `without` are taken out of the catalogue. `isolability`: also which causes this design could
    tell apart. What data lack is a verdict, `insufficient_data`; an
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
    of_gain, of_sizes, of_law = rng.spawn(3)
    raw = raw_evidence(campaign, without)
    posterior = posterior_of(baseline, raw, without)
    problem = posterior.problem
    judgement = judge(posterior)
    extended, gain = validate(problem, posterior.null.fit, judgement, of_gain)
    sizes = sizes_of(problem, judgement, of_sizes)
    if judgement.verdict is Verdict.CAUSE_NAMED and sizes.sign_is_open:  # it may do the opposite, or nothing
        judgement = replace(judgement, verdict=Verdict.CAUSE_AMBIGUOUS)
    advice = advise(campaign, problem, *rivals_of(judgement))
    law = friction_law_of(problem, judgement.stand[0].fit if judgement.stand else posterior.null.fit, of_law)
    report = report_of(baseline, posterior, judgement, raw, extended, gain, sizes, advice, law)
    return replace(report, isolability=isolability_of(campaign, posterior)) if isolability else report
