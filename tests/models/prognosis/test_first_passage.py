"""First passage of a weighted sample, against cases that can be worked out by hand."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.prognosis import first_passage
from models.prognosis.first_passage import Limit, ends_of_life, predict_first_passage, weighted_quantiles, widened
from models.tracking.discrepancy import FUTURE, PAST
from models.tracking.posterior import TrackPosterior
from tests.models.tracking.tracked_series import beside, draws_of


def sample(change: list[float], weight: list[float] | None = None, scale: float = 1_000.0) -> TrackPosterior:
    """Draws with ξ0 = 1 and ε = 1: the end of life at half is φ (1/(1 - 0.5/-Δ) - 1)."""
    draws = draws_of(len(change), initial=1.0, change=change, scale=scale, exponent=1.0)
    return draws if weight is None else replace(draws, weight=np.array(weight))


def numbers(passage: first_passage.FirstPassage) -> list[float]:
    found: list[float] = []
    for entry in asdict(passage).values():
        entries = entry.values() if isinstance(entry, dict) else entry if isinstance(entry, tuple) else [entry]
        found += [x for x in entries if isinstance(x, float)]
    return found


def test_a_certain_life_by_hand() -> None:
    """Δ = -1, ε = 1: 1/(1 + ζ/φ) = 1/2 at ζ = φ."""
    passage = predict_first_passage(sample([-1.0]), fraction=0.5, as_of=250.0)
    assert list(passage.end_of_life) == list(first_passage.QUANTILES)
    assert all(x == pytest.approx(1_000.0) for x in passage.end_of_life.values())
    assert passage.status == "predicted"
    assert passage.probability_of_reaching == 1.0
    assert (passage.initial, passage.threshold) == (1.0, 0.5)
    assert passage.current == (pytest.approx(0.8), 0.0)


@pytest.mark.parametrize("horizon", [1e6, 500.0])
def test_a_horizon_before_now_is_now(horizon: float) -> None:
    passage = predict_first_passage(sample([-1.0]), fraction=0.5, as_of=2_000.0, horizon=horizon)
    assert passage.status is first_passage.PassageStatus.REACHED
    assert passage.probability_of_reaching == 1.0
    assert passage.end_of_life[0.5] == pytest.approx(1_000.0)


def test_what_is_reached_and_within_the_horizon() -> None:
    """Ends of life 1,000 (Δ = -1) and never (Δ = -0.4)."""
    for weight, status in ((0.5, "reached"), (0.49, "may_never_reach")):
        passage = predict_first_passage(sample([-1.0, -0.4], [weight, 1.0 - weight]), fraction=0.5, as_of=1_001.0)
        assert passage.status == status
        assert passage.probability_of_reaching == pytest.approx(weight)
    # a quantile beyond the horizon is none
    passage = predict_first_passage(sample([-1.0] * 60 + [-0.4] * 40), fraction=0.5, as_of=0.0)
    assert passage.status == "may_never_reach"
    assert passage.probability_of_reaching == pytest.approx(0.6)
    assert passage.end_of_life[0.5] == pytest.approx(1_000.0)
    assert passage.end_of_life[0.75] is None
    assert passage.end_of_life[0.95] is None
    late = predict_first_passage(sample([-1.0], scale=2e6), fraction=0.5, as_of=0.0)
    assert (set(late.end_of_life.values()), late.probability_of_reaching) == ({None}, 0.0)
    later = predict_first_passage(sample([-1.0], scale=2e6), fraction=0.5, as_of=0.0, horizon=3e6)
    assert later.status == "predicted"


def test_the_threshold_is_each_draws_own_and_reached_from_the_start_below_zero() -> None:
    """Two clutches alike but for the level of ξ0: a ratio is indifferent to it."""
    draws = sample([-1.0, -2.0])
    np.testing.assert_allclose(ends_of_life(replace(draws, initial=np.array([1.0, 2.0])), 0.5), 1_000.0)
    # ξ0 = -1 lies below -0.5 at once, though eq. 6 then rises through it.
    draws = replace(sample([2.0]), initial=np.array([-1.0]))
    assert ends_of_life(draws, 0.5)[0] == 0.0


@given(
    st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=30),
    st.floats(0.05, 0.95),
    st.floats(0.0, 1e7),
    st.floats(1e-3, 1e9),
)
def test_nothing_that_json_cannot_carry(change: list[float], fraction: float, as_of: float, scale: float) -> None:
    passage = predict_first_passage(sample(change, scale=scale), fraction=fraction, as_of=as_of)
    assert all(math.isfinite(x) for x in numbers(passage))
    ends = [math.inf if x is None else x for x in passage.end_of_life.values()]
    assert ends == sorted(ends)
    assert 0.0 <= passage.probability_of_reaching <= 1.0


def test_weighted_quantiles_of_a_normal() -> None:
    """10,000 evenly spread draws of a uniform, weighted into a normal: the discreteness leaves 1e-3."""
    x = np.linspace(-6.0, 6.0, 10_001)
    order = np.random.default_rng(1).permutation(x.size)
    found = weighted_quantiles(x[order], np.exp(-0.5 * x[order] ** 2), (0.05, 0.5, 0.975))
    np.testing.assert_allclose(found, [-1.6448536, 0.0, 1.9599640], atol=1e-3)
    assert weighted_quantiles(np.array([1.0, 3.0]), np.ones(2), (0.5,))[0] == 2.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"fraction": 1.0, "as_of": 0.0}, "fraction must lie between"),
        ({"fraction": 0.5, "as_of": -1.0}, "as_of must be"),
        ({"fraction": 0.5, "as_of": 0.0, "horizon": math.inf}, "horizon must be"),
    ],
)
def test_arguments_out_of_range(arguments: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        predict_first_passage(sample([-1.0]), **arguments)


def bent(
    draws: TrackPosterior, size: float, curvature: float = 0.0, step: float = 0.0, at: float = 0.0
) -> TrackPosterior:
    """The same draws with a discrepancy whose curvature on the first stretch is as given; span 1,000."""
    n = draws.weight.size
    bends = np.zeros((n, PAST + FUTURE))
    bends[:, 0] = curvature
    course = beside(n, size=np.full(n, size), curvature=bends, at=np.array([at]), height=np.full((n, 1), step))
    return replace(draws, discrepancy=course)


def test_a_discrepancy_by_hand() -> None:
    """Along the path, linear between places 6 % apart, the closed form's end is found to 0.1 %."""
    draws = sample([-1.0, -0.7, -0.4])
    found = ends_of_life(bent(draws, 0.03), 0.5)
    np.testing.assert_allclose(found, ends_of_life(draws, 0.5), rtol=1e-3)
    assert math.isinf(found[2])
    # Constant but for δ: curvature w on the first sixth of T = 1,000 alone gives δ = w √18 (u - 1/12)/6 from there on.
    draws = replace(sample([-1.0]), change=np.zeros(1))
    w = -0.5
    slope = w * math.sqrt(18.0) / 6.0
    found = ends_of_life(bent(draws, 0.1, w), 0.5)[0]
    assert found == pytest.approx(1_000.0 * (-0.5 / slope + 1.0 / 12.0), rel=1e-3)


