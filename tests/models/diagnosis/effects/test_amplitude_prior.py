"""The prior of an effect's amplitude: a density, a slope that is its derivative, tails that let a large effect through."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm, t

from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.effect import amplitude_cost, amplitude_precision, log_amplitude_peak


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.slug)
def test_the_prior_is_a_density_with_students_tails(effect):
    def density(a: float) -> float:
        return float(np.exp(log_amplitude_peak(effect) - amplitude_cost(effect, a)) / np.sqrt(2 * np.pi))

    total = quad(lambda u: density(u * effect.prior_sd) * effect.prior_sd, -np.inf, np.inf)[0]
    assert total == pytest.approx(1.0, abs=1e-6)
    witness = t(df=effect.tails, scale=effect.prior_sd).logpdf(6 * effect.prior_sd)
    assert np.log(density(6 * effect.prior_sd)) == pytest.approx(witness, abs=1e-9)
    assert witness > norm(scale=effect.prior_sd).logpdf(6 * effect.prior_sd) + 10.0


@pytest.mark.parametrize("tails", [2.0, 5.0, float("inf")])
def test_the_precision_is_the_slope_of_the_cost(tails):
    effect = replace(BY_SLUG["oil_change"], tails=tails)
    for a in (-3.0, 0.01, 0.4):
        step = 1e-6
        slope = (amplitude_cost(effect, a + step) - amplitude_cost(effect, a - step)) / (2 * step)
        assert amplitude_precision(effect, a) * a == pytest.approx(slope, rel=1e-5)


def test_infinite_tails_are_a_normal_prior():
    effect = replace(BY_SLUG["oil_change"], tails=float("inf"))
    witness = norm(scale=effect.prior_sd)
    for a in (0.0, 0.3):
        found = log_amplitude_peak(effect) - amplitude_cost(effect, a) - 0.5 * np.log(2 * np.pi)
        assert found == pytest.approx(witness.logpdf(a), abs=1e-12)
