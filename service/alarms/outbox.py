"""The outbox: a thread of the service sends alarms until their receivers have taken them, and raises alarms of silent rigs.

At least once: an attempt takes its delivery for some time and ends it afterwards. Where the service is killed between the
two, the delivery is due again when that time has run out, or at the next start.
"""

import logging
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime

from sqlalchemy import Connection

from service.alarms import notify, raising
from service.alarms.receivers import Attempt
from service.api.clutch import ClutchIn
from service.settings import Settings
from storage import alarms, clutches, keys, webhooks
from storage.engine.database import Database
from storage.engine.errors import StorageError
from storage.webhooks import DeliveryRow, WebhookRow

#: [s] Between two looks into the outbox, and at the clock for silent rigs. Chosen: an alarm arrives while the page still
#: loads; a rig is silent for hours.
LOOK_SECONDS, CLOCK_SECONDS = 0.5, 10.0
#: [s] An attempt's delivery is nobody else's. Derived: an attempt, its name's resolution, a busy database.
LEASE_SECONDS = 60.0
#: Attempts at once. Chosen: one receiver that does not answer holds up no other, for of each there is one at a time.
_AT_ONCE = 8
#: [s] The pause after an attempt doubles up to the greatest; a delivery is given up when it is so old. Chosen: a receiver
#: that is down over a weekend learns of it.
FIRST_PAUSE, LAST_PAUSE, LONGEST = 1.0, 3600.0, 3 * 86400.0
_SECONDS_PER_HOUR = 3600.0
_log = logging.getLogger("clutchlife")


class Outbox:
    """The thread that delivers. `start` it once the database is open, `close` it before that is closed."""

    def __init__(self, database: Database, settings: Settings) -> None:
        self._database = database
        self._settings = settings
        self._change = threading.Condition()
        self._closing = False
        self._woken = False
        self._away = False
        self._busy: set[str] = set()
        self._clock = 0.0
        self._judged: set[tuple[str, str, str, str]] = set()
        self._pool = ThreadPoolExecutor(_AT_ONCE, thread_name_prefix="deliver")
        self._thread = threading.Thread(target=self._work, name="outbox", daemon=True)

    def start(self) -> None:
        """Begin. On a file what an earlier service had begun to send is due at once: no other service uses it."""
        if self._database.path is not None:
            with self._database.reading() as connection:
                left = webhooks.count_waiting(connection)
            if left:
                with self._database.writing() as connection:
                    webhooks.release_all(connection)
        self._thread.start()

    def close(self) -> None:
        """Stop; attempts that have begun end within seconds, and what they do not store is tried again."""
        with self._change:
            self._closing = True
            self._change.notify_all()
        if self._thread.is_alive():
            self._thread.join()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def wake(self) -> None:
        """Look now for what is to be sent."""
        with self._change:
            self._woken = True
            self._change.notify_all()

    def _work(self) -> None:
        while not self._closing:
            try:
                self._deliver()
                if time.monotonic() >= self._clock:
                    self._clock = time.monotonic() + CLOCK_SECONDS
                    self._look_at_the_clock()
                self._away = False
            except StorageError as error:
                if not self._away:
                    _log.warning("alarms wait for the database: %s", error)
                self._away = True
            except Exception:  # noqa: BLE001  (the next one is to be sent whatever became of this one)
                _log.exception("the outbox")
            with self._change:
                self._change.wait_for(lambda: self._closing or self._woken, timeout=LOOK_SECONDS)
                self._woken = False

    def _deliver(self) -> None:
        with self._database.reading() as connection:
            if not webhooks.any_due(connection):
                return
        with self._change:
            busy = frozenset(self._busy)
        with self._database.writing(of="outbox") as connection:
            claimed = webhooks.claim(connection, lease=LEASE_SECONDS, most=_AT_ONCE - len(busy), passing=busy)
            to = {row.webhook_id: webhooks.get(connection, row.webhook_id) for row in claimed}
            keyed = keys.any_ever(connection)
        private = self._settings.private_receivers
        private = not keyed if private is None else private
        for row in claimed:
            receiver = to[row.webhook_id]
            if receiver is not None:
                with self._change:
                    self._busy.add(row.webhook_id)
                self._pool.submit(self._attempt, row, receiver, private=private)

    def _attempt(self, row: DeliveryRow, receiver: WebhookRow, *, private: bool) -> None:
        try:
            secret, name = receiver.secret, row.delivery_id
            ended = notify.send(receiver.address, row.body.encode(), secret=secret, delivery_id=name, private=private)
            with self._database.writing(of="outbox") as connection:
                _store(connection, row, ended)
        except StorageError as error:
            _log.warning("delivery %s is tried again: %s", row.delivery_id, error)
        except Exception:  # noqa: BLE001  (it is due again when its time has run out)
            _log.exception("delivery %s", row.delivery_id)
        finally:
            with self._change:
                self._busy.discard(row.webhook_id)
            self.wake()

    def _look_at_the_clock(self) -> None:
        """Raise the alarms of rigs that have been silent for longer than a rule says."""
        with self._database.reading() as connection:
            rules = [(row, raising.rule_of(row)) for row in alarms.enabled(connection)]
            rules = [(row, rule) for row, rule in rules if rule.quantity == raising.SILENT]
            if not rules:
                self._judged.clear()
                return
            rows = clutches.page(connection, limit=None, by_name=True)
            heard = alarms.last_heard(connection, [row.clutch_id for row in rows])
        now, judged = datetime.now(UTC), set()
        for row in rows:
            since = heard.get(row.clutch_id)
            if since is None:
                continue
            hours = (now - datetime.fromisoformat(since)).total_seconds() / _SECONDS_PER_HOUR
            record = ClutchIn.model_validate(row.record)
            for rule_row, rule in rules:
                if hours > (rule.limit or 0.0) and raising.concerns(rule, record):
                    judged.add((row.clutch_id, rule_row.alarm_id, rule_row.saved_at, since))
        for clutch_id in sorted({clutch_id for clutch_id, *_ in judged - self._judged}):
            with self._database.writing(of=clutch_id) as connection:
                raising.evaluate(connection, clutch_id)
        self._judged = judged


def _store(connection: Connection, row: DeliveryRow, ended: Attempt) -> None:
    """Store how an attempt ended. A test message is tried only once."""
    now = datetime.now(UTC)
    state, pause = webhooks.DELIVERED, 0.0
    if ended.problem is not None:
        old = (now - datetime.fromisoformat(row.created_at)).total_seconds() > LONGEST
        state = webhooks.FAILED if old or row.event_id is None else webhooks.WAITING
        pause = min(FIRST_PAUSE * 2.0 ** min(row.attempts, 30), LAST_PAUSE)
        _log.warning("delivery %s, attempt %d: %s", row.delivery_id, row.attempts, ended.problem)
    at = now.isoformat(timespec="milliseconds")
    webhooks.end(connection, row.delivery_key, state, at=at, status=ended.status, problem=ended.problem, pause=pause)
