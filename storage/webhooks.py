"""The tables of receivers and of deliveries that wait.

A delivery waits until it is `due`. Whoever tries it moves that on first (a lease): where its process is killed meanwhile,
it is due again when the lease has run out. So each is sent at least once.
"""

from collections.abc import Collection
from dataclasses import dataclass

from sqlalchemy import Connection, delete, exists, func, select, update

from storage.dialects import newest_first, now_in_seconds
from storage.encoding import Json, Rows
from storage.tables import WAITING_ONLY, delivery, webhook

WAITING, DELIVERED, FAILED = "waiting", "delivered", "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class WebhookRow:
    """A receiver: its `address`, which may hold a password, the `secret` that signs, and what else was posted."""

    webhook_id: str
    address: str
    secret: str
    content: Json
    created_at: str
    created_by: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DeliveryRow:
    """What a receiver is to be sent, of an alarm or (None) as a test: the bytes of the body, as text. `status` and `problem`
    are of the last attempt, `due` of the next, in seconds since 1970.
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


_receivers, _deliveries = Rows(WebhookRow), Rows(DeliveryRow, key="delivery_key")
_of_same = delivery.alias("of_same")
_oldest_of_each = (
    select(func.min(_of_same.c.delivery_key))
    .where(_of_same.c.state == WAITING, _of_same.c.due <= now_in_seconds())
    .group_by(_of_same.c.webhook_id)
)
_due = (
    select(delivery.c.delivery_key)
    .where(WAITING_ONLY, delivery.c.delivery_key.in_(_oldest_of_each))
    .order_by(delivery.c.due)
    .with_for_update(skip_locked=True, of=delivery)
)


def insert(connection: Connection, row: WebhookRow) -> None:
    """Store a receiver. Raises IntegrityError where its name is taken."""
    connection.execute(webhook.insert(), _receivers.values(row))


def get(connection: Connection, webhook_id: str) -> WebhookRow | None:
    return _receivers.first(connection.execute(select(webhook).where(webhook.c.webhook_id == webhook_id)))


def page(connection: Connection, *, limit: int | None = None, after: str = "") -> list[WebhookRow]:
    """Receivers by name, behind the name `after`."""
    query = select(webhook).where(webhook.c.webhook_id > after).order_by(webhook.c.webhook_id).limit(limit)
    return _receivers.all(connection.execute(query))


def remove(connection: Connection, webhook_id: str) -> None:
    """Delete a receiver with its secret, and all that was sent or is to be sent to it."""
    connection.execute(delete(delivery).where(delivery.c.webhook_id == webhook_id))
    connection.execute(delete(webhook).where(webhook.c.webhook_id == webhook_id))


def insert_delivery(connection: Connection, row: DeliveryRow) -> None:
    """Put what is to be sent into the outbox, due at once."""
    connection.execute(delivery.insert(), _deliveries.values(row))


def find_delivery(connection: Connection, delivery_id: str) -> DeliveryRow | None:
    return _deliveries.first(connection.execute(select(delivery).where(delivery.c.delivery_id == delivery_id)))


def deliveries(
    connection: Connection, webhook_id: str, *, limit: int, before: float | None = None
) -> list[DeliveryRow]:
    """What was sent or is to be sent to a receiver, newest first; `before` is the key of the last of the page before."""
    of_receiver = select(delivery).where(delivery.c.webhook_id == webhook_id)
    query = newest_first(of_receiver, delivery.c.delivery_key, before=before, limit=limit)
    return _deliveries.all(connection.execute(query))


def any_due(connection: Connection) -> bool:
    due = select(delivery.c.delivery_key).where(WAITING_ONLY, delivery.c.due <= now_in_seconds())
    return bool(connection.execute(select(exists(due))).scalar_one())


def claim(connection: Connection, *, lease: float, most: int, passing: Collection[str] = ()) -> list[DeliveryRow]:
    """At most so many that are due, the oldest of each receiver but of those `passing` over: the caller's for `lease`
    [s]."""
    due = _due.where(delivery.c.webhook_id.not_in(sorted(passing))).limit(most)
    rows = []
    for key in connection.execute(due).scalars().all():
        this = delivery.c.delivery_key == key
        claimed = {"due": now_in_seconds() + lease, "attempts": delivery.c.attempts + 1}
        connection.execute(update(delivery).where(this).values(claimed))
        rows += _deliveries.all(connection.execute(select(delivery).where(this)))
    return rows


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
    """Store how an attempt ended: delivered, given up, or (`waiting`) to be tried again after `pause` [s]."""
    ended = {"state": state, "last_attempt_at": at, "status": status, "problem": problem}
    delivered = {"delivered_at": at if state == DELIVERED else None, "due": now_in_seconds() + pause}
    this = update(delivery).where(delivery.c.delivery_key == delivery_key, WAITING_ONLY)
    connection.execute(this.values(ended | delivered))


def release_all(connection: Connection) -> None:
    """Have what was claimed for its first attempt be due now: no process runs that could be sending it."""
    unsent = (WAITING_ONLY, delivery.c.last_attempt_at.is_(None))
    connection.execute(update(delivery).where(*unsent).values(due=0.0))


def count_waiting(connection: Connection) -> int:
    return int(connection.execute(select(func.count()).select_from(delivery).where(WAITING_ONLY)).scalar_one())
