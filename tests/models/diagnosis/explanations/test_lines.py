"""What swings with a test's clock is found where noise goes with torque, noise alone is not; a sensor's waves too."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np
import pytest

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.law_form import LawSizes
from models.diagnosis.campaign import StationaryRun
from models.diagnosis.design.autocorrelation import Correlation
from models.diagnosis.design.design import SPEED, TORQUE, Design, Points, build_design
from models.diagnosis.explanations import contrasts
from models.diagnosis.explanations.contrasts import contrasts_of
from models.diagnosis.explanations.evidence import evidence_of, structure_gain, visible_contrasts
from models.diagnosis.explanations.posterior import posterior_of
from models.diagnosis.explanations.shapeless import highest_line
from models.diagnosis.explanations.verdict import LINE, Alternative
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.noise.estimate import first_noise
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline
from models.diagnosis.pooled_fit.problem import FitProblem, Priors
from models.diagnosis.pooled_fit.projection import gram_of, project
from models.friction.stribeck import torque
from tests.models.diagnosis import campaigns
from tests.models.diagnosis.campaigns import Study, Where, altered, campaign, study

#: A sensor's wave [Nm].
WAVE = 2.5
SEED = 7


@pytest.fixture(scope="module")
def design() -> Design:
    return build_design(campaign(1))


@pytest.fixture(scope="module")
def noise(design: Design) -> Noise:
    return replace(first_noise(design), plateaus=Correlation(), deviation=0.01 * design.torque)


def line_of(design: Design, noise: Noise, residual: FloatArray) -> float:
    """The highest line in a residual; no prior is in it."""
    return highest_line(FitProblem(design=design, noise=noise, priors=cast(Priors, None)), residual)


def raised(line: float) -> bool:
    """Rarer than one in a thousand."""
    return line < 1e-3


def drawn(design: Design, noise: Noise, seed: int) -> FloatArray:
    white = np.random.default_rng([SEED, seed]).standard_normal(design.torque.size)
    gains = 0.003 * np.random.default_rng([SEED, seed, 1]).standard_normal(len(design.runs))
    return noise.deviation * white + gains[design.rows.run] * design.torque


def test_noise_alone_has_no_line(design: Design, noise: Noise) -> None:
    found = [line_of(design, noise, drawn(design, noise, seed)) for seed in range(200)]
    assert not any(raised(each) for each in found)
    # p-values are bounds: no more of them are small than should be (10 of 200 below 0.05, deviation 3.1)
    assert 1 <= sum(each < 0.05 for each in found) <= 20


def test_a_line_that_is_nearly_as_slow_as_a_test_stands_out(design: Design, noise: Noise) -> None:
    """At the lower end of the frequencies its own flanks are no neighbourhood."""
    rows = design.rows
    longest = float(rows.clock[rows.steady].max())
    for cycles in (2.5, 2.8, 3.1):
        wave = np.sin(2 * np.pi * cycles * rows.clock / longest + rows.run) * rows.steady
        assert raised(line_of(design, noise, drawn(design, noise, 0) + 0.006 * wave * np.median(design.torque)))


@pytest.mark.parametrize("share", [False, True], ids=["so many Nm", "a share of the torque"])
def test_a_swing_is_found_whatever_its_phase_in_each_run(design: Design, noise: Noise, share: bool) -> None:
    rows = design.rows
    phase = np.random.default_rng(SEED).uniform(0, 2 * np.pi, len(design.runs))[rows.run]
    wave = np.sin(2 * np.pi * rows.clock / 90.0 + phase) * rows.steady
    swing = 0.005 * wave * (design.torque if share else np.median(design.torque))
    assert raised(line_of(design, noise, drawn(design, noise, 0) + swing))
    assert line_of(design, noise, drawn(design, noise, 0) + 0.02 * swing) > 0.01


#: Courses [n] over a test, 0 ... 1, that have no period, of about unit size.
COURSES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "ramp": lambda unit: 2.0 * unit - 1.0,
    "parabola": lambda unit: 6.0 * (unit - 0.5) ** 2 - 0.5,
    "settling": lambda unit: 3.0 * np.exp(-unit / 0.1) - 0.3,
    "step": lambda unit: np.where(unit > 0.4, 0.8, -1.2),
}


@pytest.mark.parametrize("kind", COURSES)
def test_structure_that_has_no_period_has_no_line(design: Design, noise: Noise, kind: str) -> None:
    """Of ten draws, with a course of its own in every run, as large as a line that is seen and three times as large."""
    rows = design.rows
    course = COURSES[kind](rows.clock / rows.clock[rows.steady].max()) * design.torque * rows.steady
    for seed in range(10):
        size = np.random.default_rng([SEED, seed]).standard_normal(len(design.runs))[rows.run]
        for strength in (0.015, 0.05):
            found = line_of(design, noise, drawn(design, noise, seed) + strength * size * course)
            assert not raised(found), (kind, seed, strength)


def test_pauses_and_odd_runs_do_not_hide_a_swing(design: Design, noise: Noise) -> None:
    rows = design.rows
    swing = 0.008 * design.torque * np.sin(2 * np.pi * rows.clock / 30.0 + rows.run) * rows.steady
    residual = drawn(design, noise, 0) + swing
    assert raised(line_of(design, noise, residual))
    paused = np.where((rows.run == 0) & (rows.clock > 300.0), rows.clock + 12 * 3600.0, rows.clock)
    slower = np.where(rows.run == 0, 4.0 * rows.clock, rows.clock)
    for clock in (paused, slower):
        assert raised(line_of(replace(design, rows=replace(rows, clock=clock)), noise, residual))
    standing = replace(design, rows=replace(rows, clock=np.zeros_like(rows.clock)))
    assert not raised(line_of(standing, noise, residual))


def test_gains_of_curves_one_after_the_other_are_no_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every pressure of every run has a gain of its own, at even times; a swing beside them stays one."""
    monkeypatch.setattr(campaigns, "PRESSURES", np.linspace(4e5, 7e5, 8))

    def with_gains(run: StationaryRun, dice: np.random.Generator, swing: float) -> dict[str, FloatArray]:
        at = run.plateaus
        clock = 5.0 * np.arange(at.torque.size)
        gains = np.repeat(1 + 0.0015 * dice.standard_normal(np.unique(at.pressure).size), np.unique(at.speed).size)
        swings = 1 + swing * np.sin(2 * np.pi * clock / 90.0 + run.cycles)
        return {"torque": at.torque * gains * swings}

    quiet = campaign(1, loops=False, noise=0.001)
    weights = []
    for swing in (0.0, 0.002):
        dice = np.random.default_rng(3)  # one draw of eight that looked like a line, by 91 nats
        given = altered(quiet, partial(with_gains, dice=dice, swing=swing))
        weights.append(posterior_of(fit_baseline(build_design(given)), ()).weights[Alternative((), LINE)])
    assert weights[0] < 0.0 < 10.0 < weights[1]


