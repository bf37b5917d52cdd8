"""Mean COF from the parameters' tracks against eq. 3 and eq. 6 by themselves, and against a closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.degradation.general_order import DegradationLaw, value
from models.friction.stribeck import StribeckParameters, torque
from models.prognosis.criteria import FAR_APART, HORIZON
from models.prognosis.from_parameters import (
    PressureLevel,
    disagreement,
    draw_jointly,
    far_apart,
    mean_cof_paths,
    paired,
    shrunk_correlation,
)
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import weak
from tests.models.tracking.tracked_series import draws_of, on_grid, sent

AT = np.linspace(0.0, 12_000.0, 13)
VELOCITIES = np.linspace(0.2, 12.0, 40)
#: Eq. 6 of M_s [Nm], M̄_c, V_S [m/s] and C_v at 5 bar.
TRUTHS = (
    DegradationLaw(initial=25.0, change=-14.0, scale=4_000.0, exponent=0.6),
    DegradationLaw(initial=0.8, change=-0.3, scale=5_000.0, exponent=0.8),
    DegradationLaw(initial=5.0, change=-3.0, scale=3_000.0, exponent=1.0),
    DegradationLaw(initial=1.5, change=1.0, scale=6_000.0, exponent=0.9),
)
PER_COF = 150.0


def track(truth: DegradationLaw, size: int = 40) -> TrackPosterior:
    """A sample that is sure of its coefficients."""
    law = {"initial": truth.initial, "change": truth.change, "scale": truth.scale, "exponent": truth.exponent}
    return draws_of(size, **law, scatter=1e-6)


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
    flat = DegradationLaw(initial=cof[0], change=-0.5 * cof[0], scale=4_000.0, exponent=0.7)
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


def test_sure_tracks_give_eq_3_of_eq_6_and_end_where_it_passes_the_threshold() -> None:
    found = paths([level()])
    assert found.progress[found.now] == AT[-1]
    assert (np.diff(found.progress) > 0).all()
    early = found.progress <= AT[-1]
    # the fits are good to 1e-4
    assert found.paths[early].mean(axis=1) == pytest.approx(mean_cofs(found.progress[early]), rel=1e-3)
    lower, median, upper = found.band()
    assert ((lower <= median) & (median <= upper)).all()
    # ends of life are where the mean cof passes the threshold
    fine = np.linspace(0.0, 20_000.0, 4_001)
    course = mean_cofs(fine)
    end = float(np.interp(-0.7 * course[0], -course, fine))
    # linear between 24 places
    assert np.median(found.ends_of_life(0.7)) == pytest.approx(end, rel=0.02)
    assert np.isinf(found.ends_of_life(0.01)).all()


def test_pressures_are_averaged_and_scaled_to_all_of_the_reference() -> None:
    weak, strong = level(), level(1.5)
    both = paths([weak, strong])
    expected = 0.5 * (mean_cofs(AT[-1:]) + mean_cofs(AT[-1:], 1.5))[0]
    assert both.present.mean() == pytest.approx(expected, rel=1e-3)
    alone = paths([weak], references=[weak.reference_cof, strong.reference_cof])
    assert alone.present.mean() == pytest.approx(expected, rel=1e-3)
    # the negative control: unscaled, the weaker pressure alone is 20 % too low
    bare = paths([weak])
    assert bare.present.mean() < 0.85 * expected


def test_a_test_that_happens_to_scatter_little_does_not_count_for_all() -> None:
    """Its static torque is 5 % off and its residuals by chance small: the others' covariances tell what it is worth."""
    usual = level()
    parameters, covariance = usual.parameters.copy(), 1e4 * usual.covariance
    parameters[-1, 0] *= 1.05
    covariance[-1] *= 1e-4
    found = paths([replace(usual, parameters=parameters, covariance=covariance)])
    assert found.present.mean() == pytest.approx(mean_cofs(AT[-1:])[0], rel=0.01)


