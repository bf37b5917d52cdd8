"""Rules of alarms and their receivers are saved and deleted; alarms are raised and cleared with that, and acknowledged."""

import secrets

from service import repository
from service.alarms import raising
from service.api.alarm import AlarmIn, EventOut, WebhookIn
from service.api.base import MAX_RULES
from service.errors import NotPossibleNowError, found
from storage import alarms, clutches, keys, webhooks
from storage.alarms import AlarmRow
from storage.engine.database import Database
from storage.webhooks import WebhookRow


def save(database: Database, rule: AlarmIn, *, by: str, at: str, alarm_id: str | None = None) -> tuple[AlarmRow, bool]:
    """Save a rule, new or in place of `alarm_id`; returns the rule in force and whether it is new.

    A rule equal to a saved one is not added. Raises NotFoundError for an unknown clutch or rule, NotPossibleNowError if
    MAX_RULES others exist.
    """
    content = rule.model_dump(mode="json")
    with database.writing() as connection:
        if rule.clutch_id is not None:
            repository.clutch(connection, rule.clutch_id)
        same_clutch = [row for row in alarms.page(connection) if row.clutch_id == rule.clutch_id]
        if alarm_id is None:
            same = [row for row in same_clutch if row.content == content]
            if same:
                return same[0], False
        else:
            found(alarms.get(connection, alarm_id), "alarm", alarm_id)
        if sum(row.alarm_id != alarm_id for row in same_clutch) >= MAX_RULES:
            whose = "rules of several clutches" if rule.clutch_id is None else f"rules of clutch {rule.clutch_id!r}"
            raise NotPossibleNowError(f"there are {MAX_RULES} {whose}, which is the maximum: change or delete one")
        row = AlarmRow(
            alarm_id=alarm_id or secrets.token_hex(8),
            clutch_id=rule.clutch_id,
            enabled=rule.enabled,
            content=content,
            saved_at=at,
            saved_by=by,
        )
        concerned = {event.clutch_id for event in alarms.open_of_alarm(connection, row.alarm_id)}
        alarms.put(connection, row)
        concerned |= {rule.clutch_id} if rule.clutch_id is not None else set(clutches.all_ids(connection))
        for clutch_id in sorted(concerned):
            raising.evaluate(connection, clutch_id)
    return row, alarm_id is None


def remove(database: Database, alarm_id: str) -> None:
    """Delete a rule; its alarms are cleared and stay listed. Raises NotFoundError."""
    with database.writing() as connection:
        found(alarms.get(connection, alarm_id), "alarm", alarm_id)
        concerned = [event.clutch_id for event in alarms.open_of_alarm(connection, alarm_id)]
        alarms.remove(connection, alarm_id)
        for clutch_id in concerned:
            raising.evaluate(connection, clutch_id)


def acknowledge(database: Database, event_id: str, *, note: str, by: str, at: str) -> EventOut:
    """Acknowledge a raised alarm in the name of `by`; an acknowledged or cleared alarm is left unchanged. Raises
    NotFoundError."""
    with database.writing() as connection:
        row = found(alarms.event(connection, event_id), "event of an alarm", event_id)
        if row.state == alarms.RAISED:
            alarms.acknowledge(connection, event_id, at=at, by=by, note=note)
        return raising.event_out(found(alarms.event(connection, event_id), "event of an alarm", event_id))


def test(database: Database, alarm_id: str) -> list[str]:
    """Queue a test delivery to each receiver of a rule; returns the ids of the deliveries. Raises NotFoundError."""
    with database.writing() as connection:
        row = found(alarms.get(connection, alarm_id), "alarm", alarm_id)
        receivers = raising.receivers_of(connection, row.clutch_id)
        return raising.to_receivers(connection, raising.TEST, raising.test_event(row), receivers)


def add_receiver(database: Database, receiver: WebhookIn, *, by: str, at: str) -> WebhookRow:
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
            repository.clutch(connection, receiver.clutch_id)
        webhooks.insert(connection, row)
    return row


def remove_receiver(database: Database, webhook_id: str) -> None:
    """Delete a receiver, its secret and its deliveries. Raises NotFoundError."""
    with database.writing() as connection:
        found(webhooks.get(connection, webhook_id), "webhook", webhook_id)
        webhooks.remove(connection, webhook_id)


def test_receiver(database: Database, webhook_id: str, *, at: str) -> list[str]:
    """Queue a test delivery to a receiver; returns its id. Raises NotFoundError."""
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
    """Whether receivers may have addresses on this machine or a private network: as set, else only while no key exists."""
    if setting is not None:
        return setting
    with database.reading() as connection:
        return not keys.any_ever(connection)
