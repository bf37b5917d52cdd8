"""Raises and clears alarms, and fills the outbox, in the transaction that stores a clutch's results.

While an alarm is not cleared, its rule raises no other of the clutch, but where the end has come nearer by a step: then
another takes its place. It is cleared when its value has come back by the hysteresis, or when nothing can be said any more:
after a rebuild, where the rule is gone.
"""

import json
import secrets
from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime

from sqlalchemy import Connection

from service.alarms import rules
from service.alarms.rules import ClutchFacts, Finding, Silence
from service.api.alarm import AlarmIn, EventOut
from service.api.base import of_row
from service.api.clutch import ClutchIn
from service.clutch.condition import as_stored, state_of
from storage import alarms, clutches, webhooks
from storage.alarms import AlarmRow, EventRow
from storage.clutches import ClutchRow
from storage.encoding import Json
from storage.webhooks import DeliveryRow, WebhookRow

SILENT = "silent_hours"
#: In the content of an alarm that a declared end has cleared: the life that ended.
_ENDED_LIFE = "ended_life"
#: What a body is about.
RAISED, CLEARED, TEST = "alarm.raised", "alarm.cleared", "alarm.test"


def evaluate(connection: Connection, clutch_id: str, silence: Silence | None = None) -> None:
    """Raise and clear a clutch's alarms by its stored data.

    For how long its rig is silent only the outbox measures (`silence`). For all others it is so at least for as long as it
    was when an alarm of that was raised: no wall clock raises or clears one.
    """
    in_use, before = alarms.enabled(connection, clutch_id), alarms.open_of_clutch(connection, clutch_id)
    if not in_use and not before:
        return
    row = clutches.get(connection, clutch_id)
    if row is None:
        raise LookupError(f"clutch {clutch_id!r} is not stored")
    record, at = ClutchIn.model_validate(row.record), _now()
    clutch_rules = [] if row.archived else [(rule_row, rule_of(rule_row)) for rule_row in in_use]
    clutch_rules = [(rule_row, rule) for rule_row, rule in clutch_rules if concerns(rule, record)]
    silences = [] if silence is None else [silence]
    if row.silent is not None:
        silences += [Silence(row.silent, old.content["value"]) for old in before.values() if old.quantity == SILENT]
    still_raised: set[str] = set()
    for of_silence in (True, False):  # a silent rig is a state, which other rules look at
        geometry = record.geometry.to_model()
        facts = ClutchFacts(connection=connection, clutch=row, geometry=geometry, now=at, silences=silences)
        for rule_row, rule in clutch_rules:
            if (rule.quantity == SILENT) is of_silence:
                still_raised |= _judged(rule_row, rule, facts, before.get(rule_row.alarm_id))
        if of_silence:
            row = _with_silence(facts, still_raised)
    for alarm_id, event in before.items():
        if alarm_id not in still_raised:
            _clear(event, facts)


def concerns(rule: AlarmIn, record: ClutchIn) -> bool:
    if rule.clutch_id is not None:
        return rule.clutch_id == record.clutch_id
    kind_fields = {} if rule.kind is None else rule.kind.model_dump(exclude_none=True)
    return all(getattr(record, name) == value for name, value in kind_fields.items())


def rule_of(row: AlarmRow) -> AlarmIn:
    return AlarmIn.model_validate(row.content)


def event_out(row: EventRow) -> EventOut:
    """An alarm as sent to clients."""
    return of_row(EventOut, row, **{name: value for name, value in row.content.items() if name != _ENDED_LIFE})


def to_receivers(connection: Connection, kind: str, event: EventRow, receivers: Iterable[WebhookRow]) -> list[str]:
    """Queue an alarm's delivery to each of these receivers; returns the ids of the deliveries."""
    names = []
    for receiver in receivers:
        delivery_id = secrets.token_hex(8)
        body = {"type": kind, "delivery_id": delivery_id, "event": event_out(event).model_dump(mode="json")}
        row = DeliveryRow(
            delivery_id=delivery_id,
            webhook_id=receiver.webhook_id,
            event_id=None if kind == TEST else event.event_id,
            body=json.dumps(body, ensure_ascii=False, allow_nan=False),
            created_at=_now(),
        )
        webhooks.insert_delivery(connection, row)
        names.append(delivery_id)
    return names


def receivers_of(connection: Connection, clutch_id: str | None) -> list[WebhookRow]:
    """The receivers of a clutch's alarms; `clutch_id` None: those for all clutches."""
    return [row for row in webhooks.page(connection) if row.content["clutch_id"] in (None, clutch_id)]