def test_too_few_plateaus_show_no_line() -> None:
    """Of one run the first 120 plateaus show the swing, the first 40 do not say so."""
    given = campaign(1)
    one = build_design(replace(given, stationary=given.stationary[:1], dynamic=()))
    known = replace(first_noise(one), deviation=0.01 * one.torque)
    swing = 0.03 * one.torque * np.sin(2 * np.pi * one.rows.clock / 30.0)
    assert raised(line_of(one, known, swing))
    assert not raised(line_of(replace(one, plateaus=40, chains=one.chains), known, swing))


def test_a_sensor_that_is_wavy_over_its_range_is_structure_on_its_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    def waves(at: Where) -> FloatArray:
        return np.asarray(0.1 * np.sin(2 * np.pi * torque(at.velocity, at.parameters) / WAVE), dtype=np.float64)

    given = study(campaign(3, waves))
    found = {}
    for most in (20, 4):
        monkeypatch.setattr(contrasts, "TORQUE_WAVES", most)
        found[most] = evidence_of(given.problem, given.baseline.fit).structure[TORQUE]
    assert found[20] > 20.0
    assert found[4] < 0.2 * found[20], found  # the control: few waves hardly show it


# --- Structure that nobody wrote down is seen by some smooth contrast, wherever in the speeds it lies.

#: Where bands of speed lie, as shares of the highest: the worst of them counts.
PLACES, WIDE = np.linspace(0.25, 0.75, 21), 0.05


