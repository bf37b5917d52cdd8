"""An inspection of a clutch is stored, photographs are added to it, and it is withdrawn where it was a slip.

No track and no prediction uses inspections: nothing is computed again. Nothing is deleted either.
"""

import hashlib

from sqlalchemy import Connection

from service import repository
from service.api.base import MAX_PHOTOGRAPHS
from service.api.inspection import InspectionIn, InspectionOut, MediaType, PhotographOut
from service.errors import InvalidError, NotPossibleNowError
from service.repository import inspection, inspection_answers, inspection_hash, photograph_answer
from storage import changes, clutches, inspections
from storage.engine.database import Database
from storage.inspections import InspectionRow, PhotographRow
from storage.runs import WITHDRAWN

#: The first characters of the content's hash that name an inspection. Chosen: as a diagnosis' name.
_ID_CHARACTERS = 16


def inspect(database: Database, clutch_id: str, sent: InspectionIn, *, by: str, at: str) -> tuple[InspectionOut, bool]:
    """Store an inspection; returns it as sent to clients, and whether it is new (equal content is one inspection).

    Raises NotFoundError. An archived clutch accepts inspections, because it may be dismantled after its last test.
    """
    content = sent.model_dump(mode="json")
    content_sha256 = inspection_hash(content)
    with database.writing(of=clutch_id) as connection:
        repository.clutch(connection, clutch_id)
        row = InspectionRow(
            clutch_id=clutch_id,
            inspection_id=content_sha256[:_ID_CHARACTERS],
            cycles=sent.cycles,
            content=content,
            content_sha256=content_sha256,
            received_at=at,
            received_by=by,
        )
        new = inspections.get(connection, clutch_id, row.inspection_id) is None
        if new:
            inspections.insert(connection, row)
        return _answer(connection, clutch_id, row.inspection_id).model_copy(update={"duplicate": not new}), new


def add_photograph(
    database: Database, clutch_id: str, inspection_id: str, content: bytes, media_type: MediaType, *, by: str, at: str
) -> tuple[PhotographOut, bool]:
    """Add a photograph to an inspection; returns the inspection as sent to clients, and whether the photograph is new.

    Raises NotFoundError, InvalidError if the content is not of that type, NotPossibleNowError if the inspection has its
    maximum of photographs.
    """
    _require_type(content, media_type)
    row = PhotographRow(
        sha256=hashlib.sha256(content).hexdigest(),
        media_type=media_type,
        bytes=len(content),
        received_at=at,
        received_by=by,
    )
    with database.writing() as connection:  # a photograph may be of several clutches
        key = inspection(connection, clutch_id, inspection_id).inspection_key
        stored = inspections.photographs(connection, [key])[key]
        for photograph in stored:
            if photograph.sha256 == row.sha256:
                return photograph_answer(photograph), False
        if len(stored) >= MAX_PHOTOGRAPHS:
            raise NotPossibleNowError(
                f"inspection {inspection_id!r} has {MAX_PHOTOGRAPHS} photographs, which is the maximum"
            )
        inspections.attach(connection, key, row, content, position=len(stored))
        return photograph_answer(row), True


def _require_type(content: bytes, media_type: MediaType) -> None:
    """Raise InvalidError if a file's first bytes are not those of its stated type."""
    begins = {
        "image/png": content.startswith(b"\x89PNG\r\n\x1a\n"),
        "image/jpeg": content.startswith(b"\xff\xd8\xff"),
        "image/webp": content.startswith(b"RIFF") and content[8:12] == b"WEBP",
    }
    if not begins[media_type]:
        shown = content[:12].hex(" ") or "nothing"
        message = f"the file is not of type {media_type}: its first bytes are {shown}"
        raise InvalidError.of(message, code="media_type", value=shown)


def change(
    database: Database, clutch_id: str, inspection_id: str, state: str, *, reason: str, by: str, at: str
) -> InspectionOut:
    """Withdraw an inspection (`state` WITHDRAWN) or restore it (ACCEPTED); returns it as sent to clients.

    If its state changes, the change enters the audit trail and the clutch's revision moves on. Raises NotFoundError.
    """
    with database.writing(of=clutch_id) as connection:
        row = inspection(connection, clutch_id, inspection_id)
        if row.state != state:
            inspections.set_state(connection, row.inspection_key, state)
            was, now = _summary(row, row.state), _summary(row, state)
            revision = clutches.bump_revision(connection, clutch_id)
            action = changes.WITHDRAW_INSPECTION if state == WITHDRAWN else changes.RESTORE_INSPECTION
            changes.insert(connection, clutch_id, action, was, now, at=at, by=by, reason=reason, revision=revision)
        return _answer(connection, clutch_id, inspection_id)


def _summary(row: InspectionRow, state: str) -> dict[str, object]:
    return {"inspection_id": row.inspection_id, "cycles": row.content["cycles"], "state": state}


def _answer(connection: Connection, clutch_id: str, inspection_id: str) -> InspectionOut:
    return inspection_answers(connection, [inspection(connection, clutch_id, inspection_id)])[0]
