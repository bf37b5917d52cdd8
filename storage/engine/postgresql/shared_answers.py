"""The last computed answers in a table of their own, which is not logged.

A server that crashes empties it, and the answers are computed again: nothing in it is anything else than computed.
"""

from sqlalchemy import BigInteger, Column, LargeBinary, Table, Text, bindparam, or_, select, text
from sqlalchemy.dialects.postgresql import insert

from storage.engine.postgresql.asking import Asking
from storage.engine.postgresql.locks import SERVICE_KEY
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
#: One statement, and so one transaction: from the question whether a service runs until the table is empty none starts.
_FORGET = text(f"""
DO $$ BEGIN
  IF pg_try_advisory_xact_lock({SERVICE_KEY}) THEN TRUNCATE shared_answer; END IF;
END $$
""")


class ServerAnswers(SharedAnswers):
    """Each is read and written by one statement outside transactions."""

    def __init__(self, asking: Asking) -> None:
        self._server = asking

    def newest(self, clutch_id: str, name: str, release: str) -> SharedAnswer | None:
        """The last one that a service of that release computed, None where there is none."""
        rows = self._server.rows(_newest, {"clutch": clutch_id, "asked": name, "by": release})
        return SharedAnswer(**rows[0]) if rows else None

    def keep(self, answer: SharedAnswer) -> None:
        """Keep an answer, unless one of a later revision is kept."""
        self._server.rows(_keep, {column.name: getattr(answer, column.name) for column in shared_answer.columns})

    def forget_where_no_service_runs(self) -> None:
        """Begin anew: another build of the same release may compute otherwise, and a restored database may come to the same
        revisions by other runs."""
        self._server.rows(_FORGET, {})