@pytest.fixture(scope="module")
def plain() -> Study:
    return study(campaign(4))


def off(rows: Points, at: float) -> FloatArray:
    return np.asarray((rows.velocity / rows.velocity.max() - at) / WIDE, dtype=np.float64)


def bump(rows: Points, at: float) -> FloatArray:
    return np.asarray(np.exp(-0.5 * off(rows, at) ** 2), dtype=np.float64)


def resonance(rows: Points, at: float) -> FloatArray:
    return np.asarray(off(rows, at) / (1 + off(rows, at) ** 2), dtype=np.float64)


def slowing(rows: Points, at: float) -> FloatArray:
    return np.asarray((rows.acceleration < 0) * np.exp(-(off(rows, at) ** 4)), dtype=np.float64)


def information(given: Study, *columns: FloatArray) -> FloatArray:
    """What is left of columns beside the baseline, in products of each with each."""
    gram = gram_of(given.problem, given.baseline.fit, np.column_stack(columns))
    return project(gram, given.problem.noise.run_gain, 0.0).info


def best_shares(given: Study, structures: FloatArray) -> FloatArray:
    """Of λ that is left of each structure, what the best single contrast sees."""
    info = information(given, structures, contrasts_of(given.design, given.baseline.fit.prediction)[0])
    scale = np.sqrt(np.maximum(np.diag(info), 1e-300))
    count = structures.shape[1]
    return ((info / scale[:, None] / scale)[:count, count:] ** 2).max(axis=1)


@pytest.mark.parametrize(("shape", "least"), [(bump, 0.6), (resonance, 0.55), (slowing, 0.45)])
def test_a_contrast_sees_its_share_of_what_is_visible_wherever_it_lies(
    plain: Study, shape: Callable[[Points, float], FloatArray], least: float
) -> None:
    structures = np.stack([shape(plain.design.rows, at) for at in PLACES], axis=1)
    assert best_shares(plain, structures * plain.baseline.fit.torque[:, None]).min() > least


@pytest.mark.parametrize("waves", [5.3, 8.4, 13.7])
def test_ripples_over_speed_are_seen_through_the_lag_of_loops(plain: Study, waves: float) -> None:
    """Half waves over the range of speeds, in between those that are looked for, and of any phase."""
    points, prediction = plain.design.points, plain.baseline.fit.prediction
    unit = points.velocity / points.velocity.max()
    ripples = np.stack([np.cos(np.pi * waves * unit + phase) for phase in (0.0, 0.8, 1.6, 2.4)], axis=1)
    friction = prediction.scene.curve[:, None] * ripples
    assert best_shares(plain, prediction.change_at_rows(plain.design, friction, before_lag=True)).min() > 0.45


@pytest.mark.parametrize(
    "form",
    [lambda v: np.exp(-(v**0.6)), lambda v: np.exp(-(v**1.5)), lambda v: 1 - np.tanh(v), lambda v: 1 / (1 + v * v)],
    ids=["stretched", "compressed", "tanh", "rational"],
)
def test_a_curve_of_another_form_is_the_laws_and_no_structure(plain, form):
    """That falls within a tenth of the range, with the loops' lag; λ = 50 of it is left beside eq. 3 alone."""
    points, prediction, problem = plain.design.points, plain.baseline.fit.prediction, plain.problem
    friction = prediction.scene.curve * form(points.velocity / (0.1 * points.velocity.max()))
    structure = prediction.change_at_rows(plain.design, friction[:, None], before_lag=True)[:, 0]
    structure *= np.sqrt(2 * 50.0 / information(plain, structure)[0, 0])
    fitted = replace(plain.baseline.fit, residual=structure)  # and nothing else is left
    contrasts_seen, axes = visible_contrasts(problem, fitted)
    speeds = np.flatnonzero(np.array(axes) == SPEED)
    reduced = gram_of(problem, fitted, contrasts_seen).reduced(problem.noise.run_gain, 0.0)
    exact, *others = (reduced.beside_law(LawSizes(size, 0.0, 0.0)) for size in criteria.FORM_SIZES)
    law = max(others, key=lambda one: one.evidence)
    assert law.evidence > exact.evidence + 15.0
    assert structure_gain(law.info[np.ix_(speeds, speeds)], law.score[speeds]) < 1.0
