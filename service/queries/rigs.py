"""`/v1/rigs`: rig profiles in force, by name."""

from typing import Any

from service import records
from service.lists import Place
from service.lists import page as page_of
from service.schemas.rig import RigOut
from storage import rigs
from storage.engine.database import Database


def page(database: Database, *, limit: int, after: Place | None) -> dict[str, Any]:
    """A page of the profiles behind the name at which another ended, of fewer where so many would be too much memory."""
    limit = min(limit, rigs.MAX_AT_ONCE)
    with database.reading() as connection:
        rows = rigs.page(connection, limit=limit + 1, after="" if after is None else after[1])
    items = [records.rig_out(row).model_dump(mode="json") for row in rows[:limit]]
    return page_of(items, (0.0, rows[limit - 1].name) if len(rows) > limit else None)


def look_up(database: Database, name: str) -> dict[str, Any]:
    """One profile as it is answered. Raises NotFoundError."""
    return of_name(database, name).model_dump(mode="json")


def of_name(database: Database, name: str) -> RigOut:
    """One profile. Raises NotFoundError."""
    with database.reading() as connection:
        return records.rig(connection, name)
