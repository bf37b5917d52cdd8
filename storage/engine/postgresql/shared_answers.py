"""The last computed answers in a table of their own, which is not logged.

A server that crashes empties it, and the answers are computed again: nothing in it is anything else than computed.
"""

from sqlalchemy import BigInteger, Column, LargeBinary, Table, Text, bindparam, or_, select
from sqlalchemy.dialects.postgresql import insert

from storage.engine.postgresql.server_tables import server_tables
from storage.engine.postgresql.single_statements import SingleStatements
from storage.engine.shared_answers import SharedAnswer, SharedAnswers

shared_answer = Table(
    "shared_answer",
    server_tables,
    Column("clutch_id", Text, primary_key=True),
    Column("name", Text, primary_key=True),
    Column("release", Text, nullable=False),
    Column("revision", BigInteger, nullable=False),
    Column("body", LargeBinary, nullable=False),
    prefixes=["UNLOGGED"],
)

_newest = select(shared_answer).where(
    shared_answer.c.clutch_id == bindparam("clutch"),
    shared_answer.c.name == bindparam("asked"),
    shared_answer.c.release == bindparam("by"),
)
_new = insert(shared_answer)
#: Another build's answer is replaced, whatever its revision: a clutch has one row of a name.
_keep = _new.on_conflict_do_update(
    index_elements=["clutch_id", "name"],
    set_={name: _new.excluded[name] for name in ("release", "revision", "body")},
    where=or_(
        shared_answer.c.release != _new.excluded["release"], shared_answer.c.revision <= _new.excluded["revision"]
    ),
)


class ServerAnswers(SharedAnswers):
    """Each is read and written by one statement outside transactions."""

    def __init__(self, statements: SingleStatements) -> None:
        self._statements = statements

    def newest(self, clutch_id: str, name: str, release: str) -> SharedAnswer | None:
        """The last one that a service of that build computed, None where there is none."""
        rows = self._statements.rows(_newest, {"clutch": clutch_id, "asked": name, "by": release})
        return SharedAnswer(**rows[0]) if rows else None

    def keep(self, answer: SharedAnswer) -> None:
        """Keep an answer, unless one of a later revision is kept."""
        self._statements.rows(_keep, {column.name: getattr(answer, column.name) for column in shared_answer.columns})
