"""`/v1/rigs`: rig profiles in force, by name."""

from dataclasses import replace
from typing import Any

from service import records
from service.lists import Part, by_name
from service.schemas.rig import RigOut
from storage import rigs
from storage.engine.database import Database


def page(database: Database, part: Part) -> dict[str, Any]:
    """Profiles by name, fewer where so many would be too much memory."""
    part = replace(part, limit=min(part.limit, rigs.MAX_AT_ONCE))
    with database.reading() as connection:
        rows = rigs.page(connection, limit=part.most, after=part.name)
    return part.of(rows, by_name("name"), lambda row: records.rig_out(row).model_dump(mode="json"))


def look_up(database: Database, name: str) -> dict[str, Any]:
    """One profile as it is answered. Raises NotFoundError."""
    return rig_profile(database, name).model_dump(mode="json")


def rig_profile(database: Database, name: str) -> RigOut:
    """One profile. Raises NotFoundError."""
    with database.reading() as connection:
        return records.rig(connection, name)
