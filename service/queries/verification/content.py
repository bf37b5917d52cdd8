"""Whether runs are as they were sent: each run's content hash, computed anew from what is stored."""

from dataclasses import dataclass

from service.lives.incoming_run import content_hash
from service.stored_runs import incoming
from storage import channels, runs
from storage.channels import Stored
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from storage.runs import RunRow


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedRuns:
    """How many runs were checked, and what was found, a sentence each."""

    runs: int
    findings: tuple[str, ...]


def check_runs(database: Database, clutch_id: str) -> CheckedRuns:
    """Every run of a clutch against the hash that its sender was given; one run in memory at a time."""
    with database.reading() as connection:
        rows = runs.page(connection, clutch_id)
    findings = [finding for row in rows if (finding := _finding(database, row)) is not None]
    return CheckedRuns(runs=len(rows), findings=tuple(f"{clutch_id}: {finding}" for finding in findings))


def _finding(database: Database, row: RunRow) -> str | None:
    try:
        with database.reading() as connection:
            columns = channels.all_stored(connection, row.run_key)
            stored_file = channels.file_of(connection, row.run_key)
        sent = incoming(row, channels.values_of(columns))
    except DamagedData as error:
        return f"run {row.run_id} is damaged: {error}"
    sha256 = content_hash(
        kind=sent.kind,
        cycles=row.cycles if row.sent_cycles is None else row.sent_cycles,
        started_at=sent.started_at,
        origin=sent.origin,
        channels=sent.channels,
        details=sent.details,
    )
    file = row.details.get("file")
    if file is not None:
        finding = _file_finding(stored_file, row.run_id, file["sha256"])
        if finding is not None:
            return finding
        sha256 = row.content_sha256 if sha256 == file.get("content_sha256") else sha256
    if not sha256 == row.content_sha256 == row.receipt["content_sha256"]:
        return (
            f"run {row.run_id} is not what was sent: the sha256 of its content is {sha256}, stored are "
            f"{row.content_sha256} and, in its receipt, {row.receipt['content_sha256']}"
        )
    return None


def _file_finding(file: Stored | None, run_id: str, wanted: str) -> str | None:
    try:
        sha256 = "none" if file is None else file.copy_to(None)
    except DamagedData as error:
        return f"run {run_id} is damaged: {error}"
    if sha256 == wanted:
        return None
    return f"the file of run {run_id} is not what was sent: its sha256 is {sha256}, stored is {wanted}"
