"""Clutches: the record in force and the one that was posted, and the summary that lists show."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import sqlalchemy as sa
from sqlalchemy import Connection, Row, bindparam, case, func, select, tuple_, update

from storage.dialects import among
from storage.encoding.json_text import Json, to_object, to_text
from storage.tables import clutch


@dataclass(frozen=True, slots=True, kw_only=True)
class ClutchRow:
    """A clutch. `record` has its defaults filled in, `created_at` is ISO 8601, lists sort by `rank`, ascending.

    `registered` is the record as it was first posted where it was edited since, else None.
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


_insert = sa.insert(clutch)
_of_wanted = clutch.c.clutch_id == bindparam("wanted")
_by_id = select(clutch).where(_of_wanted)
_worst_first = (
    select(clutch)
    .where(clutch.c.archived == bindparam("of_archived"))
    .order_by(clutch.c.rank, clutch.c.clutch_id)
    .limit(bindparam("most"))
)
_only = among(clutch.c.clutch_id, "of_only")
_worst_first_after = _worst_first.where(
    tuple_(clutch.c.rank, clutch.c.clutch_id) > tuple_(bindparam("after_rank"), bindparam("after_id"))
)
_set_summary = update(clutch).where(_of_wanted).values(rank=bindparam("new_rank"), summary=bindparam("new_summary"))
_set_record = (
    update(clutch)
    .where(_of_wanted)
    .values(
        record=bindparam("new_record"),
        content_sha256=bindparam("new_content"),
        registered=bindparam("new_registered"),
        archived=bindparam("new_archived"),
    )
)
_bump = update(clutch).where(_of_wanted).values(revision=clutch.c.revision + 1)
_revision = select(clutch.c.revision).where(_of_wanted)
_count = select(func.count()).select_from(clutch)
_ids = select(clutch.c.clutch_id).order_by(clutch.c.clutch_id)
_revisions = select(clutch.c.clutch_id, clutch.c.revision).order_by(clutch.c.clutch_id)


def insert(connection: Connection, row: ClutchRow) -> None:
    """Store a new clutch. Raises IntegrityError where its id is taken."""
    values = {
        "clutch_id": row.clutch_id,
        "record": to_text(row.record),
        "content_sha256": row.content_sha256,
        "created_at": row.created_at,
        "revision": row.revision,
        "rank": row.rank,
        "summary": to_text(row.summary),
        "archived": int(row.archived),
        "registered": None if row.registered is None else to_text(row.registered),
    }
    connection.execute(_insert, values)


def get(connection: Connection, clutch_id: str) -> ClutchRow | None:
    """The clutch, or None."""
    row = connection.execute(_by_id, {"wanted": clutch_id}).first()
    return None if row is None else _row(row)


def page(
    connection: Connection,
    *,
    limit: int,
    after: tuple[float, str] | None = None,
    archived: bool = False,
    only: Collection[str] | None = None,
) -> list[ClutchRow]:
    """At most `limit` clutches that are archived, or are not, worst first; `after` is the (rank, clutch_id) of the last
    clutch of the page before; of all or of `only` some."""
    values: dict[str, object] = {"most": limit, "of_archived": int(archived)}
    query = _worst_first
    if after is not None:
        query, values = _worst_first_after, values | {"after_rank": after[0], "after_id": after[1]}
    if only is not None:
        query, values = query.where(_only), values | {"of_only": to_text(sorted(only))}
    return [_row(row) for row in connection.execute(query, values)]


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
    values = {
        "wanted": clutch_id,
        "new_record": to_text(record),
        "new_content": content_sha256,
        "new_registered": None if registered is None else to_text(registered),
        "new_archived": int(archived),
    }
    if connection.execute(_set_record, values).rowcount != 1:
        raise LookupError(f"clutch {clutch_id!r} is not stored")


def set_summary(connection: Connection, clutch_id: str, rank: float, summary: Json) -> None:
    """Replace what lists show of a clutch. Raises LookupError on an unknown one."""
    changed = connection.execute(_set_summary, {"wanted": clutch_id, "new_rank": rank, "new_summary": to_text(summary)})
    if changed.rowcount != 1:
        raise LookupError(f"clutch {clutch_id!r} is not stored")


def bump_revision(connection: Connection, clutch_id: str) -> int:
    """Raise the clutch's revision by one and return it. Raises LookupError on an unknown one."""
    changed = connection.execute(_bump, {"wanted": clutch_id})
    if changed.rowcount != 1:
        raise LookupError(f"clutch {clutch_id!r} is not stored")
    revision: int = connection.execute(_revision, {"wanted": clutch_id}).scalar_one()
    return revision


def revision(connection: Connection, clutch_id: str) -> int | None:
    """The clutch's revision, or None."""
    number: int | None = connection.execute(_revision, {"wanted": clutch_id}).scalar_one_or_none()
    return number


def count(connection: Connection) -> int:
    """How many clutches there are, archived ones too."""
    number: int = connection.execute(_count).scalar_one()
    return number


def count_within(connection: Connection, ranks: Sequence[float]) -> dict[float, int]:
    """How many clutches in use have at most each of these ranks; only those within the greatest are looked at."""
    counts = [func.coalesce(func.sum(case((clutch.c.rank <= rank, 1), else_=0)), 0) for rank in ranks]
    row = connection.execute(select(*counts).where(clutch.c.rank <= max(ranks), clutch.c.archived == 0)).one()
    return dict(zip(ranks, row, strict=True))


def all_ids(connection: Connection) -> list[str]:
    """The ids of all clutches, ascending."""
    return list(connection.execute(_ids).scalars())


def revisions(connection: Connection) -> dict[str, int]:
    """The revisions of all clutches by id, ascending."""
    return {row.clutch_id: row.revision for row in connection.execute(_revisions)}


def _row(row: Row[tuple[object, ...]]) -> ClutchRow:
    values = row._asdict()
    values["record"] = to_object(values["record"])
    values["summary"] = to_object(values["summary"])
    values["archived"] = bool(values["archived"])
    values["registered"] = None if values["registered"] is None else to_object(values["registered"])
    return ClutchRow(**values)
