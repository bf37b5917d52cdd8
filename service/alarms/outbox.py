"""The outbox: a thread of the service sends alarms until their receivers have taken them, and raises alarms of silent rigs.

At least once: an attempt is counted before it is made, and its end stored afterwards. Where the service is killed between
the two, it is made again.

What waits, waits by this process's own clock, which nobody sets, and is given up by the number of its attempts: a wall clock
that is set forward or back delays no alarm, drops none, and raises none of a silent rig. A start tries what waits at once,
and it alone goes by the wall clock to tell for how long rigs have been silent.
"""

import logging
import threading
import time
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime

from sqlalchemy import Connection

from service.alarms import notify, raising
from service.alarms.receivers import Attempt
from service.alarms.rules import Silence
from service.api.clutch import ClutchIn
from service.settings import Settings
from storage import alarms, clutches, keys, webhooks
from storage.engine.database import Database
from storage.engine.errors import StorageError
from storage.webhooks import DeliveryRow, WaitingRow, WebhookRow

#: [s] Between two looks into the outbox, and at the clock for silent rigs. Chosen: an alarm arrives while the page still
#: loads; a rig is silent for hours.
LOOK_SECONDS, CLOCK_SECONDS = 0.5, 10.0
#: [s] What another service has begun to send is left to it for so much longer than it would pause. Derived: an attempt, its
#: name's resolution, a busy database.
LEASE_SECONDS = 60.0
#: Attempts at once. Chosen: one receiver that does not answer holds up no other, for of each there is one at a time.
_AT_ONCE = 8
#: [s] The pause after an attempt doubles up to the greatest. After so many attempts a delivery is given up. Derived: they
#: take three days, so that a receiver that is down over a weekend learns of it.
FIRST_PAUSE, LAST_PAUSE, MAX_ATTEMPTS = 1.0, 3600.0, 83
_SECONDS_PER_HOUR = 3600.0
_log = logging.getLogger("clutchlife")


