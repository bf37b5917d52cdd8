"""`/v1/alarms`, `/v1/alarms/events`, `/v1/webhooks`: rules, what they have raised, receivers, what these were sent."""

from collections.abc import Collection
from datetime import UTC, datetime
from typing import Any

from service.alarms import raising, receivers
from service.api.alarm import AlarmOut, DeliveryOut
from service.api.base import schema_fields
from service.errors import found
from service.paging import Part, by_key, by_name
from storage import alarms, webhooks
from storage.alarms import AlarmRow
from storage.engine.database import Database
from storage.webhooks import DeliveryRow, WebhookRow


def rule_out(row: AlarmRow) -> dict[str, Any]:
    return schema_fields(AlarmOut, row, **raising.rule_of(row).model_dump(mode="json"))


def page(database: Database, part: Part, *, only: Collection[str] | None = None) -> dict[str, Any]:
    """Rules by name, of `only` these clutches."""
    with database.reading() as connection:
        rows = alarms.page(connection, limit=part.most, after=part.name, only=only)
    return part.of(rows, by_name("alarm_id"), rule_out)


def look_up(database: Database, alarm_id: str, *, only: Collection[str] | None = None) -> dict[str, Any]:
    """A rule, of `only` these clutches. Raises NotFoundError."""
    with database.reading() as connection:
        row = alarms.get(connection, alarm_id)
    return rule_out(found(row, "alarm", alarm_id, only=only))


def events(
    database: Database,
    part: Part,
    *,
    state: str | None = None,
    alarm_id: str | None = None,
    only: Collection[str] | None = None,
) -> dict[str, Any]:
    """What was raised, newest first, of `only` these clutches."""
    with database.reading() as connection:
        rows = alarms.events(connection, limit=part.most, before=part.number, state=state, alarm_id=alarm_id, only=only)
    return part.of(rows, by_key("event_key"), raising.event_out)


def event(database: Database, event_id: str, *, only: Collection[str] | None = None) -> dict[str, Any]:
    """What was raised. Raises NotFoundError."""
    with database.reading() as connection:
        row = alarms.event(connection, event_id)
    return raising.event_out(found(row, "event of an alarm", event_id, only=only))


def receiver_out(row: WebhookRow, *, secret: str | None = None) -> dict[str, Any]:
    """A receiver as it goes out: without what is secret, but for a `secret` that was made just now."""
    return {
        "webhook_id": row.webhook_id,
        "url": receivers.shown(row.address),
        "secret": secret,
        **row.content,
        "created_at": row.created_at,
        "created_by": row.created_by,
    }


def receivers_by_name(database: Database, part: Part) -> dict[str, Any]:
    """Receivers by name."""
    with database.reading() as connection:
        rows = webhooks.page(connection, limit=part.most, after=part.name)
    return part.of(rows, by_name("webhook_id"), receiver_out)


def receiver(database: Database, webhook_id: str) -> dict[str, Any]:
    """A receiver. Raises NotFoundError."""
    with database.reading() as connection:
        return receiver_out(found(webhooks.get(connection, webhook_id), "webhook", webhook_id))


def deliveries(database: Database, webhook_id: str, part: Part) -> dict[str, Any]:
    """What a receiver was sent or is to be sent, newest first. Raises NotFoundError."""
    with database.reading() as connection:
        found(webhooks.get(connection, webhook_id), "webhook", webhook_id)
        rows = webhooks.deliveries(connection, webhook_id, limit=part.most, before=part.number)
    return part.of(rows, by_key("delivery_key"), delivery_out)


def delivered(database: Database, delivery_ids: Collection[str]) -> list[dict[str, Any]]:
    """These deliveries as they are now; those of a receiver that is gone are left out."""
    with database.reading() as connection:
        rows = [webhooks.find_delivery(connection, delivery_id) for delivery_id in delivery_ids]
    return [delivery_out(row) for row in rows if row is not None]


def delivery_out(row: DeliveryRow) -> dict[str, Any]:
    will_retry = row.state == webhooks.WAITING and row.due > 0.0
    next_attempt = datetime.fromtimestamp(row.due, UTC).isoformat(timespec="seconds") if will_retry else None
    return schema_fields(DeliveryOut, row, next_attempt_at=next_attempt)
