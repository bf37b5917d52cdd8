"""An outlying run is named; an effect that all runs show makes none of them an outlier."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.campaign import Campaign, StationaryRun
from models.diagnosis.design.design import build_design
from models.diagnosis.diagnose import diagnose
from models.diagnosis.explanations.shapeless import outlying_run
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.test_diagnose import warm


def other(given: Campaign, place: int, run: StationaryRun) -> Campaign:
    """With one stationary run changed."""
    runs = list(given.stationary)
    runs[place] = run
    return replace(given, stationary=tuple(sorted(runs, key=lambda each: each.cycles)))


def reversed_torque(run: StationaryRun) -> StationaryRun:
    return replace(run, plateaus=replace(run.plateaus, torque=-run.plateaus.torque))


def too_low(run: StationaryRun) -> StationaryRun:
    """Another clutch: a third less at low speed than at high speed."""
    fastest = run.plateaus.speed.max()
    return replace(
        run, plateaus=replace(run.plateaus, torque=run.plateaus.torque * (2 + run.plateaus.speed / fastest) / 3)
    )


@pytest.mark.parametrize(("changed", "place"), [(reversed_torque, 2), pytest.param(too_low, 4, marks=pytest.mark.slow)])
def test_a_run_that_is_not_like_the_others_is_named(changed, place: int) -> None:
    given = campaign(2, loops=False, cycles=(0.0, 1000.0, 3000.0, 6000.0, 10000.0, 15000.0, 21000.0))
    report = diagnose(other(given, place, changed(given.stationary[place])), rng=np.random.default_rng(1))
    assert report.verdict in {Verdict.UNEXPLAINED_STRUCTURE, Verdict.CAUSE_AMBIGUOUS}
    assert f"The run {given.stationary[place].run_id} at" in report.summary


@pytest.mark.parametrize("planted", [None, warm])
def test_no_run_is_odd_where_all_are_alike(planted) -> None:
    design = build_design(campaign(2, planted, loops=False))
    known = fit_baseline(design)
    assert outlying_run(known.problem, known.fit) == ""
