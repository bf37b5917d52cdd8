"""A service in the test's process whose diagnoses the stand-in engine makes, and what is asked of it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from models.diagnosis.extension import Extension
from service.app import create_app
from service.settings import Settings
from tests.service.workflows import stand_in_engine
from tests.support import stationary

BASE = "/v1/clutches/c1"


@contextmanager
def stood_in() -> Iterator[None]:
    """What an adopted extension does is stood in for, here and in the process of a diagnosis."""
    with pytest.MonkeyPatch.context() as patched:
        for name, method in stand_in_engine.METHODS.items():
            patched.setattr(Extension, name, method)
        yield


@contextmanager
def service(folder: Path, engine: str = "diagnose", **settings: Any) -> Iterator[TestClient]:
    """A service in this process, whose diagnoses the stand-in makes."""
    named = Settings(
        workers=0, database=f"sqlite:///{folder / 'a.db'}", engine=f"{stand_in_engine.__name__}:{engine}", **settings
    )
    with TestClient(create_app(named), base_url="http://127.0.0.1", client=("127.0.0.1", 50000)) as client:
        client.post("/v1/clutches", json={"clutch_id": "c1"})
        yield client


def post_tests(client: TestClient, *cycles: float) -> None:
    for each in cycles:
        assert client.post(f"{BASE}/runs", json=stationary(each, run_id=f"r{each:g}")).status_code == 201


def diagnosed(client: TestClient, **body: Any) -> dict[str, Any]:
    answer = client.post(f"{BASE}/diagnoses", json=body, headers={"Prefer": "wait=120"})
    assert answer.status_code == 201, answer.text
    found: dict[str, Any] = answer.json()
    assert found["status"] == "finished", found["problem"]
    return found
