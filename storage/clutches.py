"""The table of clutches: the current record, the first record, and the summary that lists show."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa
from sqlalchemy import Connection, Select, Text, Update, bindparam, case, func, select, tuple_, update

from storage.dialects import among, json_fields
from storage.encoding import Json, Rows, to_text
from storage.tables import HELD_ONLY, clutch, run


@dataclass(frozen=True, slots=True, kw_only=True)
class ClutchRow:
    """A clutch. `record` has its defaults filled in, `created_at` is ISO 8601, lists sort by `rank`, ascending.

    `registered` is the record as it was first posted where it was edited since, else None. `state` is the name of the
    clutch's state, `disputed` the life of which the newest finished diagnosis leaves data and model in dispute, `silent`
    since when its rig has sent nothing, where that is an alarm.
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

    @property
    def is_disputed(self) -> bool:
        """Whether data and model are in dispute in the present life."""
        return self.disputed is not None and self.disputed == self.summary.get("life", "")


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Which clutches a list shows: in use or archived; of all or of `only` some; in one state; with runs that are held;
    whose id, friction material or fluid contains `find`, whatever its case."""

    archived: bool = False
    only: Collection[str] | None = None
    state: str | None = None
    held: bool = False
    find: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """How many clutches a choice holds by state, and how many of them have runs that are held."""

    states: dict[str, int]
    held: int


_stored = Rows(ClutchRow)
_insert = sa.insert(clutch)
_of_wanted = clutch.c.clutch_id == bindparam("wanted")
_by_id = select(clutch).where(_of_wanted)
#: What stands for itself in a pattern.
_ESCAPED = str.maketrans({sign: f"/{sign}" for sign in "%_/"})
_rows = select(clutch).where(clutch.c.clutch_id.in_(bindparam("wanted", expanding=True)))
_ids_of_page = select(clutch.c.clutch_id).limit(bindparam("most")).offset(bindparam("left_out"))
_worst_first = _ids_of_page.order_by(clutch.c.rank, clutch.c.clutch_id)
_by_name = _ids_of_page.order_by(clutch.c.clutch_id)
_kind = json_fields(clutch.c.record, "friction_material", "reaction_plate", "fluid")
_by_kind = _ids_of_page.order_by(_kind, clutch.c.rank, clutch.c.clutch_id)
_after = tuple_(clutch.c.rank, clutch.c.clutch_id) > tuple_(bindparam("after_rank"), bindparam("after_id"))
_after_name = clutch.c.clutch_id > bindparam("after_id")
_with_held_runs = clutch.c.clutch_id.in_(select(run.c.clutch_id).where(HELD_ONLY))
_states = select(clutch.c.state, func.count()).group_by(clutch.c.state)
_number = select(func.count()).select_from(clutch)
_below = (clutch.c.rank > 0, clutch.c.rank < bindparam("below"))
_life_as_disputed = case(
    (clutch.c.disputed == bindparam("life", type_=Text), bindparam("if_disputed", type_=Text)),
    else_=bindparam("else", type_=Text),
)
_set = update(clutch).where(_of_wanted)
_set_summary, _bump = _set.values(state=_life_as_disputed), _set.values(revision=clutch.c.revision + 1)
_revision: Select[int] = select(clutch.c.revision).where(_of_wanted)
_ids = select(clutch.c.clutch_id).order_by(clutch.c.clutch_id)
_revisions = select(clutch.c.clutch_id, clutch.c.revision).order_by(clutch.c.clutch_id)


def insert(connection: Connection, row: ClutchRow) -> None:
    """Store a new clutch. Raises IntegrityError where its id is taken."""
    connection.execute(_insert, _stored.values(row, searched=_searched(row.clutch_id, row.record)))


def get(connection: Connection, clutch_id: str) -> ClutchRow | None:
    return _stored.first(connection.execute(_by_id, {"wanted": clutch_id}))


def page(
    connection: Connection,
    choice: Choice = Choice(),
    *,
    limit: int,
    after: tuple[float, str] | None = None,
    left_out: int = 0,
    by_name: bool = False,
    by_kind: bool = False,
) -> list[ClutchRow]:
    """At most `limit` clutches of a choice, worst first, or by their ids: then none is left out or repeated however ranks
    change between two pages. `after` is the (rank, clutch_id) of the last clutch of the page before; the first `left_out`
    behind it are passed over. `by_kind`: those of the same materials and fluid together, worst first; without `after`."""
    query, values = _chosen(_by_kind if by_kind else _by_name if by_name else _worst_first, choice)
    values |= {"most": limit, "left_out": left_out}
    if after is not None:
        query = query.where(_after_name if by_name else _after)
        values |= {"after_id": after[1]} if by_name else {"after_rank": after[0], "after_id": after[1]}
    # their ids by an index alone, however many are passed over; then the rows
    ids = list(connection.execute(query, values).scalars())
    rows = {row.clutch_id: row for row in _stored.all(connection.execute(_rows, {"wanted": ids}))}
    return [rows[clutch_id] for clutch_id in ids]


def counts(connection: Connection, choice: Choice) -> Counts:
    by_state, values = _chosen(_states, choice)
    with_held, _ = _chosen(_number.where(_with_held_runs), choice)
    return Counts(
        states={state: int(number) for state, number in connection.execute(by_state, values)},
        held=connection.execute(with_held, values).scalar_one(),
    )


def at_rank(connection: Connection, choice: Choice, share: float, *, below: float) -> ClutchRow | None:
    """The clutch that this share of a choice is worse than, of those with a rank between 0 and `below`; None without any."""
    counted, values = _chosen(_number.where(*_below), choice)
    number: int = connection.execute(counted, values | {"below": below}).scalar_one()
    query, _ = _chosen(_worst_first.where(*_below), choice)
    values |= {"below": below, "most": 1, "left_out": int(share * max(0, number - 1))}
    clutch_id = connection.execute(query, values).scalar()
    return None if clutch_id is None else get(connection, clutch_id)


def _chosen(query: Select[Any], choice: Choice) -> tuple[Select[Any], dict[str, object]]:
    """A query of a choice's clutches alone, with its parameters."""
    query = query.where(clutch.c.archived == bindparam("of_archived"))
    values: dict[str, object] = {"of_archived": int(choice.archived)}
    if choice.only is not None:
        query, values = (
            query.where(among(clutch.c.clutch_id, "of_only")),
            values | {"of_only": to_text(sorted(choice.only))},
        )
    if choice.state is not None:
        query, values = query.where(clutch.c.state == bindparam("of_state")), values | {"of_state": choice.state}
    if choice.held:
        query = query.where(_with_held_runs)
    if choice.find:
        query = query.where(clutch.c.searched.like(bindparam("of_find"), escape="/"))
        values["of_find"] = f"%{choice.find.casefold().translate(_ESCAPED)}%"
    return query, values


