"""The rig that hides: independent of the catalogue, its lag, noise and loudness right by other ways of computing them."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.stats import chi2

from tests.lab.blind.rig.hide import Hidden, hide
from tests.lab.blind.rig.loudness import UnreachableError, listen
from tests.lab.blind.rig.makers import ALL, CATALOGUED, OUTSIDE
from tests.lab.blind.rig.more import ADVISED, TOGETHER, drag_of, with_test
from tests.lab.blind.rig.plan import RADIUS, RPM
from tests.lab.blind.rig.refit import LEAST_GAIN, spreads, theta_at
from tests.lab.blind.rig.sensor import Whitening
from tests.lab.blind.rig.sent import campaign, runs
from tests.lab.blind.rig.world import Effect, follow, read
from tests.support import one_quick

FOLDER = Path(__file__).parent
#: What the blind tests may take from the product: how data goes in, how reports come out, the one function under test.
ALLOWED = {
    "models.arrays",
    "models.diagnosis",
    "models.diagnosis.campaign",
    "models.diagnosis.diagnose",
    "models.diagnosis.report.report",
    "models.diagnosis.validation.held_out",
    "models.records.plateaus",
    "models.records.runs",
}
#: Loops say nothing of them that plateaus do not, and make the refits long.
STEADY = {"running_in", "accelerated_wear", "pressure_offset", "torque_zero_shift", "interface_heating", "seasons"}
CONTRACT = {
    "oil_temperature", "interface_heating", "hydrodynamic_drag", "torque_zero_shift",
    "pressure_offset", "unsettled_dwell", "channel_delay", "inertia_torque", "squeeze_film", "shaft_ripple",
    "stick_slip", "running_in", "oil_change", "accelerated_wear", "load_severity", "rest_recovery",
}  # fmt: skip


#: What a diagnosis is made of: numbers are taken for others between its chapters.
CHAPTERS = {
    "models.diagnosis.criteria",
    "models.diagnosis.design.design",
    "models.diagnosis.explanations.decide",
    "models.diagnosis.explanations.posterior",
    "models.diagnosis.pooled_fit.baseline_fit",
    "models.diagnosis.raw_records",
    "models.diagnosis.raw_records.evidence",
}


def imported(source: str) -> set[str]:
    """Modules of the product that a source imports, names taken from a package included."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            package = node.module in {"models", "models.diagnosis"}
            found |= {f"{node.module}.{alias.name}" if package else node.module for alias in node.names}
    return {name for name in found if name.split(".")[0] in {"models", "service", "storage"}}


def test_nothing_of_the_catalogue_is_imported() -> None:
    sources = [path for path in FOLDER.rglob("*.py") if not path.name.startswith("test_")]
    assert len(sources) > 10
    for path in sources:
        assert imported(path.read_text()) <= ALLOWED | (CHAPTERS if path.name == "ablations.py" else set()), path
    assert not imported("from models.diagnosis.effects.oil import X\nfrom models.diagnosis import baseline") <= ALLOWED


def test_what_makes_a_life_for_adoption_knows_nothing_of_the_catalogue() -> None:
    made = (FOLDER.parent / "adoption" / "trials.py").read_text(encoding="utf-8")
    assert not [name for name in imported(made) if "effects" in name or "explanations" in name]


def test_all_of_the_contract_can_be_hidden_and_more() -> None:
    assert set(CATALOGUED) == CONTRACT
    assert len(OUTSIDE) >= 6
    assert not set(OUTSIDE) & CONTRACT


def test_the_same_seed_hides_the_same() -> None:
    one, again, other = (runs(hide((4, k), ("oil_change",), 20.0, loops=False)) for k in (1, 1, 2))
    assert one == again
    assert one != other


