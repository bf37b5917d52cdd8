"""`/v1/alarms`, `/v1/alarms/events`, `/v1/webhooks`: rules, what they have raised, receivers, what these were sent."""

from collections.abc import Collection
from datetime import UTC, datetime

from service.alarms import raising, receivers
from service.api.alarm import (
    AlarmOut,
    AlarmPage,
    DeliveryOut,
    DeliveryPage,
    EventOut,
    EventPage,
    WebhookOut,
    WebhookPage,
)
from service.api.base import of_row
from service.errors import found
from service.paging import Part, by_key, by_name
from storage import alarms, webhooks
from storage.alarms import AlarmRow
from storage.engine.database import Database
from storage.webhooks import DeliveryRow, WebhookRow


def rule_out(row: AlarmRow) -> AlarmOut:
    """A rule in force, as sent to clients."""
    return of_row(AlarmOut, row, **raising.rule_of(row).model_dump())


def page(database: Database, part: Part, *, only: Collection[str] | None = None) -> AlarmPage:
    """A page of rules by name, limited to the clutches `only`."""
    with database.reading() as connection:
        rows = alarms.page(connection, limit=part.most, after=part.name, only=only)
    return part.of(AlarmPage, rows, by_name("alarm_id"), rule_out)


def look_up(database: Database, alarm_id: str, *, only: Collection[str] | None = None) -> AlarmOut:
    """The rule with this id, limited to the clutches `only`. Raises NotFoundError."""
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
) -> EventPage:
    """A page of alarms, newest first, limited to the clutches `only`."""
    with database.reading() as connection:
        rows = alarms.events(connection, limit=part.most, before=part.number, state=state, alarm_id=alarm_id, only=only)
    return part.of(EventPage, rows, by_key("event_key"), raising.event_out)


def event(database: Database, event_id: str, *, only: Collection[str] | None = None) -> EventOut:
    """The alarm with this id, limited to the clutches `only`. Raises NotFoundError."""
    with database.reading() as connection:
        row = alarms.event(connection, event_id)
    return raising.event_out(found(row, "event of an alarm", event_id, only=only))


def receiver_out(row: WebhookRow, *, secret: str | None = None) -> WebhookOut:
    """A receiver as sent to clients: without secrets, except a newly made `secret`."""
    return of_row(WebhookOut, row, url=receivers.shown(row.address), secret=secret, **row.content)


def receivers_by_name(database: Database, part: Part) -> WebhookPage:
    """A page of receivers by name."""
    with database.reading() as connection:
        rows = webhooks.page(connection, limit=part.most, after=part.name)
    return part.of(WebhookPage, rows, by_name("webhook_id"), receiver_out)


def receiver(database: Database, webhook_id: str) -> WebhookOut:
    """The receiver with this id. Raises NotFoundError."""
    with database.reading() as connection:
        return receiver_out(found(webhooks.get(connection, webhook_id), "webhook", webhook_id))


def deliveries(database: Database, webhook_id: str, part: Part) -> DeliveryPage:
    """A page of a receiver's deliveries, sent or waiting, newest first. Raises NotFoundError."""
    with database.reading() as connection:
        found(webhooks.get(connection, webhook_id), "webhook", webhook_id)
        rows = webhooks.deliveries(connection, webhook_id, limit=part.most, before=part.number)
    return part.of(DeliveryPage, rows, by_key("delivery_key"), delivery_out)


def delivered(database: Database, delivery_ids: Collection[str]) -> list[DeliveryOut]:
    """The present state of these deliveries; those of a deleted receiver are left out."""
    with database.reading() as connection:
        rows = [webhooks.find_delivery(connection, delivery_id) for delivery_id in delivery_ids]
    return [delivery_out(row) for row in rows if row is not None]


def delivery_out(row: DeliveryRow) -> DeliveryOut:
    """A delivery as sent to clients, with the time of its next attempt if there will be one."""
    will_retry = row.state == webhooks.WAITING and row.due > 0.0
    next_attempt = datetime.fromtimestamp(row.due, UTC).isoformat(timespec="seconds") if will_retry else None
    return of_row(DeliveryOut, row, next_attempt_at=next_attempt)
