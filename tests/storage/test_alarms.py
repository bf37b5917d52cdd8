"""Rules, what they raise, receivers and the outbox, in either database."""

from dataclasses import replace

import pytest
from sqlalchemy import Connection
from sqlalchemy.exc import IntegrityError

from storage import alarms, webhooks
from storage.alarms import AlarmRow, EventRow
from storage.engine.database import Database
from storage.webhooks import DeliveryRow, WebhookRow
from tests.storage.samples import CLUTCH

AT = "2026-11-02T10:00:00+00:00"
RULE = AlarmRow(alarm_id="a", clutch_id=CLUTCH, enabled=True, content={"quantity": "state"}, saved_at=AT, saved_by="me")
EVENT = EventRow(event_id="e1", alarm_id="a", clutch_id=CLUTCH, quantity="state", mark="", content={}, raised_at=AT)
RECEIVER = WebhookRow(
    webhook_id="w", address="https://example.org", secret="", content={}, created_at=AT, created_by=""
)


def test_rules_are_kept_replaced_and_removed(connection: Connection) -> None:
    disabled, of_all = replace(RULE, enabled=False), replace(RULE, alarm_id="b", clutch_id=None)
    for rule in (RULE, disabled, of_all):
        alarms.put(connection, rule)
    assert alarms.enabled(connection, "other") == [of_all]
    assert alarms.page(connection, limit=10) == [disabled, of_all]
    assert alarms.page(connection, limit=10, only=[CLUTCH]) == [disabled]
    alarms.remove(connection, "b")
    assert alarms.get(connection, "b") is None


def test_a_rule_has_one_open_alarm_of_a_clutch(connection: Connection) -> None:
    alarms.put(connection, RULE)
    alarms.insert_event(connection, EVENT)
    with pytest.raises(IntegrityError), connection.begin_nested():
        alarms.insert_event(connection, replace(EVENT, event_id="e2"))
    alarms.clear(connection, "e1", AT, EVENT.content)
    alarms.insert_event(connection, replace(EVENT, event_id="e2"))
    alarms.acknowledge(connection, "e2", at=AT, by="me", note="seen")
    states = {row.event_id: row.state for row in alarms.events(connection)}
    assert states == {"e2": alarms.ACKNOWLEDGED, "e1": alarms.CLEARED}
    assert [row.event_id for row in alarms.events(connection, state="open", only=[CLUTCH])] == ["e2"]
    assert list(alarms.open_of_clutch(connection, CLUTCH)) == ["a"]


def test_of_one_alarm_a_receiver_is_sent_what_came_first(database: Database) -> None:
    with database.writing() as connection:
        for name in ("w", "other"):
            webhooks.insert(connection, replace(RECEIVER, webhook_id=name))
        for name, receiver, event in (
            ("raised", "w", "e1"), ("cleared", "w", "e1"), ("of another", "w", "e2"), ("raised too", "other", "e1"),
            ("test", "w", None), ("test too", "w", None),
        ):  # fmt: skip
            new = DeliveryRow(delivery_id=name, webhook_id=receiver, event_id=event, body="{}", created_at=AT)
            webhooks.insert_delivery(connection, new)

    def next_ones() -> list[str]:
        with database.reading() as connection:
            names = [webhooks.deliveries(connection, name, limit=9) for name in ("w", "other")]
            named = {row.delivery_key: row.delivery_id for rows in names for row in rows}
            return [named[row.delivery_key] for row in webhooks.next_ones(connection)]

    assert next_ones() == ["raised", "of another", "raised too", "test", "test too"]
    with database.writing() as connection:
        first = webhooks.next_ones(connection)[0]
        claimed = webhooks.claim(connection, first)
        assert (claimed.delivery_id, claimed.attempts) == ("raised", 1)
        assert webhooks.claim(connection, first) is None, "another has claimed it"
        webhooks.end(connection, first.delivery_key, webhooks.WAITING, at=AT, status=500, problem="no", pause=9.0)
    assert next_ones()[0] == "raised", "what waits for its next attempt is not passed"
    with database.writing() as connection:
        (again, *_) = webhooks.next_ones(connection)
        assert (again.attempts, again.last_attempt_at) == (1, AT)
        claimed = webhooks.claim(connection, again)
        assert (claimed.attempts, claimed.problem) == (2, "no")
        webhooks.end(connection, claimed.delivery_key, webhooks.DELIVERED, at=AT, status=200, problem=None)
        stored = webhooks.find_delivery(connection, "raised")
        assert (stored.state, stored.delivered_at, stored.problem) == (webhooks.DELIVERED, AT, None)
        assert webhooks.claim(connection, replace(again, attempts=2)) is None, "it waits no longer"
        assert webhooks.count_waiting(connection) == 5
    assert next_ones() == ["cleared", "of another", "raised too", "test", "test too"]
    with database.writing() as connection:
        webhooks.remove(connection, "w")
        assert [row.webhook_id for row in webhooks.page(connection)] == ["other"]
