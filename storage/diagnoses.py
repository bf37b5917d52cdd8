"""The table of diagnoses: running, finished or failed. Lists begin with the newest; a clutch's verdict is that of the newest
finished diagnosis.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Connection, func, select

from storage.dialects import json_fields, newest_first
from storage.encoding import Json, to_object
from storage.rows import Rows, amend
from storage.runs import ACCEPTED
from storage.tables import adopted_model, diagnosis, run

RUNNING, FINISHED, FAILED = "running", "finished", "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosisRow:
    """A diagnosis of the runs up to `last_run_key` (0: no runs): `report` once it is finished, `problem` if it failed,
    `extension` if there is one.

    `life`: the run_id of the rebuild that began the diagnosed life, "" for the first life.
    """

    clutch_id: str
    diagnosis_id: str
    created_at: str
    revision: int
    last_run_key: int
    life: str
    as_of_cycles: float | None
    code_version: str
    diagnosis_key: int = 0
    status: str = RUNNING
    finished_at: str | None = None
    report: Json | None = None
    extension: Json | None = None
    problem: str | None = None


_rows = Rows(DiagnosisRow, key="diagnosis_key", of=diagnosis)


def insert(connection: Connection, row: DiagnosisRow) -> None:
    """Store a running diagnosis. Raises IntegrityError where its clutch is unknown or its id taken."""
    connection.execute(diagnosis.insert(), _rows.values(row))


def get(connection: Connection, clutch_id: str, diagnosis_id: str) -> DiagnosisRow | None:
    of_id = (diagnosis.c.clutch_id == clutch_id, diagnosis.c.diagnosis_id == diagnosis_id)
    return _rows.first(connection.execute(select(diagnosis).where(*of_id)))


def page(connection: Connection, clutch_id: str, *, limit: int, before: float | None = None) -> list[DiagnosisRow]:
    """At most `limit` diagnoses, newest first; `before` is the key of the previous page's last diagnosis."""
    of_clutch = select(diagnosis).where(diagnosis.c.clutch_id == clutch_id)
    query = newest_first(of_clutch, diagnosis.c.diagnosis_key, before=before, limit=limit)
    return _rows.all(connection.execute(query))


def running(connection: Connection, clutch_id: str, last_run_key: int, *, since: int = 0) -> list[str]:
    """The ids of running diagnoses of the same runs, oldest first; `since` is the revision of the runs' last change."""
    query = select(diagnosis.c.diagnosis_id).where(
        diagnosis.c.clutch_id == clutch_id,
        diagnosis.c.status == RUNNING,
        diagnosis.c.last_run_key == last_run_key,
        diagnosis.c.revision >= since,
    )
    return list(connection.execute(query.order_by(diagnosis.c.diagnosis_key)).scalars())


def finish(connection: Connection, diagnosis_id: str, at: str, report: Json, extension: Json | None) -> bool:
    """Store the report of a running diagnosis; false if it is no longer running."""
    return _end(connection, diagnosis_id, status=FINISHED, finished_at=at, report=report, extension=extension)


def fail(connection: Connection, diagnosis_id: str, at: str, problem: str) -> bool:
    """Store why a running diagnosis failed; false if it is no longer running."""
    return _end(connection, diagnosis_id, status=FAILED, finished_at=at, problem=problem)


def _end(connection: Connection, diagnosis_id: str, **fields: object) -> bool:
    this = (diagnosis.c.diagnosis_id == diagnosis_id, diagnosis.c.status == RUNNING)
    return len(amend(connection, diagnosis, this, **_rows.columns(**fields))) == 1


def last_run_key(connection: Connection, clutch_id: str) -> int:
    """The key of the clutch's most recently stored accepted run, 0 if there is none."""
    accepted = (run.c.clutch_id == clutch_id, run.c.state == ACCEPTED)
    return connection.execute(select(func.max(run.c.run_key)).where(*accepted)).scalar() or 0


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictRow:
    """A finished diagnosis's verdict, causes and advised tests, best first; `adoptable`: it has an extended model;
    `adopted`: the newest adopted model came from it.

    `life`: the run_id of the rebuild that began the diagnosed life, "" for the first life.
    """

    diagnosis_id: str
    life: str
    verdict: str | None
    causes: tuple[str, ...]
    advice: tuple[Json, ...]
    adoptable: bool
    adopted: bool


_later = diagnosis.alias("later")
_newest_verdicts = (
    select(func.max(_later.c.diagnosis_key))
    .where(_later.c.clutch_id == diagnosis.c.clutch_id, _later.c.status == FINISHED)
    .scalar_subquery()
)
_in_force = (
    select(adopted_model.c.diagnosis_id)
    .where(adopted_model.c.clutch_id == diagnosis.c.clutch_id)
    .order_by(adopted_model.c.version.desc())
    .limit(1)
    .scalar_subquery()
)
_short = json_fields(diagnosis.c.report, "verdict", "causes", "advice")
_verdicts = select(
    diagnosis.c.clutch_id,
    diagnosis.c.diagnosis_id,
    diagnosis.c.life,
    _short.label("short"),
    diagnosis.c.extension.is_not(None).label("adoptable"),
    (_in_force == diagnosis.c.diagnosis_id).label("adopted"),
).where(diagnosis.c.diagnosis_key == _newest_verdicts)


def newest(connection: Connection, clutch_ids: Sequence[str]) -> dict[str, VerdictRow]:
    """clutch_id -> its newest finished diagnosis, for clutches that have one."""
    verdicts: dict[str, VerdictRow] = {}
    for row in connection.execute(_verdicts.where(diagnosis.c.clutch_id.in_(clutch_ids))):
        summary = to_object(row.short)
        verdicts[row.clutch_id] = VerdictRow(
            diagnosis_id=row.diagnosis_id,
            life=row.life,
            verdict=summary["verdict"],
            causes=tuple(summary["causes"] or ()),
            advice=tuple(summary["advice"] or ()),
            adoptable=bool(row.adoptable),
            adopted=bool(row.adopted),
        )
    return verdicts