def test_the_lag_is_that_of_a_stiff_integrator() -> None:
    hidden = hide((4, 3))
    site = next(site for site in hidden.plan.sites if site.kind == "loop")
    law = hidden.clutch.law(site.bar, site.cycles)
    curve, attractor = law.torque(site.v), hidden.clutch.attractor(site.bar, site.cycles)
    lagged = follow(site, curve, attractor)[0]
    time = site.clock[0] - site.clock[0, 0]
    s = lambda t: float(np.interp(t, time, curve[0]))  # noqa: E731
    c = float(attractor[0, 0])
    found = solve_ivp(
        lambda t, m: c * (1 - m / s(t)), (0, time[-1]), [curve[0, 0]], t_eval=time, max_step=0.01, rtol=1e-8
    )
    np.testing.assert_allclose(lagged, found.y[0], rtol=2e-4)
    assert np.abs(lagged - curve[0]).max() > 0.01  # it does lag


@pytest.mark.parametrize("seed", range(4))
def test_the_noise_is_what_the_sensor_says(seed: int) -> None:
    hidden = hide((6, seed))
    truth = read(hidden.plan, hidden.clutch)
    error = [m - t for m, t in zip(hidden.measured, truth, strict=True)]
    white = Whitening(hidden.plan, hidden.sensor, truth)(error)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], white.size)
    assert low < white @ white < high + 0.01 * white.size  # rounding adds a little
    assert abs(white[1:] @ white[:-1]) / white.size < 5 / np.sqrt(white.size)


@pytest.mark.slow
@pytest.mark.parametrize("slug", sorted(ALL))
def test_an_effect_of_no_size_is_none_and_a_louder_one_is_larger(slug: str) -> None:
    hidden = hide((8, 1), (slug,), 20.0, loops=slug not in STEADY)
    effect, amplitude = hidden.effects[0]
    ear = listen(hidden.plan, hidden.clutch, hidden.sensor)
    for none, torque in zip(read(hidden.plan, hidden.clutch, [(effect, 1e-9)]), ear.base, strict=True):
        np.testing.assert_allclose(none, torque, atol=1e-5)
    assert ear.loudness(effect, amplitude) == pytest.approx(
        20.0, rel=0.06
    )  # the search ends within 3 % of it, a refit within 2 %
    assert ear.loudness(effect, 1.5 * amplitude) > 25.0


def test_means_over_samples_are_as_loud_as_the_samples() -> None:
    hidden = hide((8, 2), ("interface_heating",), 20.0, states=3)
    fine = listen(hidden.plan, hidden.clutch, replace(hidden.sensor, sample_memory=0.4), count=1)
    thin = listen(hidden.plan, hidden.clutch, replace(hidden.sensor, sample_memory=0.4), count=5)
    for amplitude in (0.002, 0.01):
        one, other = (ear.loudness(hidden.effects[0][0], amplitude) for ear in (fine, thin))
        assert other == pytest.approx(one, rel=0.03)


def test_loudness_is_the_likelihood_ratio_left_after_a_refit() -> None:
    """λ of a small effect against generalised least squares on the dense covariance, on stationary tests alone."""
    hidden = hide((5, 2), ("rest_recovery",), 30.0, loops=False)
    plan, clutch, sensor = hidden.plan, hidden.clutch, hidden.sensor
    ear = listen(plan, clutch, sensor)
    site, base = plan.sites[0], ear.base[0]
    delta = (read(plan, clutch, hidden.effects)[0] - base).ravel()
    rows = np.arange(base.shape[1])
    inverse = np.zeros((base.size, base.size))
    for k in range(base.shape[0]):
        sigma = sensor.sigma(site, base[k])
        covariance = np.outer(sigma, sigma) * sensor.rho(site) ** np.abs(rows[:, None] - rows)
        covariance += max(sensor.gain, LEAST_GAIN) ** 2 * np.outer(base[k], base[k])
        block = slice(k * rows.size, (k + 1) * rows.size)
        inverse[block, block] = np.linalg.inv(covariance)
    jacobian, prior = [], []
    for i in range(clutch.theta.size - plan.pressures.size - 1):  # the attractor does not act on plateaus
        up, down = (read(plan, clutch.nudged(i, h))[0].ravel() for h in (1e-4, -1e-4))
        jacobian.append((up - down) / 2e-4)
        prior.append(spreads(clutch)[i] ** -2.0)
    j = np.stack(jacobian, axis=1)
    b = j.T @ inverse @ delta
    left = delta @ inverse @ delta - b @ np.linalg.solve(j.T @ inverse @ j + np.diag(prior), b)
    assert ear.linear(*hidden.effects[0]) == pytest.approx(0.5 * left, rel=0.01)
    assert ear.loudness(*hidden.effects[0]) == pytest.approx(0.5 * left, rel=0.05)
    assert 0.5 * left == pytest.approx(30.0, rel=0.07)
    assert 0.5 * delta @ inverse @ delta > 1.1 * 0.5 * left  # the refit does take some of it


