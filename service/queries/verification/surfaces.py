"""Whether inspections and photographs are as they were sent: their hashes, computed anew from what is stored."""

import hashlib
from dataclasses import dataclass

from service.stored_inspections import content_hash
from storage import inspections
from storage.engine.database import Database
from storage.inspections import InspectionRow, PhotographRow


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedInspections:
    """How many inspections and photographs were checked, and what was found, a sentence each."""

    inspections: int
    photographs: int
    findings: tuple[str, ...]


def check_inspections(database: Database, clutch_id: str) -> CheckedInspections:
    """Every inspection of a clutch and every photograph of it against its hash; one photograph in memory at a time."""
    with database.reading() as connection:
        rows = inspections.page(connection, clutch_id)
        of_keys = inspections.photographs(connection, [row.inspection_key for row in rows])
    photographs = [(row, photograph) for row in rows for photograph in of_keys[row.inspection_key]]
    findings = [finding for row in rows if (finding := _inspection_finding(row)) is not None]
    findings += [finding for pair in photographs if (finding := _photograph_finding(database, *pair)) is not None]
    return CheckedInspections(
        inspections=len(rows),
        photographs=len(photographs),
        findings=tuple(f"{clutch_id}: {finding}" for finding in findings),
    )


def _inspection_finding(row: InspectionRow) -> str | None:
    sha256 = content_hash(row.content)
    if sha256 == row.content_sha256 and row.cycles == row.content["cycles"]:
        return None
    return (
        f"inspection {row.inspection_id} is not what was sent: it is stored at {row.cycles:g} cycles, the sha256 of its "
        f"content is {sha256}, stored is {row.content_sha256}"
    )


def _photograph_finding(database: Database, row: InspectionRow, photograph: PhotographRow) -> str | None:
    with database.reading() as connection:
        data = inspections.data(connection, row.inspection_key, photograph.sha256)
    sha256 = hashlib.sha256(data or b"").hexdigest()
    if sha256 == photograph.sha256:
        return None
    return (
        f"photograph {photograph.sha256} of inspection {row.inspection_id} is not what was sent: its sha256 is {sha256}"
    )
