"""`python -m tests.lab.benchmarks.diagnosis`: how long a diagnosis takes; `make load` times GETs meanwhile."""

import json
import statistics
import time
from collections.abc import Iterator

import httpx2
import numpy as np

from models.diagnosis.diagnose import diagnose
from models.rig import campaign
from models.rig.programme import QUICK, WHOLE, RigProgramme
from models.rig.temperatures import warmed
from service.runs.simulated import simulated_body
from tests.lab.blind.rig import sent
from tests.lab.blind.rig.hide import hide
from tests.lab.blind.test_blind import FAMILIES
from tests.lab.measuring import show
from tests.support import served

SEED = 10


def post_life(http: httpx2.Client, clutch_id: str, states: int, programme: RigProgramme) -> None:
    """A simulated life of so many states, an effect of oil temperature in its stationary tests."""
    clutch = campaign.simulated_clutch(1)
    http.post("/v1/clutches", json={"clutch_id": clutch_id})
    for run in campaign.simulate(1, programme=programme, stop_fraction=0.01, most_tests=states):
        body = simulated_body(run)
        if run.plateaus is not None:
            body["channels"]["torque_nm"] = warmed(run.plateaus, clutch, run.wear).torque.tolist()
        headers = {"Content-Type": "application/json"}
        http.post(f"/v1/clutches/{clutch_id}/runs", content=json.dumps(body), headers=headers).raise_for_status()


def verdict_seconds(slugs: tuple[str, ...], lam: float, count: int) -> list[float]:
    """Seconds of one core that verdicts on campaigns of ten states with loops take, reading them excluded."""
    taken = []
    for number in range(count):
        given = sent.campaign(hide((SEED, number), slugs, lam, states=10))
        start = time.process_time()
        diagnose(given, rng=np.random.default_rng(number))
        taken.append(time.process_time() - start)
    return taken


def verdicts() -> Iterator[dict[str, object]]:
    """What verdicts take where nothing, one effect or two effects are hidden."""
    hidden = {
        "nothing hidden": [((), 0.0, 6)],
        "one effect, λ = 50": [((slug,), 50.0, 1) for slug in FAMILIES.values()],
        "two effects, λ = 50 each": [(("oil_temperature", "inertia_torque"), 50.0, 2)],
        "one effect, λ = 1000": [((slug,), 1000.0, 1) for slug in FAMILIES.values()],
    }
    for name, kinds in hidden.items():
        taken = [seconds for kind in kinds for seconds in verdict_seconds(*kind)]
        yield {
            "verdict on 10 states with loops": name,
            "campaigns": len(taken),
            "median, s of one core": f"{statistics.median(taken):.1f}",
            "longest, s": f"{max(taken):.1f}",
        }


def main() -> None:
    """Lives of two lengths, diagnosed by a service; then campaigns of the blind rig, by the diagnosis alone."""
    times = []
    with served() as (_, http):
        for name, states, programme in (("10 states with loops", 10, WHOLE), ("60 states", 60, QUICK)):
            clutch_id = name.replace(" ", "-")
            post_life(http, clutch_id, states, programme)
            began = time.perf_counter()
            answer = http.post(f"/v1/clutches/{clutch_id}/diagnoses", json={}, headers={"Prefer": "wait=110"})
            over, report = time.perf_counter() - began, answer.json()
            verdict = f"{report['verdict']}: {', '.join(report['causes'])}"
            diagnosed = "diagnosis, its process' start and remaining life included"
            times.append({diagnosed: name, "s": f"{over:.1f}", "verdict": verdict})
    show("## A diagnosis", times)
    show("## Verdicts", verdicts())


if __name__ == "__main__":
    main()
