"""The exponent of severity that the tests of one life speak for, where the energy of its duty steps."""

import numpy as np
import pytest

from models.degradation.severity import Block, Severity, SeverityBasis
from service.lives.assumptions import Assumptions
from service.lives.criteria import SEVERITY_EXPONENTS
from service.lives.history import Event, Life
from service.lives.severity_estimate import severity_estimate

PRESSURE, TESTS, EVERY, SCATTER = 5e5, 25, 1_000.0, 0.003


def life(exponent: float, steps: tuple[float, ...] = (10e3, 20e3, 40e3), seed: int = 1) -> Life:
    """Duty in as many stages as `steps` [J], and a test after every block; wear by eq. 6 over ∫ (E/E_first)^q dn."""
    rng, zeta, events = np.random.default_rng(seed), 0.0, []
    for test in range(TESTS):
        cycles = EVERY * test
        if test:
            energy = steps[(test - 1) * len(steps) // (TESTS - 1)]
            zeta += EVERY * (energy / steps[0]) ** exponent
            block = Block(end=cycles, cycles=EVERY, energy=energy)
            events.append(
                Event(
                    run_id=f"d{test}",
                    kind="duty_cycles",
                    cycles=cycles,
                    moment=2.0 * test,
                    arrived=2.0 * test,
                    duty=block,
                )
            )
        cof = 0.13 * (1.0 - 0.75 * (1.0 - (1.0 + zeta / 12_000.0) ** -0.8)) * (1.0 + SCATTER * rng.standard_normal())
        events.append(
            Event(
                run_id=f"t{test}",
                kind="stationary_stribeck",
                cycles=cycles,
                moment=2.0 * test + 1.0,
                arrived=2.0 * test + 1.0,
                speed_range=(1.0, 200.0),
                cofs={PRESSURE: (cof, 0.001 * cof)},
            )
        )
    return Life(origin=0.0, events=tuple(events))


@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.0])
def test_energy_that_steps_tells_its_exponent(exponent: float) -> None:
    found = severity_estimate(life(exponent), Assumptions())
    assert found is not None
    assert found.basis is SeverityBasis.DISSIPATED_ENERGY
    assert found.likeliest == exponent
    assert found.probability[SEVERITY_EXPONENTS.index(exponent)] > 0.5
    assert found.probability.sum() == pytest.approx(1.0)
    assert abs(found.mean - exponent) < 3.0 * max(found.deviation, 0.05)


def test_an_exponent_that_the_tests_contradict_is_doubted() -> None:
    """By cycles, whose exponent is 0, where wear goes with energy; not by energy itself."""
    found = severity_estimate(life(1.0), Assumptions())
    assert found is not None
    (doubt,) = found.doubts(Severity(basis=SeverityBasis.CYCLES))
    assert doubt.code == "severity_exponent"
    assert "exponent 1 of dissipated_energy" in doubt.message
    assert found.doubts(Severity(basis=SeverityBasis.DISSIPATED_ENERGY, exponent=1.0)) == []


def test_nothing_is_weighed_where_nothing_tells() -> None:
    """Constant duty, and too few tests."""
    assert severity_estimate(life(1.0, steps=(20e3,)), Assumptions()) is None
    assert severity_estimate(life(1.0, steps=(20e3, 20.5e3)), Assumptions()) is None
    assert severity_estimate(life(1.0, steps=(10e3, 40e3)).until(4), Assumptions()) is None
