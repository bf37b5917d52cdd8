"""What a filter is given to work with where a fleet has taught, and where none has."""

import numpy as np
import pytest

from models.prognosis.fleet import FleetPrior
from service.lives.assumptions import FLEET, WEAK, Assumptions, LearnedPrior
from service.lives.criteria import PREDICTION_DRAWS
from service.lives.history import lives_of
from service.lives.tracks import CARRIED, advance, drawn
from tests.plausibility.bench import Bench
from tests.support import stationary

FLEET_PRIOR = FleetPrior(clutches=10, mean=np.array([-0.75, 8.5, -0.36, -5.8]), scale=0.05 * np.eye(4), freedom=10.0)


@pytest.mark.parametrize("method", CARRIED)
def test_two_priors_share_particles_and_draws(method: str) -> None:
    bench = Bench({})
    for cycles in (0, 1000, 2000):
        bench.accept(stationary(cycles, run_id=f"s{cycles}"))
    life = lives_of(bench.events)[-1]
    sizes = {}
    for name, assumptions in (
        ("alone", Assumptions()),
        ("taught", Assumptions(prior=LearnedPrior(fleet=FLEET_PRIOR))),
    ):
        series = life.pooled(assumptions)
        tracked = advance("c1", method, series, assumptions, None, 3)
        assert tracked.states.keys() == ({WEAK} if name == "alone" else {WEAK, FLEET})
        assert drawn("c1", method, series, assumptions, tracked).weight.size == PREDICTION_DRAWS
        sizes[name] = {
            key: state.cloud.log_weight.size for key, state in tracked.states.items() if hasattr(state, "cloud")
        }
    if method == "particle":
        assert sizes["taught"] == dict.fromkeys((WEAK, FLEET), sizes["alone"][WEAK] // 2)
