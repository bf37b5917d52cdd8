"""The tables of alarm rules and of raised alarms. A rule raises an alarm once for each clutch until the alarm is cleared.
Lists begin with the newest.
"""

from collections.abc import Collection
from dataclasses import dataclass

from sqlalchemy import Connection, delete, func, or_, select

from storage.dialects import among, newest_first
from storage.encoding import Json, to_text
from storage.rows import Rows, amend, upsert
from storage.tables import NOT_CLEARED, alarm, alarm_event, run

RAISED, ACKNOWLEDGED, CLEARED = "raised", "acknowledged", "cleared"


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmRow:
    """A rule in force: `content` as posted, with its defaults, for one clutch or (None) several, and its author and
    time."""

    alarm_id: str
    clutch_id: str | None
    enabled: bool
    content: Json
    saved_at: str
    saved_by: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EventRow:
    """An alarm; `mark` identifies its cause, `content` describes it; later alarms have greater keys."""

    event_id: str
    alarm_id: str
    clutch_id: str
    quantity: str
    mark: str
    content: Json
    raised_at: str
    event_key: int = 0
    acknowledged_at: str | None = None
    acknowledged_by: str | None = None
    note: str = ""
    cleared_at: str | None = None

    @property
    def state(self) -> str:
        return CLEARED if self.cleared_at is not None else RAISED if self.acknowledged_at is None else ACKNOWLEDGED


# rules and events are read where runs are stored: a damaged one may raise a wrong alarm, but keeps no run out
_rules = Rows(AlarmRow, of=alarm, checked=False)
_events = Rows(EventRow, key="event_key", of=alarm_event, checked=False)
_IN_STATE = {
    RAISED: NOT_CLEARED & alarm_event.c.acknowledged_at.is_(None),
    ACKNOWLEDGED: NOT_CLEARED & alarm_event.c.acknowledged_at.is_not(None),
    CLEARED: alarm_event.c.cleared_at.is_not(None),
    "open": NOT_CLEARED,
}


def put(connection: Connection, row: AlarmRow) -> None:
    """Store a rule, replacing the one of that name."""
    upsert(connection, alarm, [_rules.values(row)])


def get(connection: Connection, alarm_id: str) -> AlarmRow | None:
    return _rules.first(connection.execute(select(alarm).where(alarm.c.alarm_id == alarm_id)))


def remove(connection: Connection, alarm_id: str) -> None:
    connection.execute(delete(alarm).where(alarm.c.alarm_id == alarm_id))


def page(
    connection: Connection, *, limit: int | None = None, after: str = "", only: Collection[str] | None = None
) -> list[AlarmRow]:
    """Rules by name after the name `after`; limited to the clutches `only`."""
    query = select(alarm).where(alarm.c.alarm_id > after).order_by(alarm.c.alarm_id).limit(limit)
    if only is not None:
        query = query.where(among(alarm.c.clutch_id, sorted(only)))
    return _rules.all(connection.execute(query))


def enabled(connection: Connection, clutch_id: str | None = None) -> list[AlarmRow]:
    """The enabled rules, or with `clutch_id` the enabled rules that may apply to that clutch."""
    query = select(alarm).where(alarm.c.enabled == 1).order_by(alarm.c.alarm_id)
    if clutch_id is not None:
        query = query.where(or_(alarm.c.clutch_id.is_(None), alarm.c.clutch_id == clutch_id))
    return _rules.all(connection.execute(query))


def insert_event(connection: Connection, row: EventRow) -> None:
    """Store a raised alarm. Raises IntegrityError where the rule's alarm of the clutch is not cleared yet."""
    connection.execute(alarm_event.insert(), _events.values(row))


def event(connection: Connection, event_id: str) -> EventRow | None:
    return _events.first(connection.execute(select(alarm_event).where(alarm_event.c.event_id == event_id)))


def open_of_clutch(connection: Connection, clutch_id: str) -> dict[str, EventRow]:
    """alarm_id -> the alarm of a clutch that is not yet cleared."""
    query = select(alarm_event).where(NOT_CLEARED, alarm_event.c.clutch_id == clutch_id)
    return {raised.alarm_id: raised for raised in _events.all(connection.execute(query))}


def open_of_alarm(connection: Connection, alarm_id: str) -> list[EventRow]:
    return _events.all(connection.execute(select(alarm_event).where(NOT_CLEARED, alarm_event.c.alarm_id == alarm_id)))


def events(
    connection: Connection,
    *,
    limit: int | None = None,
    before: float | None = None,
    state: str | None = None,
    alarm_id: str | None = None,
    only: Collection[str] | None = None,
) -> list[EventRow]:
    """Alarms, newest first: in a state (`open`: raised or acknowledged), of a rule, limited to the clutches `only`;
    `before`: the key of the previous page's last alarm."""
    query = newest_first(select(alarm_event), alarm_event.c.event_key, before=before, limit=limit)
    if state is not None:
        query = query.where(_IN_STATE[state])
    if alarm_id is not None:
        query = query.where(alarm_event.c.alarm_id == alarm_id)
    if only is not None:
        query = query.where(among(alarm_event.c.clutch_id, sorted(only)))
    return _events.all(connection.execute(query))


def raised(connection: Connection, only: Collection[str] | None = None) -> dict[str, list[EventRow]]:
    """clutch_id -> its unacknowledged alarms, newest first; limited to the clutches `only`."""
    by_clutch: dict[str, list[EventRow]] = {}
    for row in events(connection, state=RAISED, only=only):
        by_clutch.setdefault(row.clutch_id, []).append(row)
    return by_clutch


def count_raised(connection: Connection, only: Collection[str] | None = None) -> int:
    """The number of unacknowledged alarms; limited to the clutches `only`."""
    query = select(func.count()).select_from(alarm_event).where(_IN_STATE[RAISED])
    if only is not None:
        query = query.where(among(alarm_event.c.clutch_id, sorted(only)))
    return int(connection.execute(query).scalar_one())


def clear(connection: Connection, event_id: str, at: str, content: Json) -> None:
    """Mark an alarm as cleared, with its new content."""
    _change_event(connection, event_id, cleared_at=at, content=to_text(content))


def reopen(connection: Connection, event_id: str) -> None:
    """Undo the clearing of an alarm; it is raised or acknowledged as before."""
    _change_event(connection, event_id, cleared_at=None)


def acknowledge(connection: Connection, event_id: str, *, at: str, by: str, note: str) -> None:
    """Mark an alarm as acknowledged, with author, time and note."""
    _change_event(connection, event_id, acknowledged_at=at, acknowledged_by=by, note=note)


def _change_event(connection: Connection, event_id: str, **columns: str | None) -> None:
    amend(connection, alarm_event, [alarm_event.c.event_id == event_id], checked=False, **columns)


def last_heard(connection: Connection, clutch_ids: Collection[str]) -> dict[str, str]:
    """clutch_id -> arrival of its last run by the clock of that time, for those of these clutches that have a run."""
    last = select(func.max(run.c.run_key)).where(among(run.c.clutch_id, sorted(clutch_ids))).group_by(run.c.clutch_id)
    rows = connection.execute(select(run.c.clutch_id, run.c.received_at).where(run.c.run_key.in_(last)))
    return {row.clutch_id: row.received_at for row in rows}