class Outbox:
    """The thread that sends deliveries. `start` it once the database is open, `close` it before the database closes."""

    def __init__(self, database: Database, settings: Settings) -> None:
        self._database = database
        self._settings = settings
        self._change = threading.Condition()
        self._closing = False
        self._woken = False
        self._away = False
        self._busy: set[str] = set()
        # by delivery what was seen of it (its attempts, the end of the last), and when it is due by the monotonic clock
        self._planned: dict[int, tuple[tuple[int, str | None], float]] = {}
        self._clock = 0.0
        self._judged: set[tuple[str, str, str, str]] = set()
        self._ahead = time.time() - time.monotonic()  # [s] of the wall clock, at the last look at it
        self._heard: dict[
            str, tuple[str, float]
        ] = {}  # by clutch its last run, and when it came by the monotonic clock
        self._pool = ThreadPoolExecutor(_AT_ONCE, thread_name_prefix="deliver")
        self._thread = threading.Thread(target=self._work, name="outbox", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """Stop the thread; running attempts end within seconds, and those not stored are repeated at the next start."""
        with self._change:
            self._closing = True
            self._change.notify_all()
        if self._thread.is_alive():
            self._thread.join()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def wake(self) -> None:
        """Look for deliveries to send now."""
        with self._change:
            self._woken = True
            self._change.notify_all()

    def _work(self) -> None:
        """The loop of the outbox's thread: sends what is due, and looks for silent rigs from time to time."""
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
        """Claim the deliveries that are due, and send each in a thread of its own."""
        with self._change:
            busy = frozenset(self._busy)
        with self._database.reading() as connection:
            waiting = webhooks.next_ones(connection)
        due = self._due(waiting, busy)
        if not due:
            return
        with self._database.writing(of="outbox") as connection:
            claimed = [row for each in due if (row := webhooks.claim(connection, each)) is not None]
            to = {row.webhook_id: webhooks.get(connection, row.webhook_id) for row in claimed}
            keyed = keys.any_ever(connection)
        private = self._settings.private_receivers
        private = not keyed if private is None else private
        for row in claimed:
            self._plan(row, LEASE_SECONDS)
            receiver = to[row.webhook_id]
            if receiver is not None:
                with self._change:
                    self._busy.add(row.webhook_id)
                self._pool.submit(self._attempt, row, receiver, private=private)

    def _due(self, waiting: Sequence[WaitingRow], busy: Collection[str]) -> list[WaitingRow]:
        """The deliveries to try now: one per receiver, up to a maximum at once. If a receiver was `busy` when they were
        read, its attempt may have ended since: the pause that it planned still holds."""
        now, due = time.monotonic(), dict[str, WaitingRow]()
        with self._change:
            known, self._planned = self._planned, {}
            for row in waiting:
                seen = (row.attempts, row.last_attempt_at)
                planned = known.get(row.delivery_key)
                if planned is None or (planned[0] != seen and row.webhook_id not in busy):
                    planned = seen, now + self._left_to_others(row)
                self._planned[row.delivery_key] = planned
                if planned[1] <= now and row.webhook_id not in busy:
                    due.setdefault(row.webhook_id, row)
            return list(due.values())[: _AT_ONCE - len(self._busy)]

    def _left_to_others(self, row: WaitingRow) -> float:
        """Seconds before this service tries a delivery last tried by another service; 0 on a database file, which has
        one service."""
        return (
            0.0 if self._database.path is not None or row.attempts == 0 else pause_after(row.attempts) + LEASE_SECONDS
        )

    def _plan(self, row: DeliveryRow, pause: float) -> None:
        """Schedule the next attempt of a delivery after this many seconds."""
        with self._change:
            self._planned[row.delivery_key] = (row.attempts, row.last_attempt_at), time.monotonic() + pause

    def _attempt(self, row: DeliveryRow, receiver: WebhookRow, *, private: bool) -> None:
        """Send one delivery, store the outcome, and plan the next attempt."""
        tried = row
        try:
            secret, name = receiver.secret, row.delivery_id
            ended = notify.send(receiver.address, row.body.encode(), secret=secret, delivery_id=name, private=private)
            with self._database.writing(of="outbox") as connection:
                tried = _store(connection, row, ended)
        except StorageError as error:
            _log.warning("delivery %s is tried again: %s", row.delivery_id, error)
        except Exception:  # noqa: BLE001  (it is tried again as after any attempt that failed)
            _log.exception("delivery %s", row.delivery_id)
        finally:
            self._plan(tried, pause_after(tried.attempts))
            with self._change:
                self._busy.discard(row.webhook_id)
            self.wake()

    def _look_at_the_clock(self) -> None:
        """Raise alarms for rigs that have been silent for longer than a rule allows."""
        ahead = time.time() - time.monotonic()
        set_forward, self._ahead = max(0.0, ahead - self._ahead), ahead
        with self._database.reading() as connection:
            rules = [(row, raising.rule_of(row)) for row in alarms.enabled(connection)]
            rules = [(row, rule) for row, rule in rules if rule.quantity == raising.SILENT]
            if not rules:
                self._judged.clear()
                self._heard.clear()
                return
            page = clutches.page(connection, limit=None)
            rows = [row for row in page if "damaged" not in row.summary]
            silences = self._silences(alarms.last_heard(connection, [row.clutch_id for row in rows]), set_forward)
        judged = set()
        for row in rows:
            silence = silences.get(row.clutch_id)
            if silence is None:
                continue
            record = ClutchIn.model_validate(row.record)
            for rule_row, rule in rules:
                if silence.hours > (rule.limit or 0.0) and raising.concerns(rule, record):
                    judged.add((row.clutch_id, rule_row.alarm_id, rule_row.saved_at, silence.since))
        for clutch_id in sorted({clutch_id for clutch_id, *_ in judged - self._judged}):
            with self._database.writing(of=clutch_id) as connection:
                raising.evaluate(connection, clutch_id, silences[clutch_id])
        self._judged = judged

    def _silences(self, heard: Mapping[str, str], set_forward: float = 0.0) -> dict[str, Silence]:
        """The durations of silence of clutches last heard at these moments; a run that arrived since the last look
        counts as arriving now, and of a clutch first seen now, the time [s] by which the clock was `set_forward` since
        then counts as none."""
        now, known, self._heard = time.monotonic(), self._heard, {}
        for clutch_id, since in heard.items():
            before = known.get(clutch_id)
            if before is not None and before[0] != since:
                before = since, now
            self._heard[clutch_id] = before or (since, now - max(0.0, _seconds_since(since) - set_forward))
        return {name: Silence(since, (now - came) / _SECONDS_PER_HOUR) for name, (since, came) in self._heard.items()}


def _seconds_since(moment: str) -> float:
    """Seconds since a moment by the wall clock; 0 if the clock was set back to before it."""
    return max(0.0, (datetime.now(UTC) - datetime.fromisoformat(moment)).total_seconds())


def pause_after(attempts: int) -> float:
    """The pause [s] after this many attempts, before the next one."""
    return min(FIRST_PAUSE * 2.0 ** min(attempts, 30), LAST_PAUSE)


def _store(connection: Connection, row: DeliveryRow, ended: Attempt) -> DeliveryRow:
    """Store an attempt's result and return the delivery in its new state. A test message is tried only once."""
    state, problem = webhooks.DELIVERED, ended.problem
    if problem is not None:
        state = webhooks.WAITING
        _log.warning("delivery %s, attempt %d: %s", row.delivery_id, row.attempts, problem)
        if row.event_id is None:
            state = webhooks.FAILED
        elif row.attempts >= MAX_ATTEMPTS:
            state, problem = webhooks.FAILED, f"given up after {row.attempts} attempts: {problem}"
            _log.error("delivery %s of alarm %s to %s: %s", row.delivery_id, row.event_id, row.webhook_id, problem)
    at, pause = datetime.now(UTC).isoformat(timespec="milliseconds"), pause_after(row.attempts)
    webhooks.end(connection, row.delivery_key, state, at=at, status=ended.status, problem=problem, pause=pause)
    return replace(row, last_attempt_at=at)
