"""What a diagnosis' own process makes of a clutch's runs."""

from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

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
    stand_in_engine.apply(monkeypatch.setattr)
    url = f"sqlite:///{tmp_path / 'a.db'}"
    with closing(open_database(url)) as database:
        for clutch in ("a", "b"):
            register(database, ClutchIn(clutch_id=clutch), created_at=AT)
            for cycles in (0.0, 1000.0, 2000.0):
                body = to_json(stationary(cycles, run_id=f"r{cycles:g}"))
                ingest(database, clutch, read_run(body), received_at=AT)

    def made(clutch: str, engine: str = "diagnose", *, isolability: bool = False) -> Any:
        named = {"database": url, "clutch_id": clutch, "engine": f"{stand_in_engine.__name__}:{engine}"}
        return diagnosed(Task(**named, last_run_key=10**9, bytes=0, processor_seconds=0, isolability=isolability))

    found = [made(clutch) for clutch in ("a", "b")]
    assert found[0]["extension"]["content"]["drawn"] == found[1]["extension"]["content"]["drawn"]
    assert found[0]["report"]["summary"] == found[1]["report"]["summary"]
    said = IsolabilityOut.model_validate(made("a", "separating", isolability=True)["report"]["isolability"])
    assert (said.unseen, said.pairs[0].key, said.pairs[0].with_test) == (["channel_delay"], "open_sweep", 0.98)
    assert found[0]["report"]["isolability"] is None
