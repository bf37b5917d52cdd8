"""Campaigns fitted once for the tests of what follows from a fit: a baseline, and one or several extended models."""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Laws
from models.diagnosis.baseline.prediction import predict
from models.diagnosis.campaign import Campaign
from models.diagnosis.design.design import Design, build_design
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import FROM_THE_START, Shape
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.pooled_fit.baseline_fit import Baseline, fit_baseline
from models.diagnosis.pooled_fit.gauss_newton import Fit, fit
from models.diagnosis.pooled_fit.problem import FitProblem
from tests.models.diagnosis.campaigns import Where


@dataclass(frozen=True)
class Study:
    """A campaign, its design and its baseline."""

    campaign: Campaign
    design: Design
    baseline: Baseline

    @property
    def problem(self) -> FitProblem:
        return self.baseline.problem

    def extended(self, *effects: tuple[str, float, Shape]) -> Fit:
        """The baseline with effects (slug, first amplitude, shape) fitted along."""
        start = [of_size(slug, first, shape) for slug, first, shape in effects]
        return fit(self.problem, self.baseline.fit.laws, start)


def of_size(slug: str, amplitude: float, shape: Shape) -> FittedEffect:
    """An effect as large and formed so, at work from the start where the shape does not say from when on."""
    effect = BY_SLUG[slug]
    missing = effect.begins and len(shape) < len(effect.shapes)
    return FittedEffect(effect=effect, amplitude=amplitude, shape=(*shape, FROM_THE_START) if missing else shape)


def study(campaign: Campaign) -> Study:
    design = build_design(campaign)
    return Study(campaign, design, fit_baseline(design))


def warmth(at: Where) -> FloatArray:
    """Torque falls by 0.3 % of its viscous part a kelvin: no formula of viscosity."""
    viscous = at.parameters.viscous_coefficient * at.velocity**0.3
    return np.asarray(-0.03 * viscous * (at.temperature - 358.15), dtype=np.float64)


def bump(at: Where) -> FloatArray:
    """Three percent more torque about 3 m/s: outside of the catalogue."""
    level = at.pressure / 4e5 * 20
    return np.asarray(0.02 * level * np.exp(-0.5 * ((at.velocity - 3.0) / 0.8) ** 2), dtype=np.float64)


def checked_jacobian(design: Design, laws: Laws) -> FloatArray:
    """The baseline's sensitivities, after they were found to be those of central differences."""
    jacobian = predict(design, laws).jacobian(design)
    for k in range(laws.theta.size):
        step = 1e-5 * max(abs(laws.theta[k]), 0.1)
        ends = []
        for side in (1, -1):
            theta = laws.theta.copy()
            theta[k] += side * step
            ends.append(predict(design, Laws(theta=theta, frame=laws.frame)).torque)
        numeric = (ends[0] - ends[1]) / (2 * step)
        # in loops a change of S goes through the continuous law, differences through its steps: 1 % of the largest
        assert np.abs(numeric - jacobian[:, k]).max() <= 0.01 * np.abs(numeric).max() + 1e-9, k
    return jacobian
