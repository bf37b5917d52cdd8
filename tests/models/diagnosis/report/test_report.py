"""What the report makes of a judgement: it repeats the verdict, and says why an extension is withheld."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.fitted_effect import AmplitudeEstimate, Draw
from models.diagnosis.explanations.decide import judge
from models.diagnosis.explanations.posterior import Posterior, posterior_of
from models.diagnosis.explanations.sizes import Size, Sizes, sizes_of
from models.diagnosis.explanations.verdict import Judgement, Verdict
from models.diagnosis.pooled_fit.gauss_newton import FitStatus, PooledFit
from models.diagnosis.pooled_fit.projection import left_over, without_likely_gains
from models.diagnosis.raw_records.evidence import RawEvidence
from models.diagnosis.report.assemble import ADOPT_NOTHING, candidates_of, reason_against, report_of
from models.diagnosis.report.maps import MOST_BINS, SHOWN, loop_traces, residual_maps
from models.diagnosis.report.report import Report, misfit_of
from models.diagnosis.report.summary import stated
from models.diagnosis.validation.held_out import Gain
from tests.models.diagnosis.campaigns import CYCLES, PRESSURES, SPEEDS, Study, bump, campaign, look, study
from tests.models.diagnosis.report.test_summary import GAIN
from tests.models.diagnosis.test_diagnose import late

WORSE = replace(GAIN, log_score_gain=-1.0)
LARGER = replace(GAIN, rmse_after=1.1 * GAIN.rmse_before)


@pytest.fixture(scope="module")
def given() -> Study:
    return study(campaign(4, late, cycles=(0.0, 1500.0, 3000.0, 4500.0), loops=False, both_ways=True))


@pytest.fixture(scope="module")
def posterior(given: Study) -> Posterior:
    return posterior_of(given.baseline, ())


def reported(
    given: Study,
    posterior: Posterior,
    judgement: Judgement,
    extended: PooledFit | None = None,
    gain: Gain | None = None,
    sizes: Sizes | None = None,
) -> Report:
    known = sizes or Sizes(by_slug={})
    return report_of(given.baseline, posterior, judgement, (), extended, gain, known, (), None)


@pytest.mark.parametrize(
    ("gain", "why"),
    [
        (GAIN, ""),
        (None, ""),
        (WORSE, "predicts other runs no better"),
        (LARGER, "predicts other runs no better"),
    ],
)
def test_an_extension_that_predicts_worse_is_withheld_and_the_verdict_stays(given, posterior, gain, why):
    judgement = judge(posterior)
    assert (judgement.verdict, judgement.causes) == (Verdict.CAUSE_NAMED, ("unsettled_dwell",))
    sizes = sizes_of(posterior.problem, judgement, np.random.default_rng(1))
    report = reported(given, posterior, judgement, judgement.stand[0].fit, gain, sizes)
    assert (report.verdict, report.causes) == (judgement.verdict, judgement.causes)
    assert (report.extension is None) == bool(why)
    assert why in report.not_adoptable
    assert "nats" not in report.not_adoptable
    assert report.statistics["log_evidence"] == pytest.approx(report.candidates[0].log_evidence_gain)
    assert sum(each.probability for each in report.explanations) == pytest.approx(1.0)


def test_what_no_reading_shows_is_no_candidate_and_a_fit_that_ran_out_of_steps_is_said(
    given: Study, posterior: Posterior
) -> None:
    report = reported(given, posterior, judge(posterior))
    loops_only = {"channel_delay", "inertia_torque", "squeeze_film"}
    assert not loops_only & {each.effect for each in report.candidates}
    assert not loops_only & {slug for each in report.explanations for slug in each.effects}
    # a fit that ran out of steps is said with what follows from it
    judgement = judge(posterior)
    (cause,) = judgement.stand
    cut = replace(cause, fit=replace(cause.fit, status=FitStatus.OUT_OF_STEPS))
    expected = (
        "convergence: the fit with unsettled dwell ended before its optimum; its probability may be larger than stated."
    )
    assert expected in reported(given, posterior, replace(judgement, stand=(cut,))).notes
    assert expected not in reported(given, posterior, judgement).notes


def test_why_an_extension_is_not_proposed_is_said(given: Study) -> None:
    named = Verdict.CAUSE_NAMED
    assert reason_against(named, LARGER, Sizes(by_slug={})) == ""  # nothing was fitted
    sure = Size(value=2e4, sd=1e4, interval=(1e4, 4e4), other_sign=0.001)
    some = Sizes(draws=(Draw(weight=1.0, laws=given.baseline.fit.laws),), by_slug={"pressure_offset": sure})
    assert reason_against(named, GAIN, some) == ""
    # while causes are open there is nothing to adopt, however sure the sizes are
    assert reason_against(Verdict.CAUSE_AMBIGUOUS, GAIN, some) == ADOPT_NOTHING
    open_sign = replace(some, by_slug={"pressure_offset": replace(sure, other_sign=0.03)})
    assert (some.sign_is_open, open_sign.sign_is_open) == (False, True)


# --- Which causes a campaign could tell apart, from its design alone.


@pytest.mark.slow
def test_sweeps_without_a_thermometer_tell_some_causes_apart() -> None:
    sweeps = look(campaign(3, loops=False, temperature=False), 0, isolability=True).isolability
    # a drag and a shifted zero are parted by an open clutch
    (pair,) = [pair for pair in sweeps.pairs if set(pair.effects) == {"hydrodynamic_drag", "torque_zero_shift"}]
    assert not pair.apart
    assert "the clutch open" in pair.test
    assert pair.with_trial > 0.9 > pair.probability
    # what these tests cannot show is said
    assert {"oil_temperature", "channel_delay", "inertia_torque", "squeeze_film"} <= set(sweeps.unseen)
    shown = {slug for pair in sweeps.pairs for slug in pair.effects}
    assert not shown & set(sweeps.unseen)
    assert not {"shaft_ripple", "stick_slip"} & (shown | set(sweeps.unseen))
    # pairs come hardest first, and only those get a test
    chances = [pair.probability for pair in sweeps.pairs]
    assert chances == sorted(chances)
    for pair in sweeps.pairs:
        assert pair.with_trial >= pair.probability
        assert pair.apart == (pair.probability >= 0.9) == (pair.test == "" and pair.with_trial == pair.probability)


def test_the_size_of_a_swing_has_no_sign(given: Study) -> None:
    estimate = AmplitudeEstimate(name="ripple amplitude", value=0.5, sd=0.02, unit="Nm", one_sided=True)
    raw = (RawEvidence(effect="shaft_ripple", log_evidence=50.0, estimate=estimate, note="it swings"),)
    found = posterior_of(given.baseline, raw)
    (ripple,) = (
        c for c in candidates_of(found.problem, judge(found), raw, {}, found.isolability) if c.effect == "shaft_ripple"
    )
    assert stated(ripple.estimate, "shaft_ripple").endswith("an amplitude of 0.5 Nm (90 % interval 0.467 to 0.533 Nm).")


# --- Residual maps against means taken row by row, NaN where nothing was measured, loops as they were measured.


@pytest.fixture(scope="module")
def bumped() -> Study:
    return study(campaign(31, bump))


def test_cells_are_means_of_residual_over_noise_and_the_bump_shows_where_it_is(bumped) -> None:
    """Before of eq. 3 taken for exact, after beside the law."""
    found = residual_maps(bumped.baseline, bumped.problem, bumped.baseline.fit)
    assert np.allclose(found.pressure, PRESSURES)
    assert np.allclose(found.speed, SPEEDS)
    assert np.array_equal(found.cycles, CYCLES)
    design, noise = bumped.design, bumped.problem.noise
    before = without_likely_gains(bumped.problem.exact, bumped.baseline.exact)
    after = left_over(bumped.problem, bumped.baseline.fit)
    white, beside = ((left / noise.deviation)[: design.plateaus] for left in (before, after))
    rows = design.rows.take(design.rows.steady)
    for p in (0, 3):
        here = np.abs(rows.pressure - PRESSURES[p]) < 1
        for s in (1, 12):
            cell = here & (np.abs(rows.velocity / 0.058 - SPEEDS[s]) < 1e-6)
            assert np.count_nonzero(cell) == len(CYCLES)
            assert found.speed_pressure_before[p, s] == pytest.approx(white[cell].mean())
            assert found.speed_pressure_after[p, s] == pytest.approx(beside[cell].mean())
        for c in (0, 4):
            cell = here & (rows.cycles == CYCLES[c])
            assert found.pressure_cycles_before[c, p] == pytest.approx(white[cell].mean())
            assert found.pressure_cycles_after[c, p] == pytest.approx(beside[cell].mean())
    # the bump shows where it is
    by_speed = found.speed_pressure_before.mean(axis=0)
    velocity = found.speed * 0.058
    assert abs(velocity[int(by_speed.argmax())] - 3.0) < 1.0
    assert by_speed.max() > 1
    # and the law takes most of it
    assert np.abs(found.speed_pressure_after.mean(axis=0)).max() < 0.5 * by_speed.max()
    # the control: over cycles nothing stands out
    assert np.abs(found.pressure_cycles_before.mean(axis=1)).max() < 0.5 * by_speed.max()


def test_what_maps_and_loops_show_is_the_error_that_the_report_states(bumped: Study) -> None:
    """Runs that are off by gains of their own are shown without them."""
    design, off = bumped.design, 1.0 + 0.15 * (1.0 + bumped.design.rows.run % 2)
    noise = replace(bumped.problem.noise, run_gain=0.02)
    problem = replace(bumped.problem, design=replace(design, torque=off * design.torque), noise=noise)

    def against_these(fit: PooledFit) -> PooledFit:
        return replace(fit, residual=problem.design.torque - fit.torque)

    known = bumped.baseline
    known = replace(known, problem=problem, exact=against_these(known.exact), fit=against_these(known.fit))
    found, loops = residual_maps(known, problem, known.fit), loop_traces(known, problem, known.fit)
    exact, law = misfit_of(problem.exact, known.exact).rmse, misfit_of(problem, known.fit).rmse
    assert law < exact < 0.5
    assert np.nanmean(np.abs(found.speed_pressure_after)) < np.nanmean(np.abs(found.speed_pressure_before)) < 2
    assert loops
    for loop in loops:
        for model in (loop.baseline, loop.extended):
            assert np.sqrt(np.mean((loop.measured - model) ** 2)) < 0.5


def test_nothing_measured_is_not_a_number():
    given = campaign(31, bump, loops=False)
    table = given.stationary[0].plateaus
    keep = (table.pressure < 6.9e5) | (table.speed * 0.058 < 5)
    runs = [replace(run, plateaus=run.plateaus.take(keep)) for run in given.stationary]
    thinned = study(replace(given, stationary=tuple(runs)))
    found = residual_maps(thinned.baseline, thinned.problem, thinned.baseline.fit)
    missing = np.isnan(found.speed_pressure_before)
    assert missing.any()
    assert missing[:-1].sum() == 0
    assert np.array_equal(missing[-1], found.speed * 0.058 > 5)
    assert loop_traces(thinned.baseline, thinned.problem, thinned.baseline.fit) == ()


def test_many_speeds_and_states_are_gathered(bumped):
    rng = np.random.default_rng(1)
    many = replace(
        bumped.design, rows=replace(bumped.design.rows, velocity=rng.uniform(0.1, 12, bumped.design.torque.size))
    )
    problem = replace(bumped.problem, design=many)
    found = residual_maps(replace(bumped.baseline, problem=problem), problem, bumped.baseline.fit)
    assert found.speed.size == MOST_BINS
    assert found.speed_pressure_before.shape == (PRESSURES.size, MOST_BINS)
    assert np.all(np.diff(found.speed) > 0)


def test_loops_are_shown_as_measured_and_as_models_have_them(bumped):
    shape = BY_SLUG["squeeze_film"].grid(bumped.design.facts)[0].shape
    extended = bumped.extended(("squeeze_film", 1e-3, shape))
    found = loop_traces(bumped.baseline, bumped.problem, extended)
    assert len(found) == SHOWN**2
    assert {each.cycles for each in found} == {CYCLES[0], CYCLES[-1], CYCLES[len(CYCLES) // 2]} or len(found) == 9
    for each in found:
        assert each.frequency == pytest.approx(0.1, rel=1e-2)
        assert each.speed.min() >= -1
        assert each.measured.shape == each.baseline.shape == each.extended.shape == each.speed.shape
        # a loop's torque, and no other's
        assert np.abs(each.measured - each.baseline).max() < 0.15 * each.measured.max()
    assert any(not np.allclose(each.baseline, each.extended) for each in found)
    # the control: where the law is exact and nothing extends it both models are one
    exact = bumped.problem.exact
    assert all(
        np.array_equal(t.baseline, t.extended) for t in loop_traces(bumped.baseline, exact, bumped.baseline.exact)
    )
