"""Noise from within the data: right where it is white or autocorrelated, and blind to what is smooth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign
from models.diagnosis.design.autocorrelation import Correlation, arma
from models.diagnosis.design.design import Design, build_design
from models.diagnosis.diagnose import diagnose
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.noise import estimate
from models.diagnosis.noise.covariance import Noise, gains_of, whitened, without_gains
from models.diagnosis.noise.estimate import estimate_noise, first_noise
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline
from tests.models.diagnosis.campaigns import PRESSURES, campaign

SEED = 20


@pytest.fixture(scope="module")
def design() -> Design:
    return build_design(campaign(1))


@pytest.mark.parametrize("memory", [0.0, 0.5])
def test_noise_is_found_beside_something_smooth(design: Design, memory: float) -> None:
    rng = np.random.default_rng(SEED)
    white = rng.standard_normal(design.torque.size)
    autocorrelated = lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], white)
    smooth = 0.03 * design.torque * np.sin(design.rows.velocity / 3)
    residual = smooth + 0.01 * design.torque * autocorrelated / np.sqrt(design.samples)
    noise, assumed = estimate_noise(design, residual, design.torque, first_noise(design))
    steady = slice(0, design.plateaus)
    share = np.median(noise.deviation[steady] / design.torque[steady])
    assert not assumed
    assert abs(share - 0.01) < 0.0012  # some 600 rows, and the correlation is estimated from few
    next_row = noise.plateaus.share * noise.plateaus.decay
    assert abs(next_row - memory) < 0.15


def test_a_sharp_drop_is_no_noise(design: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    """Traction near rest drops within three readings: the noise of real sweeps was taken for thirteen times what it is."""
    monkeypatch.setattr(estimate, "_SHORT", 8)  # curves of 24 readings here: a third of the pieces holds the drop
    white = np.random.default_rng(SEED).standard_normal(design.torque.size)
    dropping = design.rows.steady & (design.rows.velocity < np.unique(design.rows.velocity[: design.plateaus])[3])
    residual = 0.01 * design.torque * white / np.sqrt(design.samples) - np.where(dropping, design.torque, 0.0)
    noise, assumed = estimate_noise(design, residual, design.torque, first_noise(design))
    calm = np.flatnonzero(~dropping[: design.plateaus])
    assert not assumed
    assert 0.007 < np.median(noise.deviation[calm] / design.torque[calm]) < 0.015


def test_a_flat_likelihood_does_not_choose_persistent_noise(design: Design) -> None:
    """Neighbours correlated by 0.3 in 20 draws: slow noise, of which curves freed of all that is smooth show little, must
    not be taken for much stronger than it is (1.86 times that of independent neighbours) in any of them."""
    inflations = []
    for seed in range(20):
        white = np.random.default_rng([SEED, seed]).standard_normal(design.torque.size)
        autocorrelated = lfilter([np.sqrt(1 - 0.3**2)], [1, -0.3], white)
        residual = 0.01 * design.torque * autocorrelated / np.sqrt(design.samples)
        found = estimate_noise(design, residual, design.torque, first_noise(design))[0].plateaus
        inflations.append(1 + 2 * found.share * found.decay / (1 - found.decay))
    assert 1.4 < np.median(inflations) < 2.4
    assert max(inflations) < 4.0


@pytest.mark.parametrize("share", [1.0, 1.0 - 1e-12, 1.0 - 1e-9, 1.0 - 1e-6, 0.998, 0.5, 1e-6])
@pytest.mark.parametrize("step", [0.2, 0.9, 0.95])
def test_an_arma_process_has_the_correlations_that_it_was_made_for(share: float, step: float) -> None:
    theta, scale = arma(Correlation(share=share, decay=step))
    assert abs(theta) < 1
    # x_i = ρ x_{i-1} + s (e_i + θ e_{i-1}): its variance, and its covariance with the neighbour
    variance = scale**2 * (1 + theta**2 + 2 * step * theta) / (1 - step**2)
    assert variance == pytest.approx(1.0, rel=1e-6)
    assert step * variance + scale**2 * theta == pytest.approx(share * step, rel=1e-6, abs=1e-9)


def test_whitening_is_the_inverse_root_of_the_covariance(design: Design) -> None:
    correlation = Correlation(share=0.7, decay=0.6)
    noise = Noise(
        deviation=np.full(design.torque.size, 2.0),
        plateaus=correlation,
        loops=Correlation(),
        run_gain=0.004,
        curve_gain=0.002,
    )
    rows = np.flatnonzero(design.rows.run == 0)
    distance = np.abs(np.subtract.outer(rows, rows))
    covariance = 4.0 * np.where(distance == 0, 1.0, 0.7 * 0.6**distance)
    torque = design.torque[rows]
    covariance += 0.004**2 * np.outer(torque, torque)
    same = np.equal.outer(design.curve[rows], design.curve[rows])
    covariance += 0.002**2 * np.outer(torque, torque) * same
    probe = np.zeros((design.torque.size, 2))
    probe[rows] = np.random.default_rng(SEED).standard_normal((rows.size, 2))
    white = without_gains(whitened(probe, design, noise), gains_of(design, design.torque, noise), 0.004, 0.002)
    expected = probe[rows].T @ np.linalg.solve(covariance, probe[rows])
    # the filter starts from a row's own past that is not known: a part in hundred
    np.testing.assert_allclose(white.T @ white, expected, rtol=0.02, atol=0.02 * expected[0, 0])


def scattered(given: Campaign, scatter: float) -> Campaign:
    """Each pressure of each test with a gain of its own."""
    rng = np.random.default_rng(SEED)

    def gains(pressure: FloatArray) -> FloatArray:
        each = 1 + scatter * rng.standard_normal(PRESSURES.size)
        return each[np.abs(pressure[:, None] - PRESSURES).argmin(axis=1)]

    stationary = [
        replace(run, plateaus=replace(run.plateaus, torque=run.plateaus.torque * gains(run.plateaus.pressure)))
        for run in given.stationary
    ]
    dynamic = [
        replace(run, record=replace(run.record, torque=run.record.torque * gains(run.record.pressure)))
        for run in given.dynamic
    ]
    return replace(given, stationary=tuple(stationary), dynamic=tuple(dynamic))


@pytest.mark.slow
@pytest.mark.parametrize(("scatter", "least", "most"), [(0.0, 0.0, 4e-4), (0.001, 4e-4, 2.5e-3), (0.004, 2.5e-3, 6e-3)])
def test_gains_that_scatter_from_pressure_to_pressure_are_no_structure(
    scatter: float, least: float, most: float
) -> None:
    given = scattered(campaign(3), scatter)
    assert least <= fit_baseline(build_design(given)).problem.noise.curve_gain <= most
    assert diagnose(given, rng=np.random.default_rng(0)).verdict is Verdict.MODEL_ADEQUATE


@pytest.mark.parametrize("order", ["rising speed", "random"])
@pytest.mark.parametrize("place", ["first", "middle", "last"])
def test_a_spike_weighs_nothing_wherever_it_stands_on_its_curve(order: str, place: str) -> None:
    """It is 40 deviations; everything around it is off by a fifth of a spike, as where it has distorted the fit."""
    given = campaign(1, loops=False)
    if order == "random":
        shuffle = np.random.default_rng(SEED).permutation(given.stationary[0].plateaus.torque.size)
        runs = [replace(run, plateaus=run.plateaus.take(shuffle)) for run in given.stationary]
        given = replace(given, stationary=tuple(runs))
    design = build_design(given)
    deviation = 0.01 * design.torque
    residual = deviation * np.random.default_rng(SEED).standard_normal(design.torque.size)
    curve = np.flatnonzero(design.curve == 7)
    curve = curve[np.argsort(design.rows.velocity[curve])]
    residual[curve] += 8 * deviation[curve]
    spike = curve[{"first": 0, "middle": 9, "last": -1}[place]]
    residual[spike] -= 48 * deviation[spike]
    noise, _ = estimate_noise(design, residual, design.torque, first_noise(design))
    lighter = np.flatnonzero(noise.deviation > 3 * 0.01 * np.abs(design.torque))
    assert lighter.tolist() == [spike]
    assert noise.deviation[spike] == pytest.approx(abs(residual[spike]))
