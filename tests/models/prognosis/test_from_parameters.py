"""Mean COF from the parameters' tracks against eq. 3 and eq. 6 by themselves, and against a closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.degradation.general_order import Degradation, value
from models.friction.stribeck import StribeckParameters, torque
from models.prognosis.criteria import FAR_APART, HORIZON
from models.prognosis.from_parameters import PressureLevel, disagreement, far_apart, mean_cof_paths
from models.tracking.posterior import Posterior

AT = np.linspace(0.0, 12_000.0, 13)
VELOCITIES = np.linspace(0.2, 12.0, 40)
#: Eq. 6 of M_s [Nm], M̄_c, V_S [m/s] and C_v at 5 bar.
TRUTHS = (
    Degradation(initial=25.0, change=-14.0, scale=4_000.0, exponent=0.6),
    Degradation(initial=0.8, change=-0.3, scale=5_000.0, exponent=0.8),
    Degradation(initial=5.0, change=-3.0, scale=3_000.0, exponent=1.0),
    Degradation(initial=1.5, change=1.0, scale=6_000.0, exponent=0.9),
)
PER_COF = 150.0


def track(truth: Degradation, size: int = 40) -> Posterior:
    """A sample that is sure of its coefficients."""
    ones = np.ones(size)
    return Posterior(
        weight=ones / size,
        initial=truth.initial * ones,
        change=truth.change * ones,
        scale=truth.scale * ones,
        exponent=truth.exponent * ones,
        scatter=1e-6 * ones,
    )


def mean_cofs(progress: np.ndarray, strength: float = 1.0) -> np.ndarray:
    """Mean COF [k] of a pressure whose torque is `strength` times that of TRUTHS, velocity by velocity."""
    rows = []
    for zeta in progress:
        m_s, m_c, v_s, c_v = (float(value(zeta, truth)) for truth in TRUTHS)
        at = StribeckParameters(
            static_torque=strength * m_s, coulomb_ratio=m_c, stribeck_velocity=v_s, viscous_coefficient=strength * c_v
        )
        rows.append(torque(VELOCITIES, at).mean() / PER_COF)
    return np.array(rows)


def level(strength: float = 1.0) -> PressureLevel:
    scales = (strength, 1.0, 1.0, strength)
    truths = [
        replace(truth, initial=k * truth.initial, change=k * truth.change)
        for k, truth in zip(scales, TRUTHS, strict=True)
    ]
    parameters = np.stack([value(AT, truth) for truth in truths], axis=1)
    cof = mean_cofs(AT, strength)
    flat = Degradation(initial=cof[0], change=-0.5 * cof[0], scale=4_000.0, exponent=0.7)
    return PressureLevel(
        progress=AT,
        parameters=parameters,
        covariance=np.tile(np.diag((1e-4 * parameters[0]) ** 2), (AT.size, 1, 1)),
        parameter_tracks=[track(truth) for truth in truths],
        tests=range(AT.size),
        cof_progress=AT,
        cof=cof,
        cof_track=track(flat),
        torque_per_cof=PER_COF,
        reference_cof=float(cof[0]),
    )


def paths(levels, references=None, now=float(AT[-1])):
    return mean_cof_paths(
        levels,
        now=now,
        horizon=HORIZON,
        velocities=VELOCITIES,
        reference_cofs=[one.reference_cof for one in levels] if references is None else references,
        rng=np.random.default_rng(0),
    )


def test_sure_tracks_give_eq_3_of_eq_6() -> None:
    found = paths([level()])
    assert found is not None
    assert found.progress[found.now] == AT[-1]
    assert (np.diff(found.progress) > 0).all()
    early = found.progress <= AT[-1]
    # the fits are good to 1e-4
    assert found.paths[early].mean(axis=1) == pytest.approx(mean_cofs(found.progress[early]), rel=1e-3)
    lower, median, upper = found.band()
    assert ((lower <= median) & (median <= upper)).all()


def test_ends_of_life_are_where_the_mean_cof_passes_the_threshold() -> None:
    found = paths([level()])
    assert found is not None
    fine = np.linspace(0.0, 20_000.0, 4_001)
    course = mean_cofs(fine)
    end = float(np.interp(-0.7 * course[0], -course, fine))
    # linear between 24 places
    assert np.median(found.ends_of_life(0.7)) == pytest.approx(end, rel=0.02)
    assert np.isinf(found.ends_of_life(0.01)).all()


def test_pressures_are_averaged_and_scaled_to_all_of_the_reference() -> None:
    weak, strong = level(), level(1.5)
    both = paths([weak, strong])
    assert both is not None
    expected = 0.5 * (mean_cofs(AT[-1:]) + mean_cofs(AT[-1:], 1.5))[0]
    assert both.present.mean() == pytest.approx(expected, rel=1e-3)
    alone = paths([weak], references=[weak.reference_cof, strong.reference_cof])
    assert alone is not None
    assert alone.present.mean() == pytest.approx(expected, rel=1e-3)
    # the negative control: unscaled, the weaker pressure alone is 20 % too low
    bare = paths([weak])
    assert bare is not None
    assert bare.present.mean() < 0.85 * expected


def test_a_test_that_happens_to_scatter_little_does_not_count_for_all() -> None:
    """Its static torque is 5 % off and its residuals by chance small: the others' covariances tell what it is worth."""
    usual = level()
    parameters, covariance = usual.parameters.copy(), 1e4 * usual.covariance
    parameters[-1, 0] *= 1.05
    covariance[-1] *= 1e-4
    found = paths([replace(usual, parameters=parameters, covariance=covariance)])
    assert found is not None
    assert found.present.mean() == pytest.approx(mean_cofs(AT[-1:])[0], rel=0.01)


