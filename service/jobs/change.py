"""The process in which a change is made as a job: it works on the database itself, as the change's command does."""

import importlib
import json
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass

from service.jobs import process
from service.jobs.executor import Executor, InProcess
from service.jobs.process import AWAY
from service.settings import DATABASE_VARIABLE
from storage.encoding import Json
from storage.engine.database import Database
from storage.engine.errors import DatabaseBusy, StorageUnavailable
from storage.engine.opening import open_database

#: Of so many clutches that were left it is kept why; of all of them the log says it. Chosen: an answer stays a page.
MAX_REASONS = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeTask:
    """A job that changes results: `function` (module:function) is called for `of`, the job's subject (None: all), with
    `arguments`; the job began at `at` and was asked for `by`."""

    function: str
    of: str | None
    at: str
    by: str
    arguments: Json


def main() -> None:
    """Run the ChangeTask in the first argument (JSON) on the database named in the environment. The last line written
    is the answer.

    If the database goes away meanwhile, the process ends and the service repeats the job later.
    """
    task = ChangeTask(**json.loads(sys.argv[1]))
    process.end_with_the_service()
    try:
        with closing(open_database(os.environ[DATABASE_VARIABLE])) as database:
            process.answer(done(database, task, process.say, InProcess()))
    except (DatabaseBusy, StorageUnavailable) as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(AWAY)


def done(database: Database, task: ChangeTask, say: Callable[[Json], None], executor: Executor) -> Mapping[str, object]:
    """The job's result (counts, and the reason for each skipped clutch), with the latest progress."""
    module, _, name = task.function.partition(":")
    function = getattr(importlib.import_module(module), name)
    steps: list[Json] = []

    def say_and_keep(progress: Json) -> None:
        steps[:] = [progress]
        say(progress)

    counts, left = function(database, task, say=say_and_keep, executor=executor)
    for clutch_id, reason in left.items():
        sys.stderr.write(f"{clutch_id}: left as it was: {reason}\n")
    reasons = [{"clutch_id": clutch_id, "reason": reason} for clutch_id, reason in left.items()]
    return {"result": counts | {"left": len(left), "reasons": reasons[:MAX_REASONS]}, "progress": steps[-1]}


if __name__ == "__main__":
    main()
