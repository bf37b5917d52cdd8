"""Rules, what they raise, receivers and the outbox, in either database."""

from dataclasses import replace

import pytest
from sqlalchemy.exc import IntegrityError

from storage import alarms, clutches, webhooks
from storage.alarms import AlarmRow, NewEvent
from storage.engine.database import Database
from storage.webhooks import NewDelivery, WebhookRow
from tests.storage.samples import clutch_row

AT = "2026-11-02T10:00:00+00:00"
RULE = AlarmRow(alarm_id="a", clutch_id="c1", enabled=True, content={"quantity": "state"}, saved_at=AT, saved_by="me")
EVENT = NewEvent(
    event_id="e1", alarm_id="a", clutch_id="c1", quantity="state", mark="", content={"message": "m"}, raised_at=AT
)
RECEIVER = WebhookRow(
    webhook_id="w", address="https://example.org", secret="s",  # noqa: S106
    content={"clutch_id": None}, created_at=AT, created_by="me"
)  # fmt: skip


def filled(database: Database) -> None:
    with database.writing() as connection:
        for name in ("c1", "c2"):
            clutches.insert(connection, clutch_row(name))
        alarms.put(connection, RULE)
        webhooks.insert(connection, RECEIVER)


def delivery(name: str, webhook_id: str = "w") -> NewDelivery:
    return NewDelivery(delivery_id=name, webhook_id=webhook_id, event_id="e1", body="{}", created_at=AT)


def test_rules_are_kept_replaced_and_removed(database: Database) -> None:
    filled(database)
    of_all = replace(RULE, alarm_id="b", clutch_id=None)
    with database.writing() as connection:
        alarms.put(connection, replace(RULE, enabled=False))
        alarms.put(connection, of_all)
        assert alarms.enabled(connection, "c2") == [of_all]
        assert alarms.page(connection, limit=10) == [replace(RULE, enabled=False), of_all]
        assert alarms.page(connection, limit=10, only=["c1"]) == [replace(RULE, enabled=False)]
        alarms.remove(connection, "b")
        assert alarms.get(connection, "b") is None


def test_a_rule_has_one_open_alarm_of_a_clutch(database: Database) -> None:
    filled(database)
    with database.writing() as connection:
        alarms.insert_event(connection, EVENT)
    with pytest.raises(IntegrityError), database.writing() as connection:
        alarms.insert_event(connection, replace(EVENT, event_id="e2"))
    with database.writing() as connection:
        alarms.clear(connection, "e1", AT, EVENT.content)
        alarms.insert_event(connection, replace(EVENT, event_id="e2"))
        alarms.acknowledge(connection, "e2", at=AT, by="me", note="seen")
        states = {row.event_id: row.state for row in alarms.events(connection)}
        assert states == {"e2": alarms.ACKNOWLEDGED, "e1": alarms.CLEARED}
        assert [row.event_id for row in alarms.events(connection, state="open", only=["c1"])] == ["e2"]
        assert list(alarms.open_of_clutch(connection, "c1")) == ["a"]


def test_a_delivery_is_somebodys_for_a_while_then_anybodys(database: Database) -> None:
    filled(database)
    with database.writing() as connection:
        webhooks.insert(connection, replace(RECEIVER, webhook_id="other"))
        for name, receiver in (("d1", "w"), ("d2", "w"), ("d3", "other")):
            webhooks.insert_delivery(connection, delivery(name, receiver))
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
        assert stored is not None
        assert (stored.state, stored.delivered_at, stored.problem) == (webhooks.DELIVERED, AT, None)
        assert webhooks.count_waiting(connection) == 2
        webhooks.remove(connection, "w")
        assert [row.webhook_id for row in webhooks.page(connection)] == ["other"]


def test_since_when_a_rig_is_silent_is_noted_with_the_state(database: Database) -> None:
    filled(database)
    with database.writing() as connection:
        clutches.set_silent(connection, "c1", AT, state="check")
        row = clutches.get(connection, "c1")
        assert row is not None
        assert (row.silent, row.state) == (AT, "check")
        assert alarms.last_heard(connection, ["c1"]) == {}