def test_too_few_tests_give_nothing_and_take_no_part() -> None:
    few = level()
    few = replace(few, progress=AT[[0, 1, 1]], parameters=few.parameters[:3], covariance=few.covariance[:3])
    assert paths([few]) is None
    assert paths([]) is None
    first, second = paths([level()], references=[1.0, 1.0]), paths([few, level()], references=[1.0, 1.0])
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
    # no disagreement is stated beyond the horizon or without uncertainty
    weight = np.full(4, 0.25)
    same, ends, never = np.full(4, 0.1), np.array([1e4, 1.1e4, 1.2e4, 1.3e4]), np.full(4, np.inf)
    assert disagreement(same, never, same, ends, weight, 0.0).end_of_life is None
    found = disagreement(same, np.full(4, 1e4), same, np.full(4, 1e4), weight, 0.0)
    assert (found.now, found.end_of_life) == (None, None)
    assert [far_apart(deviations) for deviations in (None, FAR_APART, -4.0)] == [False, False, True]


# --- Quantities whose measurements err together: what only their sum knows is not lost.

PAIR = (
    DegradationLaw(initial=20.0, change=-9.0, scale=5000.0, exponent=0.8),
    DegradationLaw(initial=5.0, change=3.0, scale=9000.0, exponent=0.5),
)
#: One errs by +1 where the other errs by -1: their sum is known a hundred times better.
COVARIANCE = np.array([[0.25, -0.24998], [-0.24998, 0.25]])


def measured(rng: np.random.Generator) -> np.ndarray:
    errors = rng.multivariate_normal(np.zeros(2), COVARIANCE, AT.size)
    return np.stack([value(AT, truth) for truth in PAIR], axis=1) + errors


def own(values: np.ndarray, rng: np.random.Generator) -> list[TrackPosterior]:
    """Each quantity's track by itself."""
    tests = [sent(AT, column, 0.25) for column in values.T]
    return [on_grid(seen, 1000, rng, weak(seen[0], falling=False)) for seen in tests]


def test_the_sum_is_known_as_well_as_it_was_measured() -> None:
    rng = np.random.default_rng(1)
    values = measured(rng)
    tracks = own(values, rng)
    together = draw_jointly(AT, values, np.repeat(COVARIANCE[None], AT.size, axis=0), tracks, 300, rng)
    end = AT[-1:]
    sums = sum(each.values(end)[0] for each in together)
    true = float(sum(value(AT[-1], truth) for truth in PAIR))
    assert abs(sums.mean() - true) < 0.05
    assert sums.std() < 0.05
    # the negative control: side by side, the two tracks know their sum no better than each knows itself
    alone = tracks[0].values(end)[0] + tracks[1].values(end)[0]
    assert alone.std() > 5.0 * sums.std()


def test_without_correlation_each_track_is_as_it_was() -> None:
    rng = np.random.default_rng(2)
    values = np.stack([value(AT, truth) for truth in PAIR], axis=1) + 0.5 * rng.standard_normal((AT.size, 2))
    tracks = own(values, rng)
    scatter = [float(each.weight @ each.scatter**2) for each in tracks]
    together = draw_jointly(
        AT, values, np.repeat(np.diag(0.25 + np.array(scatter))[None], AT.size, axis=0), tracks, 1000, rng
    )
    for track, each in zip(tracks, together, strict=True):
        mean, sd = track.moments(track.values(AT[-1:])[0])
        found = each.values(AT[-1:])[0]
        assert found.mean() == pytest.approx(mean, abs=0.35 * sd)
        assert found.std() == pytest.approx(sd, rel=0.35)


def test_pairs_have_the_wanted_correlation_which_shrinks_where_few_tests_tell_it() -> None:
    rng = np.random.default_rng(3)
    values = np.stack([rng.standard_normal(2000), np.exp(rng.standard_normal(2000))], axis=1)
    index = paired(values, np.array([[1.0, 0.9], [0.9, 1.0]]), rng)
    found = np.take_along_axis(values, index, axis=0)
    assert np.sort(found, axis=0) == pytest.approx(np.sort(values, axis=0))
    assert np.corrcoef(found[:, 0], np.log(found[:, 1]))[0, 1] == pytest.approx(0.9, abs=0.03)
    # correlation shrinks where few tests tell it
    rng = np.random.default_rng(4)
    common = rng.standard_normal(60)
    residuals = np.stack([common, common + 0.1 * rng.standard_normal(60)], axis=1)
    many, few = shrunk_correlation(residuals), shrunk_correlation(residuals[:4])
    assert 0.85 < many[0, 1] < 1.0
    assert abs(few[0, 1]) < 0.5
    assert (shrunk_correlation(residuals[:1]) == np.eye(2)).all()