def set_record(
    connection: Connection,
    clutch_id: str,
    *,
    record: Json,
    content_sha256: str,
    registered: Json | None,
    archived: bool,
) -> None:
    """Replace a clutch's record, and whether lists leave it out. Raises LookupError on an unknown clutch."""
    fields = {"record": record, "content_sha256": content_sha256, "registered": registered, "archived": archived}
    _change(connection, _set, clutch_id, _stored.columns(**fields) | {"searched": _searched(clutch_id, record)})


def set_summary(
    connection: Connection, clutch_id: str, rank: float, summary: Json, *, life: str, state: str, if_disputed: str
) -> None:
    """Replace what lists show of a clutch: `state` is its state's name, or `if_disputed` where `life` is in dispute. Raises
    LookupError on an unknown one."""
    states = {"life": life, "else": state, "if_disputed": if_disputed}
    _change(connection, _set_summary, clutch_id, {"rank": rank, "summary": to_text(summary)} | states)


def set_disputed(connection: Connection, clutch_id: str, disputed: str | None, *, state: str) -> None:
    """Note of which life data and model are in dispute, None: of none, and the state that follows. Raises LookupError on an
    unknown clutch."""
    _change(connection, _set, clutch_id, {"disputed": disputed, "state": state})


def set_silent(connection: Connection, clutch_id: str, silent: str | None, *, state: str) -> None:
    """Note since when a clutch's rig has sent nothing, None: it has, and the state that follows. Raises LookupError on an
    unknown clutch."""
    _change(connection, _set, clutch_id, {"silent": silent, "state": state})


def _change(connection: Connection, statement: Update, clutch_id: str, columns: Mapping[str, object]) -> None:
    if connection.execute(statement, {"wanted": clutch_id} | dict(columns)).rowcount != 1:
        raise LookupError(f"clutch {clutch_id!r} is not stored")


def bump_revision(connection: Connection, clutch_id: str) -> int:
    """Raise the clutch's revision by one and return it. Raises LookupError on an unknown one."""
    _change(connection, _bump, clutch_id, {})
    return connection.execute(_revision, {"wanted": clutch_id}).scalar_one()


def revision(connection: Connection, clutch_id: str) -> int | None:
    return connection.execute(_revision, {"wanted": clutch_id}).scalar_one_or_none()


def count(connection: Connection) -> int:
    """How many clutches there are, archived ones too."""
    return connection.execute(_number).scalar_one()


def count_within(connection: Connection, ranks: Sequence[float]) -> dict[float, int]:
    """How many clutches in use have at most each of these ranks; only those within the greatest are looked at."""
    counts = [func.coalesce(func.sum(case((clutch.c.rank <= rank, 1), else_=0)), 0) for rank in ranks]
    row = connection.execute(select(*counts).where(clutch.c.rank <= max(ranks), clutch.c.archived == 0)).one()
    return dict(zip(ranks, row, strict=True))


def all_ids(connection: Connection) -> list[str]:
    return list(connection.execute(_ids).scalars())


def revisions(connection: Connection) -> dict[str, int]:
    return {row.clutch_id: row.revision for row in connection.execute(_revisions)}


def _searched(clutch_id: str, record: Json) -> str:
    """What a search looks into. Folded here: of the two databases each would fold other letters."""
    return "\n".join([clutch_id, record.get("friction_material", ""), record.get("fluid", "")]).casefold()
