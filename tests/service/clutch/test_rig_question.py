"""What a rig may do as well as a clutch: a step, or levels that drift apart."""

import pytest

from service.clutch.timeline import Event, Life


def life(last: dict[float, float]) -> Life:
    """A life whose first test has a COF of 0.1 at 2, 4 and 6 bar, and whose last has these."""
    tests = [{2e5: 0.1, 4e5: 0.1, 6e5: 0.1}, last]
    events = [
        Event(
            run_id=f"t{k}",
            kind="stationary_stribeck",
            cycles=1_000.0 * k,
            moment=float(k),
            cofs={level: (cof, 1e-4) for level, cof in cofs.items()},
        )
        for k, cofs in enumerate(tests)
    ]
    return Life(origin=0.0, events=tuple(events))


@pytest.mark.parametrize(
    ("last", "question"),
    [
        pytest.param(
            {2e5: 0.1, 4e5: 0.095, 6e5: 0.09}, "mean COF at 2 bar has risen against that at 6 bar", id="a gauge"
        ),
        pytest.param({2e5: 0.06, 4e5: 0.06, 6e5: 0.06}, None, id="wear"),
        pytest.param({2e5: 0.053, 4e5: 0.052, 6e5: 0.05}, None, id="wear that depends on pressure"),
        pytest.param({8e5: 0.2}, None, id="other pressures"),
    ],
)
def test_levels_that_drift_apart_are_a_question_to_the_rig(last: dict[float, float], question: str | None) -> None:
    assert life(last).rig_question(()) == question


def test_a_step_that_nobody_declared_is_one() -> None:
    level = {2e5: 0.1, 4e5: 0.1, 6e5: 0.1}
    assert life(level).rig_question((7_000.0,)) == "mean COF stepped at 7,000 cycles and no maintenance was sent"
    assert Life(origin=0.0, events=life(level).events[:1]).rig_question(()) is None
