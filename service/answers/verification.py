"""What is stored, held against itself: nothing is changed. Findings are sentences, none where all is as it should be.

Rows are held against their checksums; runs, inspections and photographs against the hashes that their senders were given;
fits, receipts and predictions against what is computed again from the runs.
"""

import hashlib
import json
import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import sqlalchemy as sa
from sqlalchemy import Connection

from service import repository
from service.channels import bar
from service.clutch.assumptions import ALL_PRESSURES
from service.clutch.recomputation import Results
from service.clutch.tracking import PREDICTED
from service.errors import InvalidError
from service.repository import content_now, decoded, inspection_hash
from service.settings import CODE_VERSION
from storage import inspections, raw_columns, results, runs
from storage.encoding import to_text
from storage.engine.database import Database
from storage.engine.errors import DamagedData, StorageError
from storage.inspections import InspectionRow, PhotographRow
from storage.raw_columns import Stored
from storage.rows import allow_damage, findings
from storage.runs import RunRow
from storage.tables import CHECKSUM, metadata, run


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """The findings of a check, one sentence each; the numbers of runs, inspections and photographs checked, and of
    clutches whose results were recomputed; and the numbers of results by earlier releases, which are not compared."""

    findings: tuple[str, ...]
    runs: int = 0
    inspections: int = 0
    photographs: int = 0
    recomputed: int = 0
    earlier: Mapping[str, int] = field(default_factory=dict)


def check(database: Database, clutch_id: str, *, recompute: bool) -> Checked:
    """Check all data of a clutch; on request also recompute its results, if their input is undamaged.

    Any error caused by damaged data becomes a finding, so that the next clutch is still checked.
    """
    content = _Sum()
    for part in (check_rows, check_runs, check_inspections):
        content.add(_finished(part, database, clutch_id))
    if recompute and not content.findings:
        content.add(_finished(check_results, database, clutch_id))
        content.recomputed += 1
    return Checked(**vars(content))


class _Sum:
    """The sum of several checks."""

    def __init__(self) -> None:
        self.findings: tuple[str, ...] = ()
        self.runs = self.inspections = self.photographs = self.recomputed = 0
        self.earlier: Counter[str] = Counter()

    def add(self, checked: Checked) -> None:
        self.findings += checked.findings
        self.runs += checked.runs
        self.inspections += checked.inspections
        self.photographs += checked.photographs
        self.earlier.update(checked.earlier)


def _finished(part: Callable[[Database, str], Checked], database: Database, clutch_id: str) -> Checked:
    """The result of one part of the check; an error of the part is a finding."""
    try:
        return part(database, clutch_id)
    except Exception as error:  # noqa: BLE001  (a damaged value may lead to any)
        return Checked(findings=(f"{clutch_id}: cannot be checked: {type(error).__name__}: {error}",))


def check_rows(database: Database, clutch_id: str) -> Checked:
    """Every row of a clutch against its checksum, and its filter states against those of its revision."""
    with database.reading() as connection:
        found = _unreadable(connection, {table: _of_clutch(table, clutch_id) for table in _tables(of_clutches=True)})
        allow_damage(connection, everywhere=True)  # that is found already
        if (finding := repository.states_finding(connection, repository.clutch(connection, clutch_id))) is not None:
            found.append(finding)
    return Checked(findings=tuple(f"{clutch_id}: {finding}" for finding in found))


def check_other_rows(database: Database) -> Checked:
    """Check the rows that belong to no clutch against their checksums: fleet priors, rig profiles, alarm rules and
    receivers."""
    with database.reading() as connection:
        found = _unreadable(connection, {table: sa.true() for table in _tables(of_clutches=False)})
    return Checked(findings=tuple(found))


def _unreadable(connection: Connection, chosen: Mapping[sa.Table, sa.ColumnElement[bool]]) -> list[str]:
    """A sentence for each row of these tables that fails its checksum or cannot be read."""
    found = []
    for table, rows in chosen.items():
        try:
            found += findings(connection, table, rows)
        except (StorageError, sa.exc.DBAPIError) as error:
            found.append(f"a row of {table.name} cannot be read: {error}")
    return found


def _tables(*, of_clutches: bool) -> list[sa.Table]:
    """The tables with checksums; an alarm rule may belong to no clutch."""
    sealed = [table for table in metadata.sorted_tables if CHECKSUM in table.c]
    return [
        t for t in sealed if (t.name != "alarm" and bool({"clutch_id", "run_key"} & set(t.c.keys()))) is of_clutches
    ]