@pytest.mark.slow
@pytest.mark.parametrize(
    ("slug", "amplitude"), [("running_in", 0.1), ("accelerated_wear", 0.6), ("pressure_offset", 1.0)]
)
def test_a_refit_leaves_what_a_general_solver_leaves(slug: str, amplitude: float) -> None:
    """λ against scipy's least squares in the clutch's own parameters, from the truth and from beside it."""
    hidden = hide((5, 8), (slug,), 20.0, loops=False, states=5)
    ear, clutch = listen(hidden.plan, hidden.clutch, hidden.sensor), hidden.clutch
    effect, spread = hidden.effects[0][0], spreads(clutch)
    whitened = Whitening(hidden.plan, replace(hidden.sensor, gain=max(hidden.sensor.gain, LEAST_GAIN)), ear.base)
    changed = read(hidden.plan, clutch, [(effect, amplitude)])
    count = clutch.theta.size - clutch.pressures.size - 1

    def missed(x: np.ndarray) -> np.ndarray:
        theta = np.concatenate([x, clutch.theta[count:]])
        readings = read(hidden.plan, replace(clutch, theta=theta))
        difference = [one - other for one, other in zip(readings, changed, strict=True)]
        return np.concatenate([whitened(difference), ((theta - clutch.theta) / spread)[:count]])

    nothing = 0.5 * float(np.square(missed(clutch.theta[:count])).sum())
    rng, found = np.random.default_rng(3), []
    for share in (0.0, 0.2):
        start = clutch.theta[:count] + share * np.where(spread < 2, spread, 0)[:count] * rng.standard_normal(count)
        found.append(least_squares(missed, start, x_scale="jac", max_nfev=100).cost)
    ended = theta_at(ear.refitted(effect, amplitude).at, clutch.span)
    found.append(least_squares(missed, ended[:count], x_scale="jac", max_nfev=100).cost)
    loud = ear.loudness(effect, amplitude)
    assert loud == pytest.approx(min(found), rel=0.05)
    assert loud < 0.5 * nothing  # the baseline does take it up
    assert abs(ear.linear(effect, 0.02 * amplitude) / ear.loudness(effect, 0.02 * amplitude) - 1) < 0.1
    nonlinear = abs(ear.linear(effect, amplitude) / loud - 1)
    assert (nonlinear > 0.3) == (slug != "pressure_offset")  # where it matters, the linear prediction is far off


def test_what_cannot_be_loud_says_so() -> None:
    hidden = hide((5, 2))
    ear = listen(hidden.plan, hidden.clutch, hidden.sensor)
    whisper = Effect("whisper", 1e-6, 1e-5, reading=lambda a, _, torque: a + 0 * torque)
    with pytest.raises(UnreachableError, match="whisper"):
        ear.amplitude_for(whisper, 50.0)


def test_an_effect_acts_at_its_own_sites_alone() -> None:
    hidden = hide((5, 4), states=4)
    base, rng = read(hidden.plan, hidden.clutch), np.random.default_rng(1)
    moving = {"channel_delay", "inertia_torque", "squeeze_film", "shaft_ripple", "stick_slip", "braking"}
    resting = {"unsettled_dwell", "clock_wobble", "pressure_way"}
    for slug in moving | resting:
        effect = ALL[slug][0](rng, hidden.plan)
        changed = read(hidden.plan, hidden.clutch, [(effect, effect.unit)])
        triples = zip(hidden.plan.sites, changed, base, strict=True)
        where = {site.kind for site, one, none in triples if not np.array_equal(one, none)}
        assert where == ({"loop"} if slug in moving else {"stationary"}), slug


