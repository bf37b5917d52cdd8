"""What every request asks of a server: one statement for all who ask, so that no answer is older than its question.

A service asks from its event loop, which does not wait: one statement at a time is under way in a thread, and requests that
come meanwhile share the next.
"""

import asyncio
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from sqlalchemy import text

from storage.engine.errors import StorageUnavailable
from storage.engine.postgresql.single_statements import SingleStatements
from storage.engine.watch import Glance, Question, Watch, granted

_GLANCE = text("""
SELECT (SELECT number FROM commits) AS version,
       EXISTS (SELECT 1 FROM access_key) AS keys_are_needed,
       (SELECT json_object_agg(clutch_id, revision) FROM clutch WHERE clutch_id = ANY(:clutches)) AS revisions,
       (SELECT json_object_agg(secret_sha256, json_build_array(key_id, scope, note, clutches, expires_at))
          FROM access_key WHERE secret_sha256 = ANY(:secrets) AND revoked_at IS NULL) AS keys
""")


class ServerWatch(Watch):
    """The questions, one at a time for all who ask from the event loop."""

    def __init__(self, statements: SingleStatements) -> None:
        self._statements = statements
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="watch")
        self._waiting: list[tuple[Question, asyncio.Future[Glance]]] = []
        self._asking: asyncio.Task[None] | None = None
        self._closed = False

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
        [row] = self._statements.rows(_GLANCE, {"clutches": clutches, "secrets": secrets})
        revisions, keys = row["revisions"] or {}, row["keys"] or {}
        return [
            Glance(
                version=row["version"] or 0,
                keys_are_needed=row["keys_are_needed"],
                key=granted(tuple(keys[question.secret_sha256])) if question.secret_sha256 in keys else None,
                revision=revisions.get(question.clutch_id),
            )
            for question in questions
        ]

    async def look(self, question: Question) -> Glance:
        """What is so now, for one who asks from the event loop."""
        self._refuse_closed()
        answer: asyncio.Future[Glance] = asyncio.get_running_loop().create_future()
        self._waiting.append((question, answer))
        if self._asking is None:
            self._asking = asyncio.create_task(self._ask())
        return await answer

    def close(self) -> None:
        """End the thread; who asks from then on is told that the database was closed. May be called twice."""
        self._closed = True
        self._thread.shutdown()

    async def _ask(self) -> None:
        """Ask for all who wait, until nobody does."""
        try:
            while self._waiting:
                questions, self._waiting = self._waiting, []
                await self._ask_for(questions)
        finally:
            self._asking = None

    async def _ask_for(self, questions: list[tuple[Question, asyncio.Future[Glance]]]) -> None:
        try:
            self._refuse_closed()
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

    def _refuse_closed(self) -> None:
        if self._closed:
            raise StorageUnavailable("the database has been closed")
