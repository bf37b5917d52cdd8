"""A service that is killed between raising an alarm and delivering it: delivered once or twice, never not."""

from contextlib import suppress
from pathlib import Path

import pytest

from service.client.clutchlife import Client, ServiceAwayError
from tests.service.alarms.receiving import SECRET, Receiver, receiving
from tests.support import Server, one_quick, stationary

CYCLES = (0.0, 1000.0, 2000.0, 3000.0)


def prepared(server: Server, receiver: Receiver) -> None:
    """A clutch whose next test raises an alarm, and the receiver."""
    with Client(server.url) as client:
        client.register("e")
        for cycles in CYCLES:
            client.post_run("e", stationary(cycles))
        client.service.post("/v1/webhooks", {"url": receiver.url, "secret": SECRET})
        client.service.post("/v1/alarms", {"clutch_id": "e", "quantity": "held_runs"})


def raise_alarm(server: Server) -> None:
    """Post the test; the service may be killed before it has answered, and has stored it then."""
    with Client(server.url, patience=0.0) as client, suppress(ServiceAwayError):
        assert client.post_run("e", stationary(4000.0, wear=0.0))["state"] == "held"


@pytest.mark.parametrize("answers", one_quick([True, False]), ids=["while it is asked", "before the receiver is asked"])
def test_a_killed_service_delivers_after_its_next_start(tmp_path: Path, answers: bool) -> None:
    server = Server(tmp_path / "clutchlife.db", loaded=True)
    server.start()
    with receiving() as receiver:
        prepared(server, receiver)
        if answers:  # the request has arrived, and its answer never does
            receiver.before = lambda _handler: server.kill() if server.exit_code() is None else None
            raise_alarm(server)
            receiver.await_requests(1)
        else:
            receiver.status = 503  # taken by nobody
            raise_alarm(server)
            server.kill()
            receiver.status = 200
        receiver.before = lambda _handler: None
        before = len(receiver.requests)
        server.start()
        try:
            bodies = receiver.await_requests(before + 1)
            assert len({body["event"]["event_id"] for body in bodies}) == 1
            assert len({body["delivery_id"] for body in bodies}) == 1
            with Client(server.url, frames="list") as client:
                (webhook,) = client.service.pages("/v1/webhooks")
                address = f"/v1/webhooks/{webhook['webhook_id']}/deliveries"
                (item,) = client.service.pages(address)
            assert item["state"] in ("delivered", "waiting")
            assert len(bodies) - before <= 1
        finally:
            server.stop()
