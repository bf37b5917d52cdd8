"""Rules, what they raise, receivers and the outbox, in either database."""

from dataclasses import replace

import pytest
from sqlalchemy import Connection
from sqlalchemy.exc import IntegrityError

from storage import alarms, clutches, webhooks
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


def test_a_delivery_is_somebodys_for_a_while_then_anybodys(database: Database) -> None:
    with database.writing() as connection:
        for name in ("w", "other"):
            webhooks.insert(connection, replace(RECEIVER, webhook_id=name))
        for name, receiver in (("d1", "w"), ("d2", "w"), ("d3", "other")):
            new = DeliveryRow(delivery_id=name, webhook_id=receiver, event_id="e1", body="{}", created_at=AT)
            webhooks.insert_delivery(connection, new)
    with database.writing() as connection:
        claimed = webhooks.claim(connection, lease=60.0, most=8)
        assert [row.delivery_id for row in claimed] == ["d1", "d3"], "of each receiver the oldest"
    with database.writing() as connection:
        assert [row.delivery_id for row in webhooks.claim(connection, lease=60.0, most=8, passing=["w"])] == []
        assert [row.delivery_id for row in webhooks.claim(connection, lease=60.0, most=8)] == ["d2"]
        assert not webhooks.any_due(connection)
        webhooks.release_all(connection)
        assert webhooks.any_due(connection)
        (first, _) = webhooks.claim(connection, lease=60.0, most=8)
        webhooks.end(connection, first.delivery_key, webhooks.WAITING, at=AT, status=500, problem="no", pause=0.0)
    with database.writing() as connection:
        (again,) = webhooks.claim(connection, lease=60.0, most=8)
        assert (again.delivery_id, again.attempts, again.problem) == ("d1", 3, "no")
        webhooks.end(connection, again.delivery_key, webhooks.DELIVERED, at=AT, status=200, problem=None)
        stored = webhooks.find_delivery(connection, "d1")
        assert (stored.state, stored.delivered_at, stored.problem) == (webhooks.DELIVERED, AT, None)
        assert webhooks.count_waiting(connection) == 2
        webhooks.remove(connection, "w")
        assert [row.webhook_id for row in webhooks.page(connection)] == ["other"]


def test_since_when_a_rig_is_silent_is_noted_with_the_state(connection: Connection) -> None:
    clutches.set_silent(connection, CLUTCH, AT, state="check")
    row = clutches.get(connection, CLUTCH)
    assert (row.silent, row.state) == (AT, "check")
    assert alarms.last_heard(connection, [CLUTCH]) == {}
