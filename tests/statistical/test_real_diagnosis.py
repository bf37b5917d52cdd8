"""Real sweeps of a contact that is no clutch: the diagnosis says that something is there, and names nothing."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.campaign import Campaign
from models.diagnosis.design.design import build_design
from models.diagnosis.diagnose import diagnose
from models.diagnosis.effects.catalogue import columns_at_rows, columns_of, effects_for
from models.diagnosis.explanations.evidence import coarse_projections
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline
from models.diagnosis.pooled_fit.projection import gram_of
from tests.lab.real import diagnosis, loaders

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not loaders.FOLDER.is_dir(), reason=f"the measurements are not at {loaders.FOLDER}"),
]


@pytest.mark.parametrize("count", diagnosis.CAMPAIGNS)
def test_traction_sweeps_get_no_name(count: int) -> None:
    report = diagnosis.report_of(count)
    assert report.verdict is Verdict.UNEXPLAINED_STRUCTURE
    assert report.causes == ()
    assert report.extension is None


def planted(campaign: Campaign, loudness: float) -> dict[str, Campaign]:
    """By effect that these sweeps can show the campaign with it, so loud [nats] about the baseline's fit."""
    baseline = fit_baseline(build_design(campaign))
    design = baseline.problem.design
    columns = columns_of(effects_for(design.facts), design.facts)
    changes = columns_at_rows(design, baseline.fit.prediction, columns)
    projections = coarse_projections(gram_of(baseline.problem, baseline.fit, changes), baseline.problem.noise)
    info = np.diag(max(projections, key=lambda each: each.evidence).info)
    shown = {column.effect.slug: k for k, column in enumerate(columns) if changes[:, k].any()}
    return {
        slug: _with_change(campaign, design.rows.run, np.sqrt(2 * loudness / info[k]) * changes[:, k])
        for slug, k in shown.items()
    }


def _with_change(campaign: Campaign, owner: np.ndarray, change: np.ndarray) -> Campaign:
    runs = [
        replace(run, plateaus=replace(run.plateaus, torque=run.plateaus.torque + change[owner == k]))
        for k, run in enumerate(campaign.stationary)
    ]
    return replace(campaign, stationary=tuple(runs))


@pytest.mark.parametrize("loudness", [50.0, 20_000.0])
def test_an_effect_planted_in_traction_sweeps_gets_no_other_name(loudness: float) -> None:
    campaigns = planted(diagnosis.traction_campaign(20), loudness)
    assert len(campaigns) > 8
    reports = {slug: diagnose(campaign, rng=np.random.default_rng(1)) for slug, campaign in campaigns.items()}
    wrong = {slug: r.causes for slug, r in reports.items() if r.verdict is Verdict.CAUSE_NAMED and r.causes != (slug,)}
    assert wrong == {}
