"""The tables of receivers and of deliveries that wait.

What a receiver is sent of one alarm goes in the order in which it was put here: only the oldest that waits is tried. When,
the caller decides: no clock of the database is asked. Whoever tries one counts the attempt first; where two would, one does.
"""

from dataclasses import dataclass

from sqlalchemy import Connection, delete, func, select, update

from storage.dialects import newest_first, now_in_seconds
from storage.encoding import Json
from storage.rows import Rows
from storage.tables import WAITING_ONLY, delivery, webhook

WAITING, DELIVERED, FAILED = "waiting", "delivered", "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class WebhookRow:
    """A receiver: its `address`, which may hold a password, the `secret` for signatures, and the other posted fields."""

    webhook_id: str
    address: str
    secret: str
    content: Json
    created_at: str
    created_by: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DeliveryRow:
    """A delivery to a receiver, of an alarm or (None) a test: the body's bytes as text. `status` and `problem` are
    those of the last attempt; `due`: the planned time of the next [s since 1970], for information only.
    """

    delivery_id: str
    webhook_id: str
    event_id: str | None
    body: str
    created_at: str
    delivery_key: int = 0
    state: str = WAITING
    due: float = 0.0
    attempts: int = 0
    last_attempt_at: str | None = None
    delivered_at: str | None = None
    status: int | None = None
    problem: str | None = None


# receivers are read where runs are stored: a damaged one may miss an alarm, but keeps no run out
_receivers, _deliveries = Rows(WebhookRow, of=webhook, checked=False), Rows(DeliveryRow, key="delivery_key")
#: A test is of no alarm.
_of_one_alarm = (delivery.c.webhook_id, func.coalesce(delivery.c.event_id, delivery.c.delivery_id))
_oldest_of_each = select(func.min(delivery.c.delivery_key)).where(WAITING_ONLY).group_by(*_of_one_alarm)


@dataclass(frozen=True, slots=True, kw_only=True)
class WaitingRow:
    """A waiting delivery: the number of attempts, and when the last one ended."""

    delivery_key: int
    webhook_id: str
    attempts: int
    last_attempt_at: str | None


_waiting = Rows(WaitingRow)


def insert(connection: Connection, row: WebhookRow) -> None:
    """Store a receiver. Raises IntegrityError where its name is taken."""
    connection.execute(webhook.insert(), _receivers.values(row))


def get(connection: Connection, webhook_id: str) -> WebhookRow | None:
    return _receivers.first(connection.execute(select(webhook).where(webhook.c.webhook_id == webhook_id)))


def page(connection: Connection, *, limit: int | None = None, after: str = "") -> list[WebhookRow]:
    """A page of receivers by name, after the name `after`."""
    query = select(webhook).where(webhook.c.webhook_id > after).order_by(webhook.c.webhook_id).limit(limit)
    return _receivers.all(connection.execute(query))


def remove(connection: Connection, webhook_id: str) -> None:
    """Delete a receiver, its secret and all its deliveries."""
    connection.execute(delete(delivery).where(delivery.c.webhook_id == webhook_id))
    connection.execute(delete(webhook).where(webhook.c.webhook_id == webhook_id))


def insert_delivery(connection: Connection, row: DeliveryRow) -> None:
    """Put a delivery into the outbox, due at once."""
    connection.execute(delivery.insert(), _deliveries.values(row))


def find_delivery(connection: Connection, delivery_id: str) -> DeliveryRow | None:
    return _deliveries.first(connection.execute(select(delivery).where(delivery.c.delivery_id == delivery_id)))


def deliveries(
    connection: Connection, webhook_id: str, *, limit: int, before: float | None = None
) -> list[DeliveryRow]:
    """A receiver's deliveries, sent or waiting, newest first; `before`: the key of the previous page's last delivery."""
    of_receiver = select(delivery).where(delivery.c.webhook_id == webhook_id)
    query = newest_first(of_receiver, delivery.c.delivery_key, before=before, limit=limit)
    return _deliveries.all(connection.execute(query))


def next_ones(connection: Connection) -> list[WaitingRow]:
    """The oldest waiting delivery of each receiver and alarm, oldest first."""
    query = select(*(delivery.c[name] for name in _waiting.names)).where(delivery.c.delivery_key.in_(_oldest_of_each))
    return _waiting.all(connection.execute(query.order_by(delivery.c.delivery_key)))


def claim(connection: Connection, row: WaitingRow) -> DeliveryRow | None:
    """Count an attempt, to be made by the caller; None if another process counted one since, or the delivery no longer
    waits."""
    this = (delivery.c.delivery_key == row.delivery_key, WAITING_ONLY, delivery.c.attempts == row.attempts)
    if connection.execute(update(delivery).where(*this).values(attempts=row.attempts + 1)).rowcount != 1:
        return None
    return _deliveries.first(connection.execute(select(delivery).where(delivery.c.delivery_key == row.delivery_key)))


def end(
    connection: Connection,
    delivery_key: int,
    state: str,
    *,
    at: str,
    status: int | None,
    problem: str | None,
    pause: float = 0.0,
) -> None:
    """Store an attempt's result: delivered, given up, or (`waiting`) to be repeated after `pause` [s]."""
    ended = {"state": state, "last_attempt_at": at, "status": status, "problem": problem}
    delivered = {"delivered_at": at if state == DELIVERED else None, "due": now_in_seconds() + pause}
    this = update(delivery).where(delivery.c.delivery_key == delivery_key, WAITING_ONLY)
    connection.execute(this.values(ended | delivered))


def count_waiting(connection: Connection) -> int:
    return int(connection.execute(select(func.count()).select_from(delivery).where(WAITING_ONLY)).scalar_one())
