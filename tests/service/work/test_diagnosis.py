"""What a diagnosis' own process makes of a clutch's runs."""

from pathlib import Path

import pytest

from models.diagnosis.extension import Extension
from service.queries.cache import to_json
from service.run_files.json_run import read_run
from service.schemas.clutch import ClutchIn
from service.schemas.diagnosis import IsolabilityOut
from service.work.diagnosis import Task, diagnosed
from service.workflows.edit_clutch import register
from service.workflows.ingest_run import ingest
from storage.engine.opening import open_database
from tests.service.workflows import stand_in_engine
from tests.support import stationary

AT = "2026-11-02T10:00:00+00:00"


def test_the_same_runs_under_another_name_get_the_same_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is drawn was seeded by the clutch's name, and a verdict hung on it."""
    for name, method in stand_in_engine.METHODS.items():
        monkeypatch.setattr(Extension, name, method)
    url = f"sqlite:///{tmp_path / 'a.db'}"
    database = open_database(url)
    for clutch in ("a", "b"):
        register(database, ClutchIn(clutch_id=clutch), created_at=AT)
        for cycles in (0.0, 1000.0, 2000.0):
            body = to_json(stationary(cycles, run_id=f"r{cycles:g}"))
            ingest(database, clutch, read_run(body), received_at=AT)
    database.close()
    found = [
        diagnosed(
            Task(
                database=url,
                clutch_id=clutch,
                last_run_key=10**9,
                engine=f"{stand_in_engine.__name__}:diagnose",
                bytes=0,
                processor_seconds=0,
            )
        )
        for clutch in ("a", "b")
    ]
    assert found[0]["extension"]["content"]["drawn"] == found[1]["extension"]["content"]["drawn"]
    assert found[0]["report"]["summary"] == found[1]["report"]["summary"]
    task = Task(
        database=url,
        clutch_id="a",
        last_run_key=10**9,
        engine=f"{stand_in_engine.__name__}:separating",
        bytes=0,
        processor_seconds=0,
        isolability=True,
    )
    said = IsolabilityOut.model_validate(diagnosed(task)["report"]["isolability"])
    assert (said.unseen, said.pairs[0].key, said.pairs[0].with_test) == (["channel_delay"], "open_sweep", 0.98)
    assert found[0]["report"]["isolability"] is None
