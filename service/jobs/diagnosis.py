"""The process in which one diagnosis is made: it reads a clutch's runs, and writes the report to standard output."""

import importlib
import json
import os
import resource
import sys
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.diagnosis.campaign import StationaryRun
from models.diagnosis.extension import Extension
from service import repository
from service.api.life import LifePrediction
from service.clutch.diagnosis.campaign import CampaignRun, DiagnosedLife, records_to_keep, run_of
from service.clutch.diagnosis.report import public
from service.clutch.model_correction import corrected_cofs
from service.clutch.timeline import STATIONARY, Life, lives_of
from service.clutch.tracking import predict_at
from service.jobs import process
from service.settings import DATABASE_VARIABLE
from storage import raw_columns, results, runs
from storage.encoding import Json
from storage.engine.database import Database
from storage.engine.opening import open_database

_METHOD = "particle"
#: One for all: what is drawn must hang on nothing but the runs, not on what their clutch is called.
_SEED = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosisTask:
    """A diagnosis to be made by `engine` (module:function): of a clutch's runs up to `last_run_key`, within limits of
    memory [bytes] and processor time [s].

    `isolability`: whether to say which causes its tests could tell apart."""

    database: str
    clutch_id: str
    last_run_key: int
    engine: str
    bytes: int
    processor_seconds: int
    isolability: bool = False


def main() -> None:
    """Run the DiagnosisTask in the first argument (JSON) on the database named in the environment. The last line
    written is the answer."""
    task = DiagnosisTask(**json.loads(sys.argv[1]), database=os.environ[DATABASE_VARIABLE])
    process.end_with_the_service()
    resource.setrlimit(resource.RLIMIT_AS, (task.bytes, task.bytes))
    # at the first of the two this process ends by SIGXCPU, which says why, at the second by SIGKILL
    resource.setrlimit(resource.RLIMIT_CPU, (task.processor_seconds, task.processor_seconds + 1))
    try:
        ended = diagnosed(task, process.say)
    except MemoryError:
        ended = {"problem": f"the diagnosis needs more than {task.bytes // 2**20} MB of memory"}
    process.answer(ended)


def diagnosed(task: DiagnosisTask, say: Callable[[Json], None] = lambda _: None) -> Mapping[str, Any]:
    """The report as JSON, and the model extension. They depend on the runs alone, not on the clutch's name."""
    module, _, function = task.engine.partition(":")
    diagnose = getattr(importlib.import_module(module), function)
    with closing(open_database(task.database)) as database:
        diagnosed_life = read_life(database, task.clutch_id, last_run_key=task.last_run_key, say=say)
        say({"step": "diagnoses"})
        extra = {"isolability": True} if task.isolability else {}
        report = diagnose(diagnosed_life.campaign, rng=np.random.default_rng(_SEED), **extra)
        say({"step": "predicts"})
        before, after = before_and_after(database, task.clutch_id, diagnosed_life, report.extension)
    origin = 0.0 if diagnosed_life.life is None else diagnosed_life.life.origin
    shown = public(report, origin=origin, before=before, after=after, notes=diagnosed_life.notes)
    return {
        "report": repository.json_of(shown),
        "extension": None if report.extension is None else report.extension.to_dict(),
    }


def read_life(
    database: Database, clutch_id: str, *, last_run_key: int, say: Callable[[Json], None] = lambda _: None
) -> DiagnosedLife:
    """The present life, of the runs up to `last_run_key`. Raises NotFoundError.

    Channels are read run by run in short transactions, because an open one delays commits.
    """
    with database.reading() as connection:
        record = repository.record(repository.clutch(connection, clutch_id))
        rows = {row.run_id: row for row in runs.page(connection, clutch_id) if row.run_key <= last_run_key}
        by_key = raw_columns.samples(connection, clutch_id)
        lives = lives_of([event for event in repository.events(connection, clutch_id) if event.run_id in rows])
    if not lives:
        return DiagnosedLife(record=record)
    life = lives[-1]
    samples = {run_id: by_key[row.run_key] for run_id, row in rows.items() if row.run_key in by_key}
    with_records = records_to_keep([event.run_id for event in life.events], samples)
    reader = repository.run_reader(database, clutch_id)
    campaign: list[CampaignRun] = []
    notes = []
    for number, event in enumerate(life.events):
        say({"step": "reads the runs", "done": number, "of": len(life.events)})
        try:
            # its cycles may have been corrected since it was sent: those of the history hold
            sent = replace(reader.read(event.run_id), cycles=event.cycles)
            keep = event.run_id in with_records
            campaign.append(run_of(sent, origin=life.origin, torque_filter=record.torque_filter, keep_record=keep))
        except ValueError as error:
            notes.append(f"{event.run_id} is left out: {error}")
    left_out = samples.keys() - with_records
    count = sum(event.kind == STATIONARY and event.run_id in left_out for event in life.events)
    if count:
        notes.append(f"The raw records of {count} stationary tests are left out for their size; their plateaus count.")
    return DiagnosedLife(record=record, life=life, runs=tuple(campaign), notes=tuple(notes))


def before_and_after(
    database: Database, clutch_id: str, diagnosed_life: DiagnosedLife, extension: Extension | None
) -> tuple[LifePrediction | None, LifePrediction | None]:
    """The particle filter's prediction for the diagnosed life by the model in force and by the extended one; equal if
    there is no extension."""
    if diagnosed_life.life is None:
        return None, None
    with database.reading() as connection:
        state = repository.state(connection, clutch_id, also=extension)
        by_key = results.cofs_of(connection, clutch_id)
        cofs = {run_id: by_key[key] for run_id, key in runs.keys(connection, clutch_id).items() if key in by_key}
    plain = diagnosed_life.life.with_cofs(cofs)

    def prediction(life: Life, model: Extension | None) -> LifePrediction:
        return predict_at([life], state.assumptions_under(model, life), state.fraction, method=_METHOD)

    before = prediction(plain, None)
    if extension is None:
        return before, before
    runs_before = repository.run_reader(database, clutch_id).campaign_runs(plain.events, origin=plain.origin)
    tests = [run for run in diagnosed_life.runs if isinstance(run, StationaryRun)]
    freed = corrected_cofs(extension, diagnosed_life.record, plain, runs_before, tests)
    return before, prediction(plain.corrected(freed), extension)


if __name__ == "__main__":
    main()
