"""The service against its own description: whatever the description allows or forbids, the answers keep to it."""

from collections.abc import Iterator

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from schemathesis import GenerationMode, checks
from schemathesis.schemas import APIOperation

from tests.service.clients import described
from tests.support import ONCE, Server, serving, stationary

SCHEMA = schemathesis.openapi.from_dict(described())
OPERATIONS = [operation.ok() for operation in SCHEMA.get_all_operations()]
#: What JSON schema cannot say (equal lengths, a curve in the data, a clutch that is there) is refused all the same.
EXCLUDED = [checks.positive_data_acceptance]


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service that knows one clutch with three tests."""
    with serving(tmp_path_factory.mktemp("api") / "clutchlife.db", loaded=True) as server:
        ONCE.post(f"{server.url}/v1/clutches", json={"clutch_id": "c1"})
        for cycles in (0, 1000, 2000):
            ONCE.post(f"{server.url}/v1/clutches/c1/runs", json=stationary(cycles, run_id=f"r{cycles}"))
        yield server


#: A diagnosis is asked for and not waited for.
AT_ONCE = {"Prefer": "wait=0"}
#: Where nothing but a path is sent, or a file of any bytes, nothing wrong can be sent.
CASES = [(operation, GenerationMode.POSITIVE) for operation in OPERATIONS] + [
    (operation, GenerationMode.NEGATIVE)
    for operation in OPERATIONS
    if operation.query or any(body.media_type == "application/json" for body in operation.body)
]


@pytest.mark.parametrize(("operation", "mode"), CASES, ids=lambda part: getattr(part, "label", None) or part.value)
def test_every_answer_keeps_to_the_description(api: Server, operation: APIOperation, mode: GenerationMode) -> None:
    """All of schemathesis' checks: documented statuses, types, schemas, wrong data refused, nothing unexpected."""

    @settings(max_examples=3, derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(case=operation.as_strategy(generation_mode=mode))
    def check(case: schemathesis.Case) -> None:
        if "clutch_id" in case.path_parameters and mode is GenerationMode.POSITIVE:
            case.path_parameters["clutch_id"] = "c1"
        headers = AT_ONCE if mode is GenerationMode.POSITIVE or "prefer" not in (case.headers or {}) else {}
        case.call_and_validate(base_url=api.url, excluded_checks=EXCLUDED, headers=headers)

    check()
