"""What a filter is given to work with where a fleet has taught, and where none has; and what its draws depend on."""

from pathlib import Path

import numpy as np
import pytest

from models.prognosis.fleet import FleetPrior
from service.lives.assumptions import FLEET, WEAK, Assumptions, LearnedPrior
from service.lives.criteria import PREDICTION_DRAWS
from service.lives.history import lives_of
from service.lives.tracks import CARRIED, METHODS, advance, drawn
from tests.plausibility.bench import Bench
from tests.service.clients import client_on
from tests.support import stationary

LIFE = "/v1/clutches/{}/remaining-useful-life"

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
        tracked = advance(method, series, assumptions, None, 3)
        assert tracked.states.keys() == ({WEAK} if name == "alone" else {WEAK, FLEET})
        assert drawn(method, series, assumptions, tracked).weight.size == PREDICTION_DRAWS
        sizes[name] = {
            key: state.cloud.log_weight.size for key, state in tracked.states.items() if hasattr(state, "cloud")
        }
    if method == "particle":
        assert sizes["taught"] == dict.fromkeys((WEAK, FLEET), sizes["alone"][WEAK] // 2)


def test_the_same_runs_under_another_clutch_name_give_the_same_remaining_life(tmp_path: Path) -> None:
    with client_on(f"sqlite:///{tmp_path / 'named.db'}") as client:
        said = []
        for name in ("press-4", "another"):
            assert client.post("/v1/clutches", json={"clutch_id": name}).status_code == 201
            for cycles in range(0, 4_001, 1_000):
                body = stationary(cycles, run_id=f"{cycles}", pressures=(5.0,))
                assert client.post(f"/v1/clutches/{name}/runs", json=body).status_code == 201
            said.append([client.get(LIFE.format(name), params={"method": method}).json() for method in METHODS])
    for one, other in zip(*said, strict=True):
        assert one["remaining_cycles"] == other["remaining_cycles"]
        assert one["current"] == other["current"]