@pytest.mark.parametrize(("step", "end", "rel"), [(-0.1, 666.7, 2e-3), (-0.2, 500.0, 0.02), (0.1, 1_500.0, 2e-3)])
def test_a_step_of_the_level_is_a_crossing_where_it_is(step: float, end: float, rel: float) -> None:
    """1/(1 + ζ/φ) is 0.55 at ζ = 818: a step of -0.1 at 500, where it is 0.667, brings the end to 1/0.6 - 1."""
    assert ends_of_life(bent(sample([-1.0]), 0.0, 0.0, step, at=500.0), 0.5) == pytest.approx(end, rel=rel)


def test_looking_at_every_sixth_place_first_is_looking_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 4,000 courses that bend and step as the prior has it, at most a few in a thousand dip and come back between."""
    rng, count = np.random.default_rng(5), 4_000
    draws = replace(sample(rng.uniform(-1.0, -0.45, count).tolist()), scale=np.exp(rng.normal(7.0, 1.0, count)))
    course = beside(
        count,
        size=np.full(count, 0.1),
        curvature=0.1 * rng.standard_normal((count, PAST + FUTURE)),
        at=np.array([300.0, 700.0]),
        height=rng.normal(0.0, 0.05, (count, 2)),
        knee=1_000.0 * rng.random(count) ** -1.5,
        steepening=np.full(count, 4.0),
    )
    found = ends_of_life(replace(draws, discrepancy=course), 0.5)
    monkeypatch.setattr(first_passage, "_STRIDE", 1)
    everywhere = ends_of_life(replace(draws, discrepancy=course), 0.5)
    assert np.isfinite(everywhere).mean() > 0.5
    assert (found >= everywhere * (1.0 - 1e-9)).all()
    assert np.isclose(found, everywhere, rtol=1e-9).mean() >= 0.995


@pytest.mark.parametrize("begin", [2_000.0, 2_500.0, 3_100.0, 3_900.0, 5_200.0])
def test_a_short_dip_of_an_offset_is_a_crossing(begin: float) -> None:
    """-0.35 over 8 % of the cycles takes 0.8 below half of it, long before the course itself gets there."""
    dip = predict_first_passage(
        sample([-0.6]), fraction=0.5, as_of=0.0, offset=lambda z: -0.35 * ((z > begin) & (z < 1.08 * begin))[None]
    )
    assert dip.end_of_life[0.5] == pytest.approx(begin, rel=0.06)


def test_an_offset_is_part_of_the_criterion() -> None:
    """ξ + offset <= half of (ξ0 + offset(0)): 1/(1 + u) + 0.2 = 0.6 at u = 1.5; a step from 0 to 0.2 at 100: 7/3."""
    draws = sample([-1.0])
    always = predict_first_passage(draws, fraction=0.5, as_of=0.0, offset=lambda z: np.full((1, z.size), 0.2))
    assert always.end_of_life[0.5] == pytest.approx(1_500.0, rel=1e-3)
    assert (always.initial, always.current[0]) == (pytest.approx(1.2), pytest.approx(1.2))
    later = predict_first_passage(draws, fraction=0.5, as_of=250.0, offset=lambda z: 0.2 * (z > 100.0)[None])
    assert later.end_of_life[0.5] == pytest.approx(1_000.0 * (1.0 / 0.3 - 1.0), rel=1e-3)
    assert later.current[0] == pytest.approx(1.0)


def test_bands_are_those_of_the_paths() -> None:
    draws = sample([-1.0, -0.5, -0.8], [0.25, 0.5, 0.25])
    zeta = np.array([0.0, 1_000.0])
    mean, quantiles = first_passage.bands(draws, zeta)
    np.testing.assert_allclose(mean, [1.0, 0.25 * 0.5 + 0.5 * 0.75 + 0.25 * 0.6])
    assert quantiles.shape == (2, 3)
    assert quantiles[1].tolist() == sorted(quantiles[1].tolist())
    assert 0.5 <= quantiles[1, 0] < quantiles[1, 2] <= 0.75


def test_first_below_is_straight_between_places_and_inf_where_never() -> None:
    at = first_passage.places(5_000.0, 1e6)
    assert (at[0], at[-1]) == (0.0, pytest.approx(1e6))
    assert (np.diff(at) > 0.0).all()
    assert 5_000.0 in at
    paths = np.array([[1.0, 0.4, 1.0], [0.6, 0.3, 0.9], [0.2, 0.1, 0.8]])
    found = first_passage.first_below(paths, np.array([0.0, 10.0, 30.0]), np.full(3, 0.5))
    assert found[:2] == pytest.approx([15.0, 0.0])
    assert np.isinf(found[2])


WEIGHT = np.full(3, 1.0 / 3.0)


@pytest.mark.parametrize(
    ("passages", "powers", "stated"),
    [
        ([1_500.0, 2_000.0, 3_000.0], (2.0, 2.0), [1_250.0, 2_000.0, 5_000.0]),
        ([1_500.0, 2_000.0, 3_000.0], (1.0, 1.0), [1_500.0, 2_000.0, 3_000.0]),
        ([1_500.0, 2_000.0, 3_000.0], (1.0, 2.0), [1_500.0, 2_000.0, 5_000.0]),
        ([1_500.0, 2_000.0, 3_000.0], (2.0, 1.0), [1_250.0, 2_000.0, 3_000.0]),
        ([900.0, 2_000.0, math.inf], (2.0, 2.0), [900.0, 2_000.0, math.inf]),
        ([10_990.0, math.inf, math.inf], (2.0, 2.0), [1_000.0 + 9_990.0**2 / 999_000.0, math.inf, math.inf]),
        ([800.0, 900.0, 3_000.0], (2.0, 2.0), [800.0, 900.0, 3_000.0]),
    ],
    ids=[
        "about its median", "not at all", "after it alone", "before it alone", "what ended stays", "about the horizon",
        "a life that has ended",
    ],
)  # fmt: skip
def test_remaining_life_is_wider_about_its_median(
    passages: list[float], powers: tuple[float, float], stated: list[float]
) -> None:
    found = widened(np.array(passages), WEIGHT, as_of=1_000.0, horizon=1e6, powers=powers)
    assert found.tolist() == pytest.approx(stated)


def test_what_becomes_wider_than_the_horizon_may_never_end() -> None:
    draws = sample([-1.0, -0.9, -0.505])
    ends = widened(ends_of_life(draws, 0.5), draws.weight, as_of=10.0, horizon=1e6, powers=(20.0, 20.0))
    wide = predict_first_passage(draws, fraction=0.5, as_of=10.0, stated=(ends, draws.weight))
    assert (wide.end_of_life[0.95], wide.status) == (None, first_passage.PassageStatus.MAY_NEVER_REACH)


# --- Limits: where a path is at one, and which of several is the first.

PROGRESS = np.linspace(0.0, 100.0, 11)


LINE = 1.0 - PROGRESS / 100.0
IN_AND_OUT = np.arange(5.0)


@pytest.mark.parametrize(
    ("limit", "progress", "path", "expected"),
    [
        (Limit(fraction=0.5), PROGRESS, LINE, 50.0),
        (Limit(below=0.25), PROGRESS, LINE, 75.0),
        (Limit(below=2.0), PROGRESS, LINE, 0.0),
        (Limit(above=2.0), PROGRESS, LINE, math.inf),
        (Limit(below=-1.0), PROGRESS, LINE, math.inf),
        (Limit(below=0.0), PROGRESS, 1.0 - 0.04 * PROGRESS, 25.0),
        (Limit(below=0.0), PROGRESS, 1.0 + 0.0 * PROGRESS, math.inf),
        (Limit(above=1.5), PROGRESS, 1.0 + 0.04 * PROGRESS, 12.5),
        # what begins past its limit comes to it once it has left it
        (Limit(below=0.0), IN_AND_OUT, np.array([-1.0, 1.0, 3.0, 3.0, 3.0]), math.inf),
        (Limit(below=0.0), IN_AND_OUT, np.array([-1.0, 1.0, 1.0, -1.0, -1.0]), 2.5),
        (Limit(below=0.0), IN_AND_OUT, np.array([-1.0] * 5), 0.0),
        (Limit(above=0.0), IN_AND_OUT, np.array([1.0, -1.0, -1.0, 1.0, 1.0]), 2.5),
        (Limit(below=0.0), IN_AND_OUT, np.array([1.0, -1.0, 1.0, 1.0, 1.0]), 0.5),
    ],
)
def test_a_path_is_at_its_limit_where_it_should_be(limit: Limit, progress, path, expected: float) -> None:
    assert limit.passages(path[:, None], progress)[0] == pytest.approx(expected)


@pytest.mark.parametrize("wrong", [{}, {"fraction": 0.5, "below": 1.0}, {"fraction": 1.0}, {"above": math.nan}])
def test_what_is_no_limit_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"exactly one|fraction must lie"):
        Limit(**wrong)


def test_the_first_of_two_counts_and_says_which() -> None:
    """Two exponentials race: the faster wins with the share of its rate, and their minimum has the sum of the rates."""
    rng = np.random.default_rng(4)
    weight = np.full(40_000, 1.0 / 40_000)
    fast, slow = (rng.exponential(mean, 40_000) for mean in (1.0, 3.0))
    first, shares = first_passage.first_reached([(fast, weight), (slow, weight)], 40_000, rng)
    assert shares == pytest.approx([0.75, 0.25], abs=0.01)
    assert first.mean() == pytest.approx(0.75, abs=0.015)
    # what is never reached is nobody's first
    weight = np.array([0.5, 0.5])
    ends = [(np.array([10.0, np.inf]), weight), (np.array([np.inf, np.inf]), weight)]
    first, shares = first_passage.first_reached(ends, 1_000, rng)
    assert shares.tolist() == [pytest.approx(0.5), 0.0]
    assert np.isfinite(first).mean() == pytest.approx(0.5)
