"""A clutch is registered; what is known already is not changed by posting."""

from service.columns import content_of
from service.errors import ConflictError
from service.lives.condition import RANK_UNKNOWN
from service.schemas.clutch import ClutchIn
from storage import clutches
from storage.clutches import ClutchRow
from storage.engine.database import Database


def register(database: Database, clutch: ClutchIn, *, created_at: str) -> bool:
    """Register a clutch; returns whether it is new. Raises ConflictError where it is known with other content.

    What is known is the record in force, and, where it was edited, that which was first registered.
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
    stored_records = [stored.record] if stored.registered is None else [stored.record, stored.registered]
    # with the defaults of fields that came after a record was stored
    if content not in [
        content_of(ClutchIn.model_validate(record).model_dump(mode="json")) for record in stored_records
    ]:
        raise ConflictError(
            f"clutch {stored.clutch_id!r} is known with another record; records are not changed by posting"
        )
    return False
