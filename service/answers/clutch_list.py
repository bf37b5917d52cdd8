"""`/v1/clutches`: clutches by who needs somebody or by name, as lists show them; `/v1/fleet/totals`: how many there are."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from sqlalchemy import Connection

from models.prognosis.criteria import HORIZON
from service import repository
from service.alarms import raising
from service.answers.store import AnswerStore, to_json
from service.api.alarm import EventOut
from service.api.base import of_row
from service.api.clutch import ClutchOut, LatestDiagnosis
from service.api.fleet import FleetTotals, StateCounts
from service.clutch.condition import NORMAL, RANK_ENDED, STATES, as_stored, stated
from service.paging import Part, by_name, page_as_bytes
from storage import alarms, clutches, diagnoses
from storage.clutches import ByNeed, ClutchRow, ClutchSelection
from storage.engine.database import Database

#: Share of the clutches whose bars fit, and the cycles at the bars' end where nothing is predicted. Chosen: one that lasts
#: much longer than the others must not shorten their bars to nothing; a rig's usual life.
_FITTING, _USUAL_SCALE = 0.9, 10_000.0
#: The order of lists: states by how soon they need somebody, ended lives last.
_BY_NEED = ByNeed(states=[name for name in STATES if name != NORMAL], over=RANK_ENDED)


def look_up(database: Database, clutch_id: str) -> ClutchOut:
    """A clutch; raises NotFoundError."""
    with database.reading() as connection:
        (shown,) = _shown(connection, [repository.clutch(connection, clutch_id)])
    return _item(shown)


def every(database: Database, *, at_once: int) -> Iterator[ClutchOut]:
    """All clutches in use, by name, read `at_once` at a time."""
    part: Part | None = Part(at_once)
    while part is not None:
        with database.reading() as connection:
            rows = clutches.page(connection, ClutchSelection(), limit=part.most, after=part.name)
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
    """A page of the chosen clutches as JSON; each clutch's item is cached for its revision, verdict and alarms. In an
    order other than by name, a page's cursor is the number of clutches before it."""
    named, limit = sort == "name", part.limit
    before = offset + (0 if named else int(max(0.0, part.number or 0.0)))
    with database.reading() as connection:
        rows = clutches.page(
            connection,
            choice,
            limit=part.most,
            after=part.name,
            left_out=before,
            by_need=None if named else _BY_NEED,
            by_kind=sort == "kind",
        )
        clutches_shown = _shown(connection, rows[:limit])

    def item(clutch: _Shown) -> bytes:
        beside = [to_json(each) for each in (clutch.diagnosis, *clutch.alarms) if each is not None]
        version = (clutch.row.revision, clutch.row.state, *beside)
        return answers.answer(("clutch", clutch.row.clutch_id), version, lambda: to_json(_item(clutch))).body

    place = by_name("clutch_id") if named else lambda _: (float(before + limit), "")
    return page_as_bytes(list(map(item, clutches_shown)), part.next(rows, place))


def totals(database: Database, choice: ClutchSelection) -> FleetTotals:
    """The number of chosen clutches, and the cycles at the right end of the bars of their intervals."""
    with database.reading() as connection:
        listed = clutches.counts(connection, choice)
        archived = clutches.counts(connection, replace(choice, archived=True))
        raised = alarms.count_raised(connection, choice.only)
        boundary = clutches.at_rank(connection, replace(choice, find=""), _FITTING, below=HORIZON)
    return FleetTotals(
        all=sum(listed.states.values()),
        archived=sum(archived.states.values()),
        held=listed.held,
        alarms=raised,
        states=StateCounts(**{name: listed.states.get(name, 0) for name in STATES}),
        scale_cycles=_USUAL_SCALE if boundary is None else _round_above(boundary),
    )


def _round_above(row: ClutchRow) -> float:
    """The smallest 1, 2, 5 or 10 times a power of ten that is at least the upper end of a clutch's interval of
    remaining cycles."""
    quantiles = row.summary["remaining_cycles"]
    end = max(row.rank, *(end for end in (quantiles["0.5"], quantiles["0.95"]) if end is not None), 1.0)
    unit = 10.0 ** math.floor(math.log10(end))
    return next(step * unit for step in (1, 2, 5, 10) if step * unit >= end)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shown:
    """A clutch with its newest finished diagnosis and its unacknowledged alarms, both as sent to clients."""

    row: ClutchRow
    diagnosis: LatestDiagnosis | None
    alarms: list[EventOut]


def _shown(connection: Connection, rows: Sequence[ClutchRow]) -> list[_Shown]:
    """The clutches of these rows, each with its newest diagnosis and its unacknowledged alarms."""
    names = [row.clutch_id for row in rows]
    newest, raised = diagnoses.newest(connection, names), alarms.raised(connection, names)
    return [
        _Shown(
            row=row,
            diagnosis=repository.latest_diagnosis(row, newest.get(row.clutch_id)),
            alarms=[raising.event_out(event) for event in raised.get(row.clutch_id, [])],
        )
        for row in rows
    ]


def _item(clutch: _Shown) -> ClutchOut:
    """A clutch as the list of clutches shows it."""
    row, diagnosis = clutch.row, clutch.diagnosis
    first_line = repository.first_line(row, diagnosis, raised=len(clutch.alarms))
    return of_row(
        ClutchOut,
        row,
        **repository.record(row).model_dump(mode="json"),
        **first_line,
        what_to_do=first_line["action"],
        open_alarms=len(clutch.alarms),
        state=repository.condition(row),
        runs=row.summary.get("runs", 0),
        recent=row.summary.get("recent"),
        summary=stated(as_stored(row.summary)),
        held=row.summary.get("held", 0),
        alarms=clutch.alarms,
        diagnosis=diagnosis,
    )
