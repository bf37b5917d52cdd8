"""`/runs` and `/loops`: receipts by cycles, and the friction loops of the dynamic tests."""

from collections.abc import Iterator

from service import repository
from service.api.over_life import LoopItem, LoopPage
from service.api.run import ChangePage, Loop, RunPage
from service.channels import whole
from service.clutch.condition import held_runs_left_out
from service.clutch.timeline import DYNAMIC
from service.paging import Part, by_cycles, by_key, page_as_bytes
from service.tables import Cells, cells
from storage import changes, runs
from storage.encoding import to_text
from storage.engine.database import Database

COLUMNS = (
    "run_id", "kind", "cycles", "started_at", "received_at", "origin", "content_sha256", "warnings", "fits", "state",
    "sent_cycles",
)  # fmt: skip
TRAIL_COLUMNS = changes.SHOWN
LOOP_COLUMNS = (*Loop.model_fields, "run_id", "cycles")


def page_as_json(
    database: Database, clutch_id: str, part: Part, state: str | None = None, kind: str | None = None
) -> bytes:
    """A page of receipts by cycles as JSON, of runs in one state or all and of one kind or all. Raises NotFoundError.

    The stored text of a receipt is sent unchanged, followed by the run's present state.
    """
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        rows = runs.receipts(connection, clutch_id, limit=part.most, after=part.after, state=state, kind=kind)
    return page_as_bytes([_as_json(row) for row in rows[: part.limit]], part.next(rows, by_cycles("run_id")))


def _as_json(row: runs.ReceiptRow) -> bytes:
    sent_cycles = row.cycles if row.sent_cycles is None else row.sent_cycles
    present = f'"state":"{row.state}","doubts":{row.doubts},"sent_cycles":{whole(sent_cycles)},'
    present += f'"received_by":{to_text(row.received_by)}'
    return f"{row.receipt[:-1]},{present}}}".encode()


def rows(page: RunPage) -> Iterator[Cells]:
    """Receipts as rows of a table, with the number of warnings and fits."""
    for item in page.items:
        yield cells(item, COLUMNS) | {"warnings": len(item.warnings), "fits": len(item.fits)}


def trail(database: Database, clutch_id: str, part: Part) -> ChangePage:
    """The audit trail of a clutch and its runs, newest first. Raises NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        rows = changes.page(connection, clutch_id, limit=part.most, before=part.number)
    return part.of(ChangePage, rows, by_key("change_key"), changes.ChangeRow.entry)


def trail_rows(page: ChangePage) -> Iterator[Cells]:
    """The audit trail as rows of a table; `before` and `after` are JSON text."""
    for item in page.items:
        yield cells(item, TRAIL_COLUMNS) | {"before": to_text(item.before), "after": to_text(item.after)}


def loops(database: Database, clutch_id: str, part: Part) -> LoopPage:
    """A page of friction loops by cycles and pressure. Raises NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, kind=DYNAMIC, state=runs.ACCEPTED)
        held_count = runs.held(connection, [clutch_id]).get(clutch_id, 0)
    items = part.sliced(
        [LoopItem(run_id=row.run_id, cycles=whole(row.cycles), **loop) for row in rows for loop in row.receipt["loops"]]
    )
    warnings = held_runs_left_out(held_count)
    return LoopPage(held_runs=held_count, warnings=warnings, items=[*items.items], next=items.next)


def loop_rows(page: LoopPage) -> Iterator[Cells]:
    """Friction loops as rows of a table."""
    for item in page.items:
        yield cells(item, LOOP_COLUMNS) | {"held_runs": page.held_runs}
