"""Honest lives are not shut out: whatever is asked about on the way, nothing is held in the end."""

import numpy as np
import pytest

from models.rig import campaign
from service.runs.simulated import simulated_body
from tests.lab.plausibility import slips
from tests.lab.plausibility.bench import Bench, Body, with_gain
from tests.lab.plausibility.honest_lives import KINDS, life
from tests.lab.real import loaders
from tests.support import one_quick, stationary


def even(step: float, share: float = 0.96, count: int = 8) -> list[Body]:
    """Tests a step of cycles apart, COF lower by the same share each time."""
    runs = []
    for k in range(count):
        body = stationary(k * step, run_id=f"t{k}", wear=0.0, pressures=(4.0, 6.0))
        runs.append(with_gain(body, share**k))
    return runs


def sent(runs: list[Body]) -> tuple[Bench, str]:
    """A bench to which runs were sent, and which of them were held when they came in (h)."""
    bench, states = Bench({}), ""
    for run in runs:
        states += "h" if bench.answer(run).codes else "a"
    return bench, states


@pytest.mark.parametrize("step", [10.0, 1000.0, 50_000.0, 1e6, 1e7])
def test_any_scale_of_cycles_is_accepted(step: float) -> None:
    bench, states = sent(even(step))
    assert states.count("h") <= 1
    assert bench.held == ()


@pytest.mark.parametrize("share", one_quick([0.75, 0.85, 1.2, 1.3]))
def test_a_new_level_is_asked_about_at_most_once(share: float) -> None:
    """After a declared oil change, and with nothing declared."""
    before = even(1000.0, share=0.99, count=14)
    after = [with_gain(run, share) for run in before[7:]]
    for declared in (True, False):
        event: list[Body] = [{"kind": "maintenance", "event": "oil_change", "run_id": "m", "cycles": 6500}]
        bench, states = sent([*before[:7], *(event if declared else []), *after])
        assert states.count("h") <= 1
        assert bench.held == ()


def test_an_early_test_of_a_long_life_is_not_doubted_by_what_came_much_later() -> None:
    """The first tests are closer together than the others; of 53 tests not all are looked at."""
    runs = [run for run in campaign.simulate(1, stop_fraction=0.01, most_tests=53) if run.plateaus is not None]
    bench, held = Bench({}), list[str]()
    for run in runs:
        bench.answer(simulated_body(run))
        held += [event.run_id for event in bench.held]
    assert len(runs) == 53
    assert held == []


@pytest.mark.parametrize("kind", list(KINDS))
def test_an_honest_life_is_not_shut_out(kind: str) -> None:
    if kind.startswith("filters") and not loaders.FOLDER.is_dir():
        pytest.skip(f"{loaders.FOLDER} is not there")
    bench, _ = sent(life(17, kind, 0))
    assert bench.held == ()


def test_a_slip_among_honest_runs_is_held_once_they_contradict_it() -> None:
    """The second test of a life, ten times too many cycles: nothing speaks against it yet."""
    runs = even(1000.0, share=0.95, count=10)
    slipped = runs[1] | {"cycles": 10_000.0}
    bench, _ = sent([runs[0], slipped, *runs[2:8]])
    assert [event.run_id for event in bench.held] == ["t1"]
    # a slip stays held among honest runs
    runs = even(1000.0, share=0.98, count=18)
    slipped = slips.OTHERS["torque at a wrong gain"](np.random.default_rng(3), runs[7])
    bench, states = sent([*runs[:7], slipped, *runs[8:]])
    assert states[7] == "h"
    assert [event.run_id for event in bench.held] == ["t7"]
