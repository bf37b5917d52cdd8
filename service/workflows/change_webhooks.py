"""Receivers of alarms are added and removed, and sent a test."""

import secrets

from service import records
from service.alarms import raising
from service.errors import found
from service.schemas.alarm import AlarmIn, WebhookIn
from storage import keys, webhooks
from storage.alarms import AlarmRow
from storage.engine.database import Database
from storage.webhooks import WebhookRow


def add(database: Database, receiver: WebhookIn, *, by: str, at: str) -> WebhookRow:
    """Add a receiver, with a new secret where none was given. Raises NotFoundError for an unknown clutch."""
    row = WebhookRow(
        webhook_id=secrets.token_hex(8),
        address=receiver.url,
        secret=receiver.secret or secrets.token_urlsafe(32),
        content=receiver.model_dump(mode="json", include={"name", "clutch_id", "cleared"}),
        created_at=at,
        created_by=by,
    )
    with database.writing() as connection:
        if receiver.clutch_id is not None:
            records.clutch(connection, receiver.clutch_id)
        webhooks.insert(connection, row)
    return row


def remove(database: Database, webhook_id: str) -> None:
    """Delete a receiver, its secret and its deliveries. Raises NotFoundError."""
    with database.writing() as connection:
        found(webhooks.get(connection, webhook_id), "webhook", webhook_id)
        webhooks.remove(connection, webhook_id)


def test(database: Database, webhook_id: str, *, at: str) -> list[str]:
    """Put a test into a receiver's outbox; the name of the delivery. Raises NotFoundError."""
    with database.writing() as connection:
        row = found(webhooks.get(connection, webhook_id), "webhook", webhook_id)
        rule = AlarmIn(clutch_id=row.content["clutch_id"], quantity="held_runs", name="test")
        alarm = AlarmRow(
            alarm_id="test",
            clutch_id=rule.clutch_id,
            enabled=True,
            content=rule.model_dump(mode="json"),
            saved_at=at,
            saved_by="",
        )
        return raising.to_receivers(connection, raising.TEST, raising.test_event(alarm), [row])


def inside_allowed(database: Database, setting: bool | None) -> bool:
    """Whether receivers may be within this machine or a private network: as it is set, else while no key was ever made."""
    if setting is not None:
        return setting
    with database.reading() as connection:
        return not keys.any_ever(connection)
