"""`/v1/clutches`: clutches worst first, with what a list shows of each."""

from collections.abc import Collection, Sequence
from functools import partial
from typing import Any

from sqlalchemy import Connection

from service import records
from service.lists import Place, page_as_bytes
from service.lives.assumptions import BASELINE
from service.lives.payloads import SUMMARY
from service.queries.cache import AnswerCache, to_json
from storage import clutches, runs, verdicts
from storage.clutches import ClutchRow
from storage.engine.database import Database
from storage.verdicts import VerdictRow

#: What summaries did not hold that were stored before models could be adopted.
_BEFORE = {"model": dict(BASELINE)}


def look_up(database: Database, clutch_id: str) -> dict[str, Any]:
    """A clutch; raises NotFoundError."""
    with database.reading() as connection:
        ((row, held, verdict),) = _shown(connection, [records.clutch(connection, clutch_id)])
    return _item(row, held, verdict)


def page(
    database: Database, *, limit: int, after: Place | None, archived: bool = False
) -> tuple[list[dict[str, Any]], Place | None]:
    """Clutches in use, or the archived ones, the fewest remaining cycles first, and where the next page starts."""
    with database.reading() as connection:
        rows = clutches.page(connection, limit=limit + 1, after=after, archived=archived)
        items = [_item(*clutch) for clutch in _shown(connection, rows[:limit])]
    return items, _next(rows, limit)


def page_as_json(
    database: Database,
    cache: AnswerCache,
    *,
    limit: int,
    after: Place | None,
    archived: bool = False,
    only: Collection[str] | None = None,
) -> bytes:
    """The same as JSON, of all clutches or of `only` some; each clutch's item is made once for its revision and verdict."""
    with database.reading() as connection:
        rows = clutches.page(connection, limit=limit + 1, after=after, archived=archived, only=only)
        clutches_shown = _shown(connection, rows[:limit])
    items = [
        cache.answer(("clutch", row.clutch_id), (row.revision, to_json(verdict)), partial(_as_json, row, held, verdict))
        for row, held, verdict in clutches_shown
    ]
    return page_as_bytes([item.body for item in items], _next(rows, limit))


def _next(rows: Sequence[ClutchRow], limit: int) -> Place | None:
    return (rows[limit - 1].rank, rows[limit - 1].clutch_id) if len(rows) > limit else None


def _as_json(row: ClutchRow, held: int, verdict: dict[str, Any] | None) -> bytes:
    return to_json(_item(row, held, verdict))


def _shown(connection: Connection, rows: Sequence[ClutchRow]) -> list[tuple[ClutchRow, int, dict[str, Any] | None]]:
    """Clutches, each with the number of its held runs and its newest finished diagnosis as it goes out."""
    newest = verdicts.newest(connection, [row.clutch_id for row in rows])
    held = runs.held(connection)
    return [(row, held.get(row.clutch_id, 0), _latest(connection, row, newest.get(row.clutch_id))) for row in rows]


def _latest(connection: Connection, row: ClutchRow, verdict: VerdictRow | None) -> dict[str, Any] | None:
    """The newest finished diagnosis as it goes out; one of a life that a rebuild has ended is past."""
    if verdict is None:
        return None
    life = row.summary.get("life")  # what was stored by earlier releases does not hold it
    earlier = verdict.life != (records.present_life(connection, row.clutch_id) if life is None else life)
    return {
        "diagnosis_id": verdict.diagnosis_id,
        "verdict": verdict.verdict,
        "causes": list(verdict.causes),
        "adopted": verdict.adopted and not earlier,
        "earlier_life": earlier,
    }


def _item(row: ClutchRow, held: int, diagnosis: dict[str, Any] | None) -> dict[str, Any]:
    return records.record(row).model_dump(mode="json") | {
        "archived": row.archived,
        "created_at": row.created_at,
        "revision": row.revision,
        "runs": row.summary.get("runs", 0),
        "held": held,
        "summary": {name: (_BEFORE | row.summary)[name] for name in SUMMARY} if row.summary else None,
        "recent": row.summary.get("recent"),
        "diagnosis": diagnosis,
    }