def test_too_few_tests_give_nothing_and_take_no_part() -> None:
    few = level()
    few = replace(few, progress=AT[[0, 1, 1]], parameters=few.parameters[:3], covariance=few.covariance[:3])
    assert paths([few]) is None
    assert paths([]) is None
    first, second = paths([level()], references=[1.0, 1.0]), paths([few, level()], references=[1.0, 1.0])
    assert first is not None
    assert second is not None
    assert (first.paths == second.paths).all()


def test_disagreement_of_two_normals() -> None:
    """Now: (μ1 - μ2)/√((σ1² + σ2²)/2); the end of life the same of its logarithm."""
    rng = np.random.default_rng(5)
    n = 200_000
    now, direct = rng.normal(0.10, 0.003, n), rng.normal(0.104, 0.001, n)
    ends, direct_ends = np.exp(rng.normal(9.0, 0.3, n)), np.exp(rng.normal(9.5, 0.1, n))
    found = disagreement(now, 500.0 + ends, direct, 500.0 + direct_ends, np.full(n, 1.0 / n), 500.0)
    assert found.now == pytest.approx(-0.004 / math.sqrt(0.5 * (0.003**2 + 0.001**2)), rel=0.01)
    assert found.end_of_life == pytest.approx(-0.5 / math.sqrt(0.5 * (0.3**2 + 0.1**2)), rel=0.02)


def test_no_disagreement_is_stated_beyond_the_horizon_or_without_uncertainty() -> None:
    weight = np.full(4, 0.25)
    same, ends, never = np.full(4, 0.1), np.array([1e4, 1.1e4, 1.2e4, 1.3e4]), np.full(4, np.inf)
    assert disagreement(same, never, same, ends, weight, 0.0).end_of_life is None
    found = disagreement(same, np.full(4, 1e4), same, np.full(4, 1e4), weight, 0.0)
    assert (found.now, found.end_of_life) == (None, None)


@pytest.mark.parametrize(
    ("deviations", "far"), [(None, False), (FAR_APART, False), (1.01 * FAR_APART, True), (-4.0, True)]
)
def test_far_apart(deviations: float | None, far: bool) -> None:
    assert far_apart(deviations) is far
