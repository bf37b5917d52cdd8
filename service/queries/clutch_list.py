"""`/v1/clutches`: clutches worst first or by name, as lists show them; `/v1/fleet/totals`: how many there are; and six
numbers of all that is stored, for the metrics.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from sqlalchemy import Connection

from models.prognosis.criteria import HORIZON
from service import records
from service.lists import Part, by_name, page_as_bytes
from service.lives.condition import STATES, stated
from service.queries.cache import AnswerCache, to_json
from service.schemas.base import schema_fields
from service.schemas.clutch import ClutchOut
from storage import assumptions, clutches, diagnoses, jobs, runs
from storage.clutches import Choice, ClutchRow
from storage.engine.database import Database

#: Remaining cycles up to which clutches are counted, ascending; 0: at the end of life. Chosen: days and weeks of a rig.
WITHIN = (0.0, 1e3, 1e4)


@dataclass(frozen=True, slots=True, kw_only=True)
class Totals:
    """Clutches, archived ones too; how many of those in use are safe for at most so many more cycles (95 %); runs, and
    how many of them are held; ended lives that the fleets' priors know of; diagnoses that wait or run."""

    clutches: int
    within: dict[float, int]
    runs: int
    held: int
    ended_lives: int
    diagnoses: int


def service_totals(database: Database) -> Totals:
    with database.reading() as connection:
        return Totals(
            clutches=clutches.count(connection),
            within=clutches.count_within(connection, WITHIN),
            runs=runs.count(connection),
            held=runs.count_held(connection),
            ended_lives=assumptions.count_ended_lives(connection),
            diagnoses=jobs.count_open(connection, jobs.DIAGNOSIS),
        )


#: Share of the clutches whose bars fit, and the cycles at the bars' end where nothing is predicted. Chosen: one that lasts
#: much longer than the others must not shorten their bars to nothing; a rig's usual life.
_FITTING, _USUAL_SCALE = 0.9, 10_000.0


def look_up(database: Database, clutch_id: str) -> dict[str, Any]:
    """A clutch; raises NotFoundError."""
    with database.reading() as connection:
        (shown,) = _shown(connection, [records.clutch(connection, clutch_id)])
    return _item(*shown)


def every(database: Database, *, at_once: int) -> Iterator[dict[str, Any]]:
    """All clutches in use by their names, so many of them in memory."""
    part: Part | None = Part(at_once)
    while part is not None:
        with database.reading() as connection:
            rows = clutches.page(connection, Choice(), limit=part.most, after=part.after, by_name=True)
            items = [_item(*clutch) for clutch in _shown(connection, rows[:at_once])]
        yield from items
        place = part.next(rows, by_name("clutch_id"))
        part = None if place is None else Part(at_once, place)


def page_as_json(
    database: Database, cache: AnswerCache, choice: Choice, part: Part, *, offset: int = 0, sort: str = "worst"
) -> bytes:
    """A page of the clutches of a choice as JSON; each clutch's item is made once for its revision and verdict. By kind a
    page's place is how many clutches are before it."""
    by_kind, limit, after = sort == "kind", part.limit, part.after
    if by_kind:
        offset, after = offset + int(part.number or 0), None
    with database.reading() as connection:
        rows = clutches.page(
            connection, choice, limit=part.most, after=after, left_out=offset, by_name=sort == "name", by_kind=by_kind
        )
        clutches_shown = _shown(connection, rows[:limit])
    items = [
        cache.answer(
            ("clutch", row.clutch_id),
            (row.revision, row.state, to_json(verdict)),
            partial(_as_json, row, held_count, verdict, state),
        )
        for row, held_count, verdict, state in clutches_shown
    ]
    places = {
        "worst": lambda row: (row.rank, row.clutch_id),
        "name": by_name("clutch_id"),
        "kind": lambda _: (float(offset + limit), ""),
    }
    return page_as_bytes([item.body for item in items], part.next(rows, places[sort]))


def totals(database: Database, choice: Choice) -> dict[str, Any]:
    """How many clutches of a choice there are, and the cycles at the right end of their intervals' bars."""
    with database.reading() as connection:
        listed = clutches.counts(connection, choice)
        archived = clutches.counts(connection, replace(choice, archived=True))
        boundary = clutches.at_rank(connection, replace(choice, find=""), _FITTING, below=HORIZON)
    return {
        "all": sum(listed.states.values()),
        "archived": sum(archived.states.values()),
        "held": listed.held,
        "states": {name: listed.states.get(name, 0) for name in STATES},
        "scale_cycles": _USUAL_SCALE if boundary is None else _round_above(boundary),
    }


def _round_above(row: ClutchRow) -> float:
    """1, 2 or 5 times a power of ten, not below the upper end of a clutch's interval, or what is known of it."""
    quantiles = row.summary["remaining_cycles"]
    end = max(row.rank, *(end for end in (quantiles["0.5"], quantiles["0.95"]) if end is not None), 1.0)
    unit = 10.0 ** math.floor(math.log10(end))
    return next(step * unit for step in (1, 2, 5, 10) if step * unit >= end)


def _as_json(row: ClutchRow, held: int, verdict: dict[str, Any] | None, state: dict[str, Any]) -> bytes:
    return to_json(_item(row, held, verdict, state))


def _shown(
    connection: Connection, rows: Sequence[ClutchRow]
) -> list[tuple[ClutchRow, int, dict[str, Any] | None, dict[str, Any]]]:
    """Clutches, each with the number of its held runs, its newest finished diagnosis as it goes out, and its state with
    headline and action."""
    names = [row.clutch_id for row in rows]
    newest, held_counts = diagnoses.newest(connection, names), runs.held(connection, names)
    shown = []
    for row in rows:
        diagnosis = records.latest_diagnosis(row, newest.get(row.clutch_id))
        first = records.first_line(row, diagnosis)
        state = {"state": records.condition(row)}
        shown.append((row, held_counts.get(row.clutch_id, 0), diagnosis, state | first))
    return shown


def _item(row: ClutchRow, held: int, diagnosis: dict[str, Any] | None, state: dict[str, Any]) -> dict[str, Any]:
    from_summary = {
        "runs": row.summary.get("runs", 0),
        "recent": row.summary.get("recent"),
        "summary": stated(row.summary),
    }
    extra = state | from_summary | {"held": held, "diagnosis": diagnosis}
    return schema_fields(ClutchOut, row, **records.record(row).model_dump(mode="json") | extra)