def test_the_campaign_holds_what_the_runs_say() -> None:
    hidden = hide((5, 4), ("load_severity",), 20.0, oil=True)
    sent, seen = runs(hidden), campaign(hidden)
    first = next(run for run in sent if run["kind"] == "stationary_stribeck")
    np.testing.assert_allclose(seen.stationary[0].plateaus.pressure, 1e5 * np.array(first["channels"]["pressure_bar"]))
    np.testing.assert_allclose(
        seen.stationary[0].plateaus.speed * RADIUS, np.array(first["channels"]["speed_rpm"]) * RPM * RADIUS
    )
    oil = np.array(first["channels"]["oil_temperature_c"])
    np.testing.assert_allclose(seen.stationary[0].plateaus.oil_temperature, 273.15 + oil)
    assert not hide(
        (5, 4), ("oil_temperature",), 20.0, oil=False, loops=False
    ).plan.tells_oil  # what is wanted comes first
    assert [run.cycles for run in seen.stationary] == sorted(run.cycles for run in seen.stationary)
    assert len(seen.duty) == len(seen.stationary) - 1
    assert all(block.energy is not None and block.energy > 1e3 for block in seen.duty)
    assert {run["cycles"] for run in sent if run["kind"] == "dynamic_stribeck"} == {run.cycles for run in seen.dynamic}


@pytest.fixture(scope="module")
def shifted() -> Hidden:
    return hide((5, 6), ("torque_zero_shift",), 20.0, states=4)


@pytest.mark.parametrize("key", sorted({*ADVISED, *TOGETHER}))
def test_an_advised_test_is_made_with_the_same_secret(shifted: Hidden, key: str) -> None:
    before, after = campaign(shifted), campaign(with_test(shifted, key))
    old = {run.run_id for run in (*before.stationary, *before.dynamic)}
    new = [run for run in (*after.stationary, *after.dynamic) if run.run_id not in old]
    assert new
    assert all(run.cycles >= before.stationary[-1].cycles for run in new)
    for was, now in zip(before.stationary, after.stationary, strict=False):
        np.testing.assert_array_equal(was.plateaus.torque, now.plateaus.torque)


@pytest.mark.parametrize(
    "slug", one_quick(["hydrodynamic_drag", "inertia_torque", "torque_zero_shift", "squeeze_film"])
)
def test_an_open_clutch_has_its_own_drag_and_what_is_no_friction(slug: str) -> None:
    hidden = hide((5, 7), (slug,), 50.0, states=4)
    after = with_test(hidden, "open_clutch")
    effect, amplitude = hidden.effects[0]
    bare = replace(after, effects=())
    sweep, loops = after.plan.sites[-2:]
    assert not sweep.bar.any()
    assert not loops.bar.any()
    np.testing.assert_array_equal(sweep.clock[0], 5.0 * (np.arange(sweep.rpm.shape[1]) + 0.5))
    drag = drag_of(hidden.seed)
    readings = read(after.plan, after.clutch, after.effects, drag=drag)[-2:]
    for site, torque, none in zip((sweep, loops), readings, read(bare.plan, bare.clutch, drag=drag)[-2:], strict=True):
        np.testing.assert_array_equal(none, drag(site.v))
        left = torque - none
        assert np.abs(left).max() == 0 or effect.reading is not None
        if slug == "torque_zero_shift":
            assert np.abs(left).max() > 0.1 * amplitude
        elif slug == "inertia_torque" and site is loops:
            assert np.abs(left).max() > amplitude * 100
    # the control: without the test nothing is drawn, and campaigns stay what they were
    np.testing.assert_array_equal(hidden.measured[0], hide((5, 7), (slug,), 50.0, states=4).measured[0])
    assert drag_of((5, 7))(np.array([6.0])) == drag(np.array([6.0])) != drag_of((5, 8))(np.array([6.0]))


def test_gains_and_noise_of_an_open_clutch_are_those_of_its_little_torque() -> None:
    after = with_test(hide((5, 6), (), states=4), "open_clutch")
    error = after.measured[-2] - drag_of(after.seed)(after.plan.sites[-2].v)
    sigma = after.sensor.sigma(after.plan.sites[-2], drag_of(after.seed)(after.plan.sites[-2].v))
    assert 0.7 < error.std() / np.sqrt(np.mean(sigma**2)) < 1.4
