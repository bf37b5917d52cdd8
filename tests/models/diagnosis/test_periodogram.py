"""What swings with a test's clock is found where noise goes with torque, noise alone is not; a sensor's waves too."""

from dataclasses import replace

import numpy as np
import pytest

from models.arrays import FloatArray
from models.diagnosis.contrasts import TORQUE
from models.diagnosis.correlation import Correlation
from models.diagnosis.design import Design, build_design
from models.diagnosis.misfits import axes_of
from models.diagnosis.noise import first_noise
from models.diagnosis.periodogram import lines
from models.diagnosis.viewing import view_of
from models.diagnosis.whitening import Noise
from models.stribeck import torque
from tests.models.diagnosis.campaigns import Where, campaign
from tests.models.diagnosis.fitted import study

SEED = 7


@pytest.fixture(scope="module")
def design() -> Design:
    return build_design(campaign(1))


@pytest.fixture(scope="module")
def noise(design: Design) -> Noise:
    return replace(first_noise(design), plateaus=Correlation(), deviation=0.01 * design.torque)


def drawn(design: Design, noise: Noise, seed: int) -> FloatArray:
    white = np.random.default_rng([SEED, seed]).standard_normal(design.torque.size)
    gains = 0.003 * np.random.default_rng([SEED, seed, 1]).standard_normal(len(design.runs))
    return noise.deviation * white + gains[design.rows.run] * design.torque


def test_noise_alone_has_no_line(design: Design, noise: Noise) -> None:
    found = [lines(design, noise, drawn(design, noise, seed)) for seed in range(200)]
    assert not any(each.raised for each in found)
    # p-values are bounds: no more of them are small than should be (10 of 200 below 0.05, deviation 3.1)
    assert 1 <= sum(each.p_value < 0.05 for each in found) <= 20


@pytest.mark.parametrize("share", [False, True], ids=["so many Nm", "a share of the torque"])
def test_a_swing_is_found_whatever_its_phase_in_each_run(design: Design, noise: Noise, share: bool) -> None:
    rows = design.rows
    phase = np.random.default_rng(SEED).uniform(0, 2 * np.pi, len(design.runs))[rows.run]
    wave = np.sin(2 * np.pi * rows.clock / 90.0 + phase) * rows.steady
    swing = 0.005 * wave * (design.torque if share else np.median(design.torque))
    found = lines(design, noise, drawn(design, noise, 0) + swing)
    assert found.raised
    assert found.p_value < 1e-3
    assert lines(design, noise, drawn(design, noise, 0) + 0.02 * swing).p_value > 0.01


def test_too_few_plateaus_show_no_line() -> None:
    given = campaign(1)
    few = build_design(replace(given, stationary=given.stationary[:1], dynamic=()))
    short = replace(few, plateaus=20)
    assert not lines(short, first_noise(few), few.torque).raised


def test_a_sensor_that_is_wavy_over_its_range_is_structure_on_its_reading() -> None:
    def waves(at: Where) -> FloatArray:
        return np.asarray(0.4 * np.sin(2 * np.pi * torque(at.velocity, at.parameters) / 6.0), dtype=np.float64)

    given = study(campaign(3, waves))
    known = given.baseline
    view = view_of(given.design, known.noise, known.priors, known.fit, [])
    first = axes_of(view, {})[0]
    assert first.axis == TORQUE
    assert first.strength > 10.0
