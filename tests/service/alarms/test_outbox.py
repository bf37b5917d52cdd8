"""What waits in the outbox goes out in order, whatever the wall clock does, and is given up after its attempts alone."""

import logging
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
import sqlalchemy as sa
from fastapi.testclient import TestClient

from service.alarms import outbox
from storage import webhooks
from storage.tables import delivery
from storage.webhooks import WaitingRow
from tests.service.alarms.receiving import SECRET, Receiver, receiving
from tests.service.jobs.waiting import until
from tests.service.web.routes.granting import context_of

HELD: dict[str, Any] = {"quantity": "state", "clutch_id": "c1"}


@pytest.fixture
def receiver(client: TestClient) -> Iterator[Receiver]:
    """One that fails at first."""
    with receiving() as made:
        made.status = 500
        body = {"url": made.url, "secret": SECRET, "cleared": True}
        assert client.post("/v1/webhooks", json=body).status_code == 201
        yield made


def raised(client: TestClient) -> str:
    """An alarm; the address of its rule."""
    answer = client.post("/v1/alarms", json=HELD)
    assert answer.status_code == 201, answer.text
    return f"/v1/alarms/{answer.json()['alarm_id']}"


def stored(client: TestClient) -> list[dict[str, Any]]:
    (webhook,) = client.get("/v1/webhooks").json()["items"]
    items: list[dict[str, Any]] = client.get(f"/v1/webhooks/{webhook['webhook_id']}/deliveries").json()["items"]
    return items


def change(client: TestClient, **values: object) -> None:
    """Change all deliveries in the database."""
    with context_of(client).database.writing() as connection:
        connection.execute(sa.update(delivery).values(**values))


def test_what_was_cleared_is_not_sent_before_what_was_raised(client: TestClient, receiver: Receiver) -> None:
    """It overtook an alarm whose first attempt had failed."""
    rule = raised(client)
    receiver.await_requests(1)
    assert client.delete(rule).status_code == 204
    time.sleep(2 * outbox.LOOK_SECONDS)
    receiver.status = 200
    until(lambda: len(receiver.bodies) >= 2 and receiver.bodies[-1]["type"] == "alarm.cleared")
    types = [body["type"] for body in receiver.bodies]
    assert types == ["alarm.raised"] * (len(types) - 1) + ["alarm.cleared"]


def test_an_alarm_behind_one_that_fails_is_sent_to_the_same_receiver(client: TestClient, receiver: Receiver) -> None:
    """Each alarm has an order of its own: one that its receiver does not take holds up no other."""
    receiver.before = lambda _: setattr(
        receiver, "status", 500 if receiver.bodies[-1]["event"]["quantity"] == "state" else 200
    )
    raised(client)
    receiver.await_requests(1)
    other = {"quantity": "verdict", "clutch_id": "c1", "any_of": ["insufficient_data"]}
    assert client.post("/v1/alarms", json=other).status_code == 201
    client.post("/v1/clutches/c1/diagnoses", json={}, headers={"Prefer": "wait=60"})
    until(lambda: [item["state"] for item in stored(client)] == ["delivered", "waiting"])


def test_an_attempt_that_ends_while_the_outbox_is_read_is_followed_by_a_pause(
    client: TestClient, receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was read before its end had another state than was planned for, and was tried at once, again and again."""
    box, next_ones, read = context_of(client).outbox, webhooks.next_ones, threading.Event()
    looks = []

    def stale(connection: sa.Connection) -> list[WaitingRow]:
        rows = next_ones(connection)
        if box._busy:
            read.set()
            until(lambda: not box._busy)
            looks.append("stale")
        elif read.is_set():
            looks.append("after")
        return rows

    monkeypatch.setattr(outbox, "FIRST_PAUSE", 1800.0)
    monkeypatch.setattr(webhooks, "next_ones", stale)
    receiver.before = lambda _: read.wait(60)
    raised(client)
    until(lambda: looks.count("after") > 2)
    assert (looks[0], stored(client)[0]["attempts"], len(receiver.requests)) == ("stale", 1, 1)


def test_an_attempt_whose_end_is_not_stored_is_made_again_after_its_pause(
    client: TestClient, receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was made again after a minute."""
    store, failed = outbox._store, threading.Event()

    def fail_once(*arguments: Any) -> Any:
        if not failed.is_set():
            failed.set()
            raise OSError("the lock could not be taken")
        return store(*arguments)

    monkeypatch.setattr(outbox, "_store", fail_once)
    monkeypatch.setattr(outbox, "LEASE_SECONDS", 1e9)
    raised(client)
    receiver.await_requests(1)
    receiver.status = 200
    until(lambda: [item["state"] for item in stored(client)] == ["delivered"])


def test_a_clock_set_back_by_a_day_delays_nothing(client: TestClient, receiver: Receiver) -> None:
    """What was to be tried in a second was tried a day and a second later."""
    raised(client)
    receiver.await_requests(1)
    until(lambda: stored(client)[0]["problem"] is not None)
    change(client, due=time.time() + 86_400.0)  # as seen by a clock that was set back meanwhile
    receiver.status = 200
    receiver.await_requests(2)


def test_a_clock_set_forward_by_ten_days_drops_nothing(client: TestClient, receiver: Receiver) -> None:
    """The first failure after that was taken for the end of three days."""
    receiver.before = lambda _: time.sleep(0.5)  # the time in which the clock is set
    raised(client)
    receiver.await_requests(1)
    change(client, created_at="2020-01-01T00:00:00.000+00:00")
    until(lambda: stored(client)[0]["problem"] is not None)
    receiver.await_requests(2)
    receiver.status = 200
    until(lambda: stored(client)[0]["state"] == "delivered")


def test_an_alarm_is_given_up_after_its_attempts_and_says_so(
    client: TestClient, receiver: Receiver, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    assert receiver.status == 500
    monkeypatch.setattr(outbox, "MAX_ATTEMPTS", 2)
    monkeypatch.setattr(outbox, "FIRST_PAUSE", 0.1)
    raised(client)
    until(lambda: stored(client)[0]["state"] == "failed")
    assert stored(client)[0]["problem"] == "given up after 2 attempts: the receiver answered 500"
    assert [record.levelno for record in caplog.records if "given up after 2 attempts" in record.message] == [
        logging.ERROR
    ]


def test_the_attempts_take_three_days() -> None:
    seconds = sum(outbox.pause_after(number) for number in range(1, outbox.MAX_ATTEMPTS))
    assert 3 * 86_400 <= seconds < 3 * 86_400 + outbox.LAST_PAUSE
