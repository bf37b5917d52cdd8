"""`/v1/clutches`: clutches worst first or by name, as lists show them; `/v1/fleet/totals`: how many there are."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from sqlalchemy import Connection

from models.prognosis.criteria import HORIZON
from service import repository
from service.answers.store import AnswerStore, to_json
from service.api.base import of_row
from service.api.clutch import ClutchOut, LatestDiagnosis
from service.api.fleet import FleetTotals, StateCounts
from service.clutch.condition import STATES, stated
from service.paging import Part, by_name, page_as_bytes
from storage import clutches, diagnoses, runs
from storage.clutches import ClutchRow, ClutchSelection
from storage.engine.database import Database

#: Share of the clutches whose bars fit, and the cycles at the bars' end where nothing is predicted. Chosen: one that lasts
#: much longer than the others must not shorten their bars to nothing; a rig's usual life.
_FITTING, _USUAL_SCALE = 0.9, 10_000.0


def look_up(database: Database, clutch_id: str) -> ClutchOut:
    """A clutch; raises NotFoundError."""
    with database.reading() as connection:
        (shown,) = _shown(connection, [repository.clutch(connection, clutch_id)])
    return _item(shown)


def every(database: Database, *, at_once: int) -> Iterator[ClutchOut]:
    """All clutches in use by their names, so many of them in memory."""
    part: Part | None = Part(at_once)
    while part is not None:
        with database.reading() as connection:
            rows = clutches.page(connection, ClutchSelection(), limit=part.most, after=part.after, by_name=True)
            items = list(map(_item, _shown(connection, rows[:at_once])))
        yield from items
        place = part.next(rows, by_name("clutch_id"))
        part = None if place is None else Part(at_once, place)


def page_as_json(
    database: Database,
    answers: AnswerStore,
    choice: ClutchSelection,
    part: Part,
    *,
    offset: int = 0,
    sort: str = "worst",
) -> bytes:
    """A page of the clutches of a choice; each one's item is made once for its revision and verdict. By kind, a page's place
    is how many clutches are before it."""
    by_kind, limit, after = sort == "kind", part.limit, part.after
    if by_kind:
        offset, after = offset + int(part.number or 0), None
    with database.reading() as connection:
        rows = clutches.page(
            connection, choice, limit=part.most, after=after, left_out=offset, by_name=sort == "name", by_kind=by_kind
        )
        clutches_shown = _shown(connection, rows[:limit])

    def item(clutch: _Shown) -> bytes:
        row, _, diagnosis, _ = clutch
        version = (row.revision, row.state, None if diagnosis is None else to_json(diagnosis))
        return answers.answer(("clutch", row.clutch_id), version, lambda: to_json(_item(clutch))).body

    places = {
        "worst": lambda row: (row.rank, row.clutch_id),
        "name": by_name("clutch_id"),
        "kind": lambda _: (float(offset + limit), ""),
    }
    return page_as_bytes(list(map(item, clutches_shown)), part.next(rows, places[sort]))


def totals(database: Database, choice: ClutchSelection) -> FleetTotals:
    """How many clutches of a choice there are, and the cycles at the right end of their intervals' bars."""
    with database.reading() as connection:
        listed = clutches.counts(connection, choice)
        archived = clutches.counts(connection, replace(choice, archived=True))
        boundary = clutches.at_rank(connection, replace(choice, find=""), _FITTING, below=HORIZON)
    return FleetTotals(
        all=sum(listed.states.values()),
        archived=sum(archived.states.values()),
        held=listed.held,
        states=StateCounts(**{name: listed.states.get(name, 0) for name in STATES}),
        scale_cycles=_USUAL_SCALE if boundary is None else _round_above(boundary),
    )


def _round_above(row: ClutchRow) -> float:
    """1, 2 or 5 times a power of ten, not below the upper end of a clutch's interval, or what is known of it."""
    quantiles = row.summary["remaining_cycles"]
    end = max(row.rank, *(end for end in (quantiles["0.5"], quantiles["0.95"]) if end is not None), 1.0)
    unit = 10.0 ** math.floor(math.log10(end))
    return next(step * unit for step in (1, 2, 5, 10) if step * unit >= end)


#: A clutch with the number of its held runs, its newest finished diagnosis as it goes out, and its state with headline and
#: action.
_Shown = tuple[ClutchRow, int, LatestDiagnosis | None, dict[str, object]]


def _shown(connection: Connection, rows: Sequence[ClutchRow]) -> list[_Shown]:
    names = [row.clutch_id for row in rows]
    newest, held_counts = diagnoses.newest(connection, names), runs.held(connection, names)
    shown = []
    for row in rows:
        diagnosis = repository.latest_diagnosis(row, newest.get(row.clutch_id))
        state: dict[str, object] = {"state": repository.condition(row), **repository.first_line(row, diagnosis)}
        shown.append((row, held_counts.get(row.clutch_id, 0), diagnosis, state))
    return shown


def _item(clutch: _Shown) -> ClutchOut:
    row, held, diagnosis, state = clutch
    return of_row(
        ClutchOut,
        row,
        **repository.record(row).model_dump(mode="json") | state,
        runs=row.summary.get("runs", 0),
        recent=row.summary.get("recent"),
        summary=stated(row.summary),
        held=held,
        diagnosis=diagnosis,
    )
