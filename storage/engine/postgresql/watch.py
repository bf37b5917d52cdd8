"""What every request asks of a server: one statement for all who ask, so that no answer is older than its question.

A service asks from its event loop, which does not wait: one statement at a time is under way in a thread, and requests that
come meanwhile share the next.
"""

import asyncio
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from sqlalchemy import Engine, Row, text
from sqlalchemy.exc import DBAPIError

from storage.engine.postgresql.driver_errors import translated
from storage.engine.watch import Glance, Question, Watch, granted

_GLANCE = text("""
SELECT (SELECT number FROM commits) AS version,
       EXISTS (SELECT 1 FROM access_key) AS keys_are_needed,
       (SELECT json_object_agg(clutch_id, revision) FROM clutch WHERE clutch_id = ANY(:clutches)) AS revisions,
       (SELECT json_object_agg(secret_sha256, json_build_array(key_id, scope, note, clutches, expires_at))
          FROM access_key WHERE secret_sha256 = ANY(:secrets) AND revoked_at IS NULL) AS keys
""")


class ServerWatch(Watch):
    """The questions, of connections that begin no transaction: `engine` is for such (`connect.make_asking_engine`)."""

    def __init__(self, engine: Engine, name: str) -> None:
        self._engine = engine
        self._name = name
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="watch")
        self._waiting: list[tuple[Question, asyncio.Future[Glance]]] = []
        self._asking: asyncio.Task[None] | None = None

    def glances(self, questions: Sequence[Question]) -> list[Glance]:
        """What is so now, question by question, all at the same moment."""
        # no clutch is named by what the server cannot store
        clutches = sorted(
            {
                question.clutch_id
                for question in questions
                if question.clutch_id is not None and "\0" not in question.clutch_id
            }
        )
        secrets = sorted({question.secret_sha256 for question in questions if question.secret_sha256 is not None})
        with translated(self._name):
            row = self._row({"clutches": clutches, "secrets": secrets})
        revisions, keys = row.revisions or {}, row.keys or {}
        return [
            Glance(
                version=row.version or 0,
                keys_are_needed=row.keys_are_needed,
                key=granted(tuple(keys[question.secret_sha256])) if question.secret_sha256 in keys else None,
                revision=revisions.get(question.clutch_id),
            )
            for question in questions
        ]

    async def look(self, question: Question) -> Glance:
        """What is so now, for one who asks from the event loop."""
        answer: asyncio.Future[Glance] = asyncio.get_running_loop().create_future()
        self._waiting.append((question, answer))
        if self._asking is None:
            self._asking = asyncio.create_task(self._ask())
        return await answer

    def close(self) -> None:
        """End the thread; nobody may ask any more."""
        self._thread.shutdown()

    async def _ask(self) -> None:
        """Ask for all who wait, until nobody does."""
        while self._waiting:
            questions, self._waiting = self._waiting, []
            try:
                glances = await asyncio.get_running_loop().run_in_executor(
                    self._thread, self.glances, [question for question, _ in questions]
                )
            except Exception as error:  # noqa: BLE001  (raised again for each who asked)
                for _, answer in questions:
                    if not answer.done():
                        answer.set_exception(error)
            else:
                for (_, answer), glance in zip(questions, glances, strict=True):
                    if not answer.done():  # who asked may have gone
                        answer.set_result(glance)
        self._asking = None

    def _row(self, values: dict[str, list[str]]) -> Row[tuple[object, ...]]:
        try:
            return self._executed(values)
        except DBAPIError as error:
            if not error.connection_invalidated:
                raise
        # the server was started again: the connections of before have been dropped
        return self._executed(values)

    def _executed(self, values: dict[str, list[str]]) -> Row[tuple[object, ...]]:
        with self._engine.connect() as connection:
            return connection.execute(_GLANCE, values).one()