def test_event(row: AlarmRow) -> EventRow:
    """An alarm as the rule would raise it, for a test; it is not stored."""
    rule, message = rule_of(row), "This is a test of the alarm: nothing is wrong."
    content = {"name": rule.name, "value": None, "limit": rule.limit, "message": message, "as_of_cycles": None}
    return EventRow(
        event_id="test",
        alarm_id=row.alarm_id,
        clutch_id=rule.clutch_id or "",
        quantity=rule.quantity,
        mark="",
        content=content,
        raised_at=_now(),
    )


def _judged(row: AlarmRow, rule: AlarmIn, facts: ClutchFacts, before: EventRow | None) -> set[str]:
    """Raise the rule's alarm, keep an earlier one, or clear it; returns the rule's id if an alarm is raised."""
    finding = rules.finding(rule, facts)
    if finding is None:
        return set()
    if before is not None and rules.passes(rule, finding, rule.hysteresis) and _is_of(before, rule, finding):
        return {row.alarm_id}
    if not rules.passes(rule, finding):
        return set()
    if before is not None:
        _clear(before, facts, replaced=finding.step is not None and before.quantity == rule.quantity)
    if not _reopened(row, rule, facts, finding):
        _raise(row, rule, facts, finding)
    return {row.alarm_id}


def _is_of(event: EventRow, rule: AlarmIn, finding: Finding) -> bool:
    """Whether an alarm is about the quantity that the rule watches and its present finding."""
    return event.quantity == rule.quantity and finding.is_of(event.mark)


def _raise(row: AlarmRow, rule: AlarmIn, facts: ClutchFacts, finding: Finding) -> None:
    """Store a new alarm of a rule, and put a message for each receiver into the outbox."""
    content: Json = {
        "name": rule.name,
        "value": finding.value,
        "limit": rule.limit,
        "message": rules.message(rule, facts, finding),
        "as_of_cycles": facts.summary.get("as_of_cycles"),
    }
    new = EventRow(
        event_id=secrets.token_hex(8),
        alarm_id=row.alarm_id,
        clutch_id=facts.clutch_id,
        quantity=rule.quantity,
        mark=finding.mark,
        content=content,
        raised_at=facts.now,
    )
    alarms.insert_event(facts.connection, new)
    _tell(facts.connection, RAISED, new.event_id, of_cleared=False)


def _reopened(row: AlarmRow, rule: AlarmIn, facts: ClutchFacts, finding: Finding) -> bool:
    """Raise an alarm again that a declared end of life cleared, if the end was withdrawn; true if there is one. Only
    receivers that were told of its clearing are informed."""
    connection = facts.connection
    if facts.summary.get("ended") is not None:
        return False
    of_clutch = alarms.events(connection, alarm_id=row.alarm_id, only=[facts.clutch_id], state=alarms.CLEARED)
    for event in of_clutch:
        ended = event.content.get(_ENDED_LIFE)
        if ended is not None and ended == facts.summary.get("life", "") and _is_of(event, rule, finding):
            alarms.reopen(connection, event.event_id)
            _tell(connection, RAISED, event.event_id, of_cleared=True)
            return True
    return False


def _clear(event: EventRow, facts: ClutchFacts, *, replaced: bool = False) -> None:
    """Clear an alarm and inform its receivers, unless another alarm of the rule has `replaced` it."""
    ended = {} if facts.summary.get("ended") is None else {_ENDED_LIFE: facts.summary.get("life", "")}
    content = {name: value for name, value in event.content.items() if name != _ENDED_LIFE}
    alarms.clear(facts.connection, event.event_id, facts.now, content | ended)
    if not replaced:
        _tell(facts.connection, CLEARED, event.event_id, of_cleared=True)


def _tell(connection: Connection, kind: str, event_id: str, *, of_cleared: bool) -> None:
    """Queue an alarm's delivery to its clutch's receivers; `of_cleared`: only to those that want to know of cleared
    alarms."""
    if (event := alarms.event(connection, event_id)) is not None:
        receivers = receivers_of(connection, event.clutch_id)
        to_receivers(connection, kind, event, [row for row in receivers if row.content["cleared"] or not of_cleared])


def _with_silence(facts: ClutchFacts, kept: set[str]) -> ClutchRow:
    """The clutch with the time since which its rig is silent; `kept` are the alarms that stay raised, so far of silence
    alone."""
    row, silent = facts.clutch, facts.heard() if kept else None
    if silent is None and row.silent is None:
        return row
    state = state_of(as_stored(row.summary), disputed=row.is_disputed, silent=silent)["name"]
    clutches.set_silent(facts.connection, row.clutch_id, silent, state=state)
    return replace(row, silent=silent, state=state)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
