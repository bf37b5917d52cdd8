"""Results are recomputed from the raw runs, which are never changed: loaded, computed by a pure function, stored."""

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from service import repository
from service.clutch.criteria import MAX_ATTEMPTS
from service.clutch.recomputation import Results
from service.errors import BusyError, ServiceError
from service.jobs.change import ChangeTask
from service.jobs.executor import Ended, Ending, Executor, WorkerLostError, in_rounds
from service.repository import Recorded
from storage import clutches
from storage.encoding import Json
from storage.engine.database import Database
from storage.engine.errors import DamagedData

_log = logging.getLogger("clutchlife")


def clutch_ids(database: Database) -> list[str]:
    with database.reading() as connection:
        return clutches.all_ids(connection)


def replay(database: Database, clutch_ids: Sequence[str], executor: Executor) -> Iterator[Ended[Results]]:
    """Fit and track all runs of these clutches again; yields each clutch as it ends.

    A clutch that changed during each of MAX_ATTEMPTS attempts ends with BusyError; errors not caused by a clutch's data
    are raised. The revision moves on only if a result changed.
    """

    def load(clutch_id: str) -> Recorded:
        try:
            return loaded(clutch_id, damaged=False)
        except DamagedData as error:
            _log.warning("%s: it is computed again from the runs", error)
            return loaded(clutch_id, damaged=True)

    def loaded(clutch_id: str, *, damaged: bool) -> Recorded:
        with database.reading() as connection:
            state = repository.state(connection, clutch_id, damaged=damaged)
        return repository.recorded(database, state, whole=executor.elsewhere, damaged=damaged)

    def store(recorded: Recorded, computed: Results) -> bool:
        try:
            return repository.replace_results(database, recorded.state, computed)
        except DamagedData:  # it is replaced
            return repository.replace_results(database, recorded.state, computed, damaged=True)

    compute = repository.recomputed
    for ended in in_rounds(executor, clutch_ids, load=load, compute=compute, store=store, rounds=MAX_ATTEMPTS):
        if ended.ending is Ending.LEFT:
            yield replace(ended, error=BusyError(_LEFT))
        elif ended.error is None or isinstance(ended.error, (ServiceError, DamagedData, WorkerLostError)):
            yield ended
        else:
            raise ended.error


def as_job(
    database: Database, task: ChangeTask, *, say: Callable[[Json], None], executor: Executor
) -> tuple[dict[str, int], dict[str, str]]:
    """The job that replays a clutch (None: all clutches) and reports progress.

    Returns the number of replayed clutches, and why others kept their results.
    """
    names = clutch_ids(database) if task.of is None else [task.of]
    left: dict[str, str] = {}
    step = "replays the clutches"
    say({"step": step, "done": 0, "of": len(names)})
    for done, replayed in enumerate(replay(database, names, executor), start=1):
        if replayed.error is not None:
            left[replayed.name] = str(replayed.error)
        say({"step": step, "done": done, "of": len(names)})
    return {"replayed": len(names) - len(left)}, left


_LEFT = f"unchanged: runs arrived during each of {MAX_ATTEMPTS} attempts; replay it when fewer runs arrive"
