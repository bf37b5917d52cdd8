"""A rig profile is saved: new under its name, or in the place of the one that was there.

Runs that were read by a former version stay as they are; `change_run.read_again` reads one by the profile in force.
"""

from collections.abc import Callable
from dataclasses import replace

from service import repository
from service.api.rig import RigIn, RigOut
from service.errors import ConflictError
from storage import rigs
from storage.engine.database import Database
from storage.rigs import RigRow


def save(database: Database, rig: RigIn, *, by: str, at: str, replacing: bool = False) -> tuple[RigOut, bool]:
    """Save a profile; returns it as in force, and whether its name is new. Saving an equal profile changes nothing.

    Raises ConflictError if the name has another profile that may not be replaced.
    """
    content = rig.model_dump(mode="json")
    with database.writing() as connection:
        stored = rigs.get(connection, rig.name)
        if stored is not None and RigIn.model_validate(stored.content) == rig:
            return repository.rig(connection, rig.name), False
        row = RigRow(name=rig.name, version=1, content=content, saved_at=at, saved_by=by)
        if stored is None:
            rigs.insert(connection, row)
            return repository.rig(connection, rig.name), True
        if not replacing:
            raise ConflictError(f"rig {rig.name!r} already has another profile; replace it with PUT")
        rigs.put(connection, replace(row, version=stored.version + 1))
        return repository.rig(connection, rig.name), False


def save_confirmed(database: Database, confirmed: Callable[[], RigIn], by: str, at: str) -> tuple[RigOut, bool]:
    """Save the profile of a new rig as confirmed by the sender of a run's file, which was read by it. Raises the errors
    of `save`."""
    return save(database, confirmed(), by=by, at=at)
