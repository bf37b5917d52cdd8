"""The last computed answers in a table of their own, which is not logged.

A server that crashes empties it, and the answers are computed again: nothing in it is anything else than computed.
"""

from sqlalchemy import BigInteger, Column, Engine, LargeBinary, Table, Text, bindparam, or_, select
from sqlalchemy.dialects.postgresql import insert

from storage.engine.postgresql.driver_errors import translated
from storage.engine.postgresql.server_tables import server_tables
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
#: Another release's answer is replaced, whatever its revision: a clutch has one row of a name.
_keep = _new.on_conflict_do_update(
    index_elements=["clutch_id", "name"],
    set_={name: _new.excluded[name] for name in ("release", "revision", "body")},
    where=or_(
        shared_answer.c.release != _new.excluded["release"], shared_answer.c.revision <= _new.excluded["revision"]
    ),
)


class ServerAnswers(SharedAnswers):
    """Each is read and written by one statement outside transactions: `engine` is one of `connect.make_asking_engine`."""

    def __init__(self, engine: Engine, name: str) -> None:
        self._engine = engine
        self._name = name

    def newest(self, clutch_id: str, name: str, release: str) -> SharedAnswer | None:
        """The last one that a service of that release computed, None where there is none."""
        with translated(self._name), self._engine.connect() as connection:
            row = connection.execute(_newest, {"clutch": clutch_id, "asked": name, "by": release}).mappings().first()
        return None if row is None else SharedAnswer(**row)

    def keep(self, answer: SharedAnswer) -> None:
        """Keep an answer, unless one of a later revision is kept."""
        row = {column.name: getattr(answer, column.name) for column in shared_answer.columns}
        with translated(self._name), self._engine.connect() as connection:
            connection.execute(_keep, row)
