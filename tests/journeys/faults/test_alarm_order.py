"""What a receiver is sent of one alarm comes in order, whatever it answers and however often the service is killed."""

import random
import threading
import time
from collections import defaultdict
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx2
import pytest

from tests.service.alarms.receiving import SECRET, Receiver, receiving
from tests.service.jobs.waiting import until
from tests.support import Server

pytestmark = pytest.mark.slow

RAISED, CLEARED = "alarm.raised", "alarm.cleared"
STEPS, KILLS, RECEIVERS = 48, 6, 3


def of_events(receiver: Receiver) -> dict[str, list[str]]:
    """What arrived of each alarm, in order."""
    types: dict[str, list[str]] = defaultdict(list)
    for body in receiver.bodies:
        types[body["event"]["event_id"]].append(body["type"])
    return types


def fails_often(receiver: Receiver, rng: random.Random, mended: threading.Event) -> None:
    """Have a receiver fail at half of what it is sent, and take its time, until it is mended."""

    def before(_handler: Any) -> None:
        time.sleep(rng.uniform(0.0, 0.2))
        receiver.status = 200 if mended.is_set() else rng.choice([200, 500])

    receiver.before = before


@pytest.mark.parametrize("seed", range(3))
def test_no_receiver_is_sent_that_an_alarm_cleared_before_that_it_was_raised(tmp_path: Path, seed: int) -> None:
    """Each receiver gets both of every alarm, in this order: again where it failed or the service was killed, but never the
    first behind the second."""
    rng, mended = random.Random(seed), threading.Event()  # noqa: S311
    server = Server(tmp_path / "a.db", loaded=True)
    server.start()
    with ExitStack() as stack:
        receivers = [stack.enter_context(receiving()) for _ in range(RECEIVERS)]
        for receiver in receivers:
            fails_often(receiver, rng, mended)
            body = {"url": receiver.url, "secret": SECRET, "cleared": True}
            assert server.http.post("/v1/webhooks", json=body).status_code == 201
        for number in range(STEPS):
            assert server.http.post("/v1/clutches", json={"clutch_id": f"c{number}"}).status_code == 201
        killed = set(rng.sample(range(1, STEPS), KILLS))
        rules: list[str] = []
        for step in range(STEPS):
            if step in killed:
                server.kill()
                server.start()
            with httpx2.Client(base_url=server.url, timeout=60) as http:
                if len(rules) > 4 or len(rules) == STEPS - step:
                    assert http.delete(f"/v1/alarms/{rules.pop(rng.randrange(len(rules)))}").status_code == 204
                else:
                    made = http.post("/v1/alarms", json={"quantity": "state", "clutch_id": f"c{step}"})
                    assert made.status_code == 201
                    rules.append(made.json()["alarm_id"])
        mended.set()
        server.kill()
        server.start()  # it tries what waits at once
        names = [item["webhook_id"] for item in server.http.get("/v1/webhooks").json()["items"]]

        def states() -> set[str]:
            pages = [server.http.get(f"/v1/webhooks/{name}/deliveries?limit=1000").json()["items"] for name in names]
            return {item["state"] for items in pages for item in items}

        until(lambda: states() == {"delivered"}, within=120)
        assert server.stop() == 0
        raised = {event for receiver in receivers for event in of_events(receiver)}
        assert len(raised) == STEPS // 2
        for receiver in receivers:
            arrived = of_events(receiver)
            assert arrived.keys() == raised
            for event, types in arrived.items():
                assert types == sorted(types, key=[RAISED, CLEARED].index), (event, types)
                assert set(types) == {RAISED, CLEARED}, (event, types)
