"""The table of clutches: the current record, the first record, and the summary that lists show."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Connection, Select, bindparam, case, func, select

from storage.dialects import among, json_fields
from storage.encoding import Json, to_text
from storage.engine.errors import DamagedData
from storage.rows import Rows, amend
from storage.tables import HELD_ONLY, NOT_CLEARED, alarm_event, clutch, run


@dataclass(frozen=True, slots=True, kw_only=True)
class ClutchRow:
    """A clutch. `record` has its defaults filled in, `created_at` is ISO 8601, lists sort by `rank`, ascending.

    `registered` is the record as it was first posted where it was edited since, else None. `state` is the name of the
    clutch's state, `disputed` the life of which the newest finished diagnosis leaves data and model in dispute, `silent`
    since when its rig has sent nothing, where that is an alarm. `states_sum` is the checksum over those of its filter states
    (`results.states_sum`).
    """

    clutch_id: str
    record: Json
    content_sha256: str
    created_at: str
    revision: int
    rank: float
    summary: Json
    archived: bool = False
    registered: Json | None = None
    state: str = "check"
    disputed: str | None = None
    silent: str | None = None
    states_sum: int = 0

    @property
    def is_disputed(self) -> bool:
        """Whether data and model disagree in the present life."""
        return self.disputed is not None and self.disputed == self.summary.get("life", "")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClutchSelection:
    """The clutches of a list: in use or archived; all or `only` some; in one state; with held runs; with `find` in id,
    friction material or fluid, ignoring case."""

    archived: bool = False
    only: Collection[str] | None = None
    state: str | None = None
    held: bool = False
    find: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ByNeed:
    """An order of clutches by urgency: those in one of `states`, in that order; then those with an unacknowledged
    alarm; then the others; last those with a rank of `over` or more, because their lives have ended."""

    states: Sequence[str]
    over: float

    def place(self) -> ColumnElement[int]:
        """The position of a clutch's group, 0 first."""
        of_state = [(clutch.c.state == name, place) for place, name in enumerate(self.states)]
        count = len(of_state)
        return case((clutch.c.rank >= self.over, count + 2), *of_state, (_with_raised_alarm, count), else_=count + 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """The numbers of chosen clutches by state, and of those with held runs."""

    states: dict[str, int]
    held: int


_stored = Rows(ClutchRow, of=clutch)
#: What stands for itself in a pattern.
_ESCAPED = str.maketrans({sign: f"/{sign}" for sign in "%_/"})
_kind = json_fields(clutch.c.record, "friction_material", "reaction_plate", "fluid")
_worst_first = (clutch.c.rank, clutch.c.clutch_id)
_with_held_runs = clutch.c.clutch_id.in_(select(run.c.clutch_id).where(HELD_ONLY))
_with_raised_alarm = clutch.c.clutch_id.in_(
    select(alarm_event.c.clutch_id).where(NOT_CLEARED, alarm_event.c.acknowledged_at.is_(None))
)
_number = select(func.count()).select_from(clutch)
_named, _revision = (select(what).where(clutch.c.clutch_id == bindparam("of")) for what in (clutch, clutch.c.revision))


def insert(connection: Connection, row: ClutchRow) -> None:
    """Store a new clutch. Raises IntegrityError if its id is taken."""
    connection.execute(clutch.insert(), _stored.values(row, searched=_searched(row.clutch_id, row.record)))


def get(connection: Connection, clutch_id: str) -> ClutchRow | None:
    return _stored.first(connection.execute(_named, {"of": clutch_id}))


def page(
    connection: Connection,
    choice: ClutchSelection = ClutchSelection(),
    *,
    limit: int | None,
    after: str = "",
    left_out: int = 0,
    by_need: ByNeed | None = None,
    by_kind: bool = False,
) -> list[ClutchRow]:
    """At most `limit` clutches of a choice by id, after the id `after`; none is skipped or repeated if clutches change
    between two pages. `by_need`: the most urgent first, then the lowest rank; `by_kind`: the same materials and fluid
    together. The first `left_out` are skipped."""
    order: list[ColumnElement[Any]] = [clutch.c.clutch_id]
    if by_need is not None:
        order = [*([_kind] if by_kind else []), by_need.place(), *_worst_first]
    query = _chosen(select(clutch.c.clutch_id), choice).order_by(*order).limit(limit).offset(left_out)
    if after:
        query = query.where(clutch.c.clutch_id > after)
    # their ids by an index alone, however many are passed over; then the rows
    ids = list(connection.execute(query).scalars())
    found = connection.execute(select(clutch).where(clutch.c.clutch_id.in_(ids)))
    of = _stored.reader(found)
    rows = {row.clutch_id: _whole_or_damaged(of, row) for row in found}
    return [rows[clutch_id] for clutch_id in ids]


def _whole_or_damaged(of: Callable[[Any], ClutchRow], row: Any) -> ClutchRow:
    """The clutch; if its row is damaged, one of that name without record and results, with a summary that says so, so
    that a list of clutches does not fail."""
    try:
        return of(row)
    except DamagedData as error:
        return ClutchRow(
            clutch_id=row.clutch_id,
            record={"clutch_id": row.clutch_id},
            content_sha256="",
            created_at="",
            revision=row.revision,
            rank=row.rank,
            summary={"damaged": str(error)},
            archived=bool(row.archived),
        )


def counts(connection: Connection, choice: ClutchSelection) -> Counts:
    by_state = _chosen(select(clutch.c.state, func.count()), choice).group_by(clutch.c.state)
    return Counts(
        states={state: int(number) for state, number in connection.execute(by_state)},
        held=connection.execute(_chosen(_number, choice).where(_with_held_runs)).scalar_one(),
    )


def at_rank(connection: Connection, choice: ClutchSelection, share: float, *, below: float) -> ClutchRow | None:
    """The clutch at the quantile `share` of a choice ordered worst first, among ranks between 0 and `below`; None if
    there are none."""
    ranked = (clutch.c.rank > 0, clutch.c.rank < below)
    number: int = connection.execute(_chosen(_number, choice).where(*ranked)).scalar_one()
    ids = _chosen(select(clutch.c.clutch_id), choice).where(*ranked).order_by(*_worst_first)
    clutch_id = connection.execute(ids.limit(1).offset(int(share * max(0, number - 1)))).scalar()
    return None if clutch_id is None else get(connection, clutch_id)


def _chosen(query: Select[Any], choice: ClutchSelection) -> Select[Any]:
    """The query, restricted to the chosen clutches."""
    query = query.where(clutch.c.archived == int(choice.archived))
    if choice.only is not None:
        query = query.where(among(clutch.c.clutch_id, sorted(choice.only)))
    if choice.state is not None:
        query = query.where(clutch.c.state == choice.state)
    if choice.held:
        query = query.where(_with_held_runs)
    if choice.find:
        pattern = f"%{choice.find.casefold().translate(_ESCAPED)}%"
        query = query.where(clutch.c.searched.like(pattern, escape="/"))
    return query


def set_record(
    connection: Connection,
    clutch_id: str,
    *,
    record: Json,
    content_sha256: str,
    registered: Json | None,
    archived: bool,
) -> None:
    """Replace a clutch's record, and whether it is archived. Raises LookupError on an unknown clutch."""
    fields = {"record": record, "content_sha256": content_sha256, "registered": registered, "archived": archived}
    _change(connection, clutch_id, _stored.columns(**fields) | {"searched": _searched(clutch_id, record)})


def set_summary(
    connection: Connection,
    clutch_id: str,
    rank: float,
    summary: Json,
    *,
    life: str,
    state: str,
    if_disputed: str,
    states_sum: int | None = None,
) -> None:
    """Replace a clutch's summary and rank for lists; its state becomes `state`, or `if_disputed` if data and model
    disagree in `life`; and the checksum of its filter states, unless None. Raises LookupError on an unknown clutch."""
    state_name = lambda row: if_disputed if row["disputed"] == life else state  # noqa: E731
    states = {} if states_sum is None else {"states_sum": states_sum}
    _change(connection, clutch_id, {"rank": rank, "summary": to_text(summary), "state": state_name} | states)


def set_disputed(connection: Connection, clutch_id: str, disputed: str | None, *, state: str) -> None:
    """Store the life in which data and model disagree (None: none), and the resulting state. Raises LookupError on an
    unknown clutch."""
    _change(connection, clutch_id, {"disputed": disputed, "state": state})


def set_silent(connection: Connection, clutch_id: str, silent: str | None, *, state: str) -> None:
    """Store since when a clutch's rig has sent nothing (None: it is not silent), and the resulting state. Raises
    LookupError on an unknown clutch."""
    _change(connection, clutch_id, {"silent": silent, "state": state})


def _change(connection: Connection, clutch_id: str, columns: Mapping[str, Any]) -> dict[str, Any]:
    """The clutch's row with changed columns."""
    rows = amend(connection, clutch, [clutch.c.clutch_id == clutch_id], **columns)
    if not rows:
        raise LookupError(f"clutch {clutch_id!r} is not stored")
    return rows[0]


def bump_revision(connection: Connection, clutch_id: str) -> int:
    """Raise the clutch's revision by one and return it. Raises LookupError on an unknown one."""
    return int(_change(connection, clutch_id, {"revision": lambda row: row["revision"] + 1})["revision"])


def revision(connection: Connection, clutch_id: str) -> int | None:
    return connection.execute(_revision, {"of": clutch_id}).scalar_one_or_none()


def count(connection: Connection) -> int:
    """The number of clutches, including archived ones."""
    return connection.execute(_number).scalar_one()


def count_within(connection: Connection, ranks: Sequence[float]) -> dict[float, int]:
    """The numbers of clutches in use with at most each of these ranks; only those within the greatest are read."""
    counts = [func.coalesce(func.sum(case((clutch.c.rank <= rank, 1), else_=0)), 0) for rank in ranks]
    row = connection.execute(select(*counts).where(clutch.c.rank <= max(ranks), clutch.c.archived == 0)).one()
    return dict(zip(ranks, row, strict=True))


def all_ids(connection: Connection) -> list[str]:
    return list(connection.execute(select(clutch.c.clutch_id).order_by(clutch.c.clutch_id)).scalars())


def revisions(connection: Connection) -> dict[str, int]:
    rows = connection.execute(select(clutch.c.clutch_id, clutch.c.revision).order_by(clutch.c.clutch_id))
    return {row.clutch_id: row.revision for row in rows}


def _searched(clutch_id: str, record: Json) -> str:
    """The text that a search looks into, with case folded here, because the two databases fold case differently."""
    return "\n".join([clutch_id, record.get("friction_material", ""), record.get("fluid", "")]).casefold()
