"""`/inspections`: what was found on a clutch's friction surface, by cycles, and the files of its photographs."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

from service import repository
from service.api.inspection import InspectionOut, InspectionPage
from service.errors import NotFoundError
from service.paging import Part, by_cycles
from service.repository import inspection, inspection_answers
from service.tables import Cells, cells
from storage import inspections
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from storage.inspections import PhotographRow

COLUMNS = (
    "inspection_id", "cycles", "performed_at", "lining", "roughness_um", "skewness", "note", "origin", "received_at",
    "received_by", "state", "photographs",
)  # fmt: skip


def page(database: Database, clutch_id: str, part: Part) -> InspectionPage:
    """A page of inspections by cycles. Raises NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        rows = inspections.page(connection, clutch_id, limit=part.most, after=part.after)
        items = {item.inspection_id: item for item in inspection_answers(connection, rows)}
    return part.of(InspectionPage, rows, by_cycles("inspection_id"), lambda row: items[row.inspection_id])


def rows(page: InspectionPage) -> Iterator[Cells]:
    """Inspections as rows of a table, with the number of photographs."""
    for item in page.items:
        yield cells(item, COLUMNS) | {"photographs": len(item.photographs)}


def look_up(database: Database, clutch_id: str, inspection_id: str) -> InspectionOut:
    """One inspection. Raises NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        return inspection_answers(connection, [inspection(connection, clutch_id, inspection_id)])[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """A stored photograph's file, to be read piece by piece."""

    database: Database
    row: PhotographRow

    def pieces(self, size: int) -> Iterator[bytes]:
        """The file in pieces of this size, each read in a transaction of its own. Raises DamagedData before the last
        piece if the content differs from the one sent."""
        digest = hashlib.sha256()
        for start in range(0, self.row.bytes, size):
            with self.database.reading() as connection:
                piece = inspections.piece(connection, self.row.sha256, start, size)
            digest.update(piece)
            if start + size >= self.row.bytes and digest.hexdigest() != self.row.sha256:
                raise DamagedData(f"the photograph {self.row.sha256} is not what was sent")
            yield piece


def photograph(database: Database, clutch_id: str, inspection_id: str, photograph_id: str) -> Photograph:
    """A photograph, whose content is not yet read. Raises NotFoundError."""
    with database.reading() as connection:
        key = inspection(connection, clutch_id, inspection_id).inspection_key
        for row in inspections.photographs(connection, [key])[key]:
            if row.sha256 == photograph_id:
                return Photograph(database=database, row=row)
    raise NotFoundError(f"inspection {inspection_id!r} has no photograph {photograph_id!r}")
