"""A clutch is registered; what is known already is not changed by posting."""

import hashlib
import json
from typing import Any

from service import records
from service.errors import ConflictError
from service.lives.payloads import RANK_UNKNOWN
from service.schemas.clutch import ClutchIn
from storage import clutches
from storage.clutches import ClutchRow
from storage.engine.database import Database


def register(database: Database, clutch: ClutchIn, *, created_at: str) -> bool:
    """Register a clutch; returns whether it is new. Raises ConflictError where it is known with other content."""
    record = clutch.model_dump(mode="json")
    content = _content(record)
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
    if _content(records.record(stored).model_dump(mode="json")) != content:
        raise ConflictError(
            f"clutch {stored.clutch_id!r} is known with another record; records are not changed by posting"
        )
    return False


def _content(record: dict[str, Any]) -> str:
    """A record's hash, with the defaults of fields that came after it filled in."""
    return hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()
