"""A fit leaves no gain to the runs that they all share, however much gains may scatter."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.baseline.prediction import frame_of
from models.diagnosis.design.design import build_design
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.effects.thermal import AT_ONCE
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline, starting_laws
from models.diagnosis.pooled_fit.gauss_newton import fit
from tests.models.diagnosis.rehearsals import rehearsal


@pytest.mark.slow
def test_an_extended_model_is_not_off_all_runs_by_one_share() -> None:
    """It was 14 % below all of them, at a scatter of the gains of 2 %: held-out runs were off by 2.4 Nm."""
    baseline = fit_baseline(build_design(rehearsal(3, {"oil_temperature": 1.0}, tests=8, noise=0.01)))
    problem = baseline.problem.with_noise(replace(baseline.problem.noise, run_gain=0.02))
    start = starting_laws(problem.design, frame_of(problem.design))
    hersey = FittedEffect(effect=BY_SLUG["oil_temperature"], amplitude=0.1, shape=(-1.0, AT_ONCE))
    found = fit(problem, start, [hersey], steps=40)
    assert abs(np.mean(found.residual / found.torque)) < 0.01
    # the control: where gains multiply what was measured, they take a share of everything
    biased = fit(replace(problem, fitted=None), start, [hersey], steps=40)
    assert np.mean(biased.residual / biased.torque) > 0.05
