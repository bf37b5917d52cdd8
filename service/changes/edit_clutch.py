"""A clutch is registered, its record edited, or it is archived: what depends on the record is computed again.

Curves depend on the geometry and on the torque channel's filter alone: where these change, every run is fitted again. The
record that was registered stays stored.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection

from service import repository
from service.alarms import raising
from service.api.clutch import ClutchIn
from service.channels import content_of
from service.clutch.condition import RANK_UNKNOWN
from service.clutch.recomputation import Results
from service.errors import ConflictError
from storage import changes, clutches
from storage.clutches import ClutchRow
from storage.engine.database import Database


@dataclass(frozen=True, slots=True, kw_only=True)
class _Edited:
    """A clutch's record before and after an edit, with the results to store: none, those of its history, or all."""

    before: ClutchRow
    record: ClutchIn
    archived: bool
    results: Results | None


def edit(
    database: Database,
    clutch_id: str,
    fields: Mapping[str, Any],
    *,
    archived: bool | None,
    reason: str,
    by: str,
    at: str,
) -> None:
    """Replace these fields of a clutch's record, each as a whole, and archive the clutch or bring it back (None:
    neither).

    Fields with equal values are left alone. Raises NotFoundError.
    """
    for _ in repository.attempts(clutch_id):
        edited = _computed(database, clutch_id, fields, archived)
        if not _entries(edited):
            return
        with database.writing(of=clutch_id) as connection:
            if repository.unchanged(connection, clutch_id, edited.before.revision):
                _store(connection, edited, reason=reason, by=by, at=at)
                return


def _computed(database: Database, clutch_id: str, fields: Mapping[str, Any], archived: bool | None) -> _Edited:
    """The edited record, with the clutch's results under it if it differs from the stored one."""
    with database.reading() as connection:
        row = repository.clutch(connection, clutch_id)
    before = repository.record(row)
    record = ClutchIn.model_validate(before.model_dump(mode="json") | dict(fields))
    return _Edited(
        before=row,
        record=record,
        archived=row.archived if archived is None else archived,
        results=None if record == before else _results(database, before, record),
    )


def _results(database: Database, before: ClutchIn, record: ClutchIn) -> Results:
    """The results under the edited record."""
    with database.reading() as connection:
        state = repository.state(connection, record.clutch_id, edited=record)
        levels, receipts = (
            repository.levels(connection, record.clutch_id),
            repository.receipts(connection, record.clutch_id),
        )
    if (record.geometry, record.torque_filter) != (before.geometry, before.torque_filter):
        return repository.recomputed(repository.recorded(database, state))
    return repository.tracked_again(database, state, levels, receipts)


def _entries(edited: _Edited) -> list[tuple[str, dict[str, object], dict[str, object]]]:
    """The entries for the audit trail: each action with the changed fields before and after."""
    before, after = (record.model_dump(mode="json") for record in (repository.record(edited.before), edited.record))
    names = [name for name in before if before[name] != after[name]]
    entries: list[tuple[str, dict[str, object], dict[str, object]]] = []
    if names:
        entries.append((changes.EDIT, {name: before[name] for name in names}, {name: after[name] for name in names}))
    if edited.archived != edited.before.archived:
        action = changes.ARCHIVE if edited.archived else changes.UNARCHIVE
        entries.append((action, {"archived": edited.before.archived}, {"archived": edited.archived}))
    return entries


def _store(connection: Connection, edited: _Edited, *, reason: str, by: str, at: str) -> None:
    """Store the edited record, the results that follow and the entries in the audit trail; move the revision on."""
    row, clutch_id, record = edited.before, edited.before.clutch_id, edited.record.model_dump(mode="json")
    clutches.set_record(
        connection,
        clutch_id,
        record=record,
        content_sha256=content_of(record),
        registered=row.record if row.registered is None and edited.results is not None else row.registered,
        archived=edited.archived,
    )
    if edited.results is not None:
        repository.store(connection, clutch_id, edited.results)
    raising.evaluate(connection, clutch_id)  # an archived one has no alarms
    revision = clutches.bump_revision(connection, clutch_id)
    for action, before, after in _entries(edited):
        changes.insert(connection, clutch_id, action, before, after, at=at, by=by, reason=reason, revision=revision)


def register(database: Database, clutch: ClutchIn, *, created_at: str) -> bool:
    """Register a clutch; true if it is new. Raises ConflictError if the clutch is registered with other content.

    Content is other if it equals neither the record in force nor, after an edit, the record first registered.
    """
    record = clutch.model_dump(mode="json")
    content = content_of(record)
    with database.reading() as connection:
        stored = clutches.get(connection, clutch.clutch_id)
    if stored is None:
        with database.writing() as connection:
            stored = clutches.get(connection, clutch.clutch_id)
            if stored is None:
                row = ClutchRow(
                    clutch_id=clutch.clutch_id,
                    record=record,
                    content_sha256=content,
                    created_at=created_at,
                    revision=0,
                    rank=RANK_UNKNOWN,
                    summary={},
                )
                clutches.insert(connection, row)
                return True
    known = [stored.record] if stored.registered is None else [stored.record, stored.registered]
    # with the defaults of fields that came after a record was stored
    if content not in [content_of(ClutchIn.model_validate(old).model_dump(mode="json")) for old in known]:
        raise ConflictError(f"clutch {stored.clutch_id!r} has another record: change it with PATCH or clutchlife edit")
    return False