def _of_clutch(table: sa.Table, clutch_id: str) -> sa.ColumnElement[bool]:
    """The condition that rows of a table belong to a clutch."""
    if "clutch_id" in table.c:
        return table.c.clutch_id == clutch_id
    return table.c.run_key.in_(sa.select(run.c.run_key).where(run.c.clutch_id == clutch_id))


def check_runs(database: Database, clutch_id: str) -> Checked:
    """Check every run of a clutch against the hash in its receipt, one run in memory at a time."""
    with database.reading() as connection:
        allow_damage(connection, everywhere=True)  # `check_rows` finds it
        rows = runs.page(connection, clutch_id)
    findings = [finding for row in rows if (finding := _finding(database, row)) is not None]
    return Checked(runs=len(rows), findings=tuple(f"{clutch_id}: {finding}" for finding in findings))


def _finding(database: Database, row: RunRow) -> str | None:
    """The sentence on a run that differs from what was sent or cannot be checked; None if it is intact."""
    try:
        return _of_run(database, row)
    except Exception as error:  # noqa: BLE001  (as in `_finished`: the next run is to be checked too)
        return f"run {row.run_id} cannot be checked: {type(error).__name__}: {error}"


def _of_run(database: Database, row: RunRow) -> str | None:
    """The sentence on a run that differs from what was sent; None if it is intact."""
    try:
        with database.reading() as connection:
            columns = raw_columns.stored_of_run(connection, row.run_key)
            stored_file = raw_columns.file_of(connection, row.run_key)
        sent = decoded(row, columns)
    except DamagedData as error:
        return str(error)
    sha256, file = content_now(row, sent), row.details.get("file")
    if file is not None:
        finding = _file_finding(stored_file, row.run_id, file["sha256"])
        if finding is not None:
            return finding
    if not sha256 == row.content_sha256 == row.receipt["content_sha256"]:
        return (
            f"run {row.run_id} differs from what was sent. sha256 of its content: now {sha256}, "
            f"when stored {row.content_sha256}, in the receipt {row.receipt['content_sha256']}"
        )
    return None


def _file_finding(file: Stored | None, run_id: str, wanted: str) -> str | None:
    """The sentence on a run's file that is missing or differs from what was sent; None if it is intact."""
    try:
        sha256 = "none" if file is None else file.copy_to(None)
    except DamagedData as error:
        return f"run {run_id} is damaged: {error}"
    if sha256 == wanted:
        return None
    return f"the file of run {run_id} differs from what was sent: its sha256 is {sha256}, the stored one is {wanted}"


#: Relative difference of two numbers that are the same result. Chosen: libraries of linear algebra differ by 1e-12 among
#: processors, and a filter of a hundred steps multiplies that.
_SAME = 1e-6
#: Findings that are listed of a clutch. Chosen: the first ones tell, and all runs follow from a wrong one.
_MAX_LISTED = 10

#: Results by what they are of: a run's receipt, its fits, a prediction.
_Results = Mapping[str, tuple[str, Any]]


def check_results(database: Database, clutch_id: str) -> Checked:
    """Recompute all results of a clutch and compare them; results of earlier releases may differ."""
    while True:
        with database.reading() as connection:
            state = repository.state(connection, clutch_id)
            stored = _stored(connection, clutch_id)
        try:
            recomputed = _recomputed(repository.recomputed(repository.recorded(database, state)))
        except (InvalidError, DamagedData) as error:
            return Checked(findings=(f"{clutch_id}: results cannot be computed again: {error}",))
        with database.reading() as connection:
            if repository.unchanged(connection, clutch_id, state.revision):
                return _compared(clutch_id, stored, recomputed)


def _compared(clutch_id: str, stored: _Results, again: Mapping[str, Any]) -> Checked:
    """The differences between stored results and those computed again; results of earlier releases are only counted."""
    earlier = Counter(version for version, _ in stored.values() if version != CODE_VERSION)
    lines = [f"{name} is stored, but the runs do not give it" for name in stored.keys() - again.keys()]
    lines += [f"{name} is missing, although the runs give it" for name in again.keys() - stored.keys()]
    for name in stored.keys() & again.keys():
        version, result = stored[name]
        place = _difference(result, again[name]) if version == CODE_VERSION else None
        if place is not None:
            lines.append(f"{name} differs when it is computed again: {place}")
    lines = sorted(lines) if not earlier else sorted(line for line in lines if "differs" in line)
    more = [f"and {len(lines) - _MAX_LISTED} more"] if len(lines) > _MAX_LISTED else []
    findings = tuple(f"{clutch_id}: {line}" for line in [*lines[:_MAX_LISTED], *more])
    return Checked(findings=findings, earlier=earlier)


def _stored(connection: Connection, clutch_id: str) -> _Results:
    """The stored results of a clutch by name, each with the release that computed it."""
    rows = runs.page(connection, clutch_id)
    fits = results.fits_of(connection, clutch_id)
    named = {f"the receipt of run {row.run_id}": (row.code_version, row.receipt) for row in rows}
    for row in rows:
        stored_fits = fits.get(row.run_key, [])
        named |= {_fit(row.run_id, fit.pressure): (fit.code_version, _plain(asdict(fit))) for fit in stored_fits}
    for method in PREDICTED:
        predictions = results.predictions_of(connection, clutch_id, method, ALL_PRESSURES)
        named |= {_prediction(method, item.cycles): (item.code_version, item.payload) for item in predictions}
    return named


def _recomputed(computed: Results) -> Mapping[str, object]:
    """The results computed again, by the same names as the stored ones."""
    named: dict[str, object] = {
        f"the receipt of run {run_id}": repository.json_of(receipt) for run_id, receipt in computed.receipts.items()
    }
    for run_id, levels in computed.levels.items():
        rows = repository.fit_rows(levels, computed.cofs.get(run_id, {}))
        named |= {_fit(run_id, row.pressure): _plain(asdict(row)) for row in rows}
    if computed.tracking is not None:
        for item in computed.tracking.predictions:
            named[_prediction(item.method, item.cycles)] = repository.json_of(item.prediction)
    return named


def _fit(run_id: str, pressure: float) -> str:
    """How findings name a fit."""
    return f"the fit of run {run_id} at {bar(pressure):g} bar"


def _prediction(method: str, cycles: float) -> str:
    """How findings name a prediction."""
    return f"the prediction by {method} at {cycles:g} cycles"


def _plain(result: Any) -> Any:
    """The value as it reads back from the database."""
    return json.loads(to_text(result))


def _difference(stored: Any, again: Any, place: str = "") -> str | None:
    """The first place where two results differ by more than rounding, with both values; None if they agree."""
    if isinstance(stored, dict) and isinstance(again, dict) and stored.keys() == again.keys():
        pairs = [(stored[name], again[name], f"{place}/{name}") for name in stored]
    elif isinstance(stored, list) and isinstance(again, list) and len(stored) == len(again):
        pairs = [(*both, f"{place}/{index}") for index, both in enumerate(zip(stored, again, strict=True))]
    elif _are_numbers(stored, again) and math.isclose(stored, again, rel_tol=_SAME):
        return None
    else:
        return None if stored == again else f"{place or '/'} is {str(stored)[:80]}, computed again {str(again)[:80]}"
    return next((other for pair in pairs if (other := _difference(*pair)) is not None), None)


def _are_numbers(*values: Any) -> bool:
    return all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)


def check_inspections(database: Database, clutch_id: str) -> Checked:
    """Check every inspection of a clutch and every photograph against its hash, one photograph in memory at a time."""
    with database.reading() as connection:
        allow_damage(connection, everywhere=True)
        rows = inspections.page(connection, clutch_id)
        of_keys = inspections.photographs(connection, [row.inspection_key for row in rows])
    photographs = [(row, photograph) for row in rows for photograph in of_keys[row.inspection_key]]
    findings = [finding for row in rows if (finding := _inspection_finding(row)) is not None]
    findings += [finding for pair in photographs if (finding := _photograph_finding(database, *pair)) is not None]
    return Checked(
        inspections=len(rows),
        photographs=len(photographs),
        findings=tuple(f"{clutch_id}: {finding}" for finding in findings),
    )


def _inspection_finding(row: InspectionRow) -> str | None:
    """The sentence on an inspection that differs from what was sent; None if it is intact."""
    sha256 = inspection_hash(row.content)
    if sha256 == row.content_sha256 and row.cycles == row.content["cycles"]:
        return None
    return (
        f"inspection {row.inspection_id} (stored at {row.cycles:g} cycles) differs from what was sent. "
        f"sha256 of its content: now {sha256}, when stored {row.content_sha256}"
    )


def _photograph_finding(database: Database, row: InspectionRow, photograph: PhotographRow) -> str | None:
    """The sentence on a photograph that differs from what was sent; None if it is intact."""
    with database.reading() as connection:
        data = inspections.data(connection, row.inspection_key, photograph.sha256)
    sha256 = hashlib.sha256(data or b"").hexdigest()
    if sha256 == photograph.sha256:
        return None
    return (
        f"photograph {photograph.sha256} of inspection {row.inspection_id} differs from what was sent: "
        f"the sha256 is now {sha256}"
    )
