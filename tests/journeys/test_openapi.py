"""The service against its own description: whatever the description allows or forbids, the answers keep to it, address by
address and in whole sequences of requests."""

from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.errors import FlakyStrategyDefinition
from hypothesis.stateful import run_state_machine_as_test
from schemathesis import GenerationMode, checks
from schemathesis.core.failures import FailureGroup
from schemathesis.schemas import APIOperation

from tests.service.clients import described
from tests.support import Server, filled_service, post_tests, serving, stationary

SCHEMA = schemathesis.openapi.from_dict(described())
OPERATIONS = [operation.ok() for operation in SCHEMA.get_all_operations()]
#: What JSON schema cannot say (equal lengths, a curve in the data, a clutch that is there) is refused all the same.
EXCLUDED = [checks.positive_data_acceptance]


@filled_service
def api(server: Server) -> None:
    """A service that knows one clutch with three tests."""
    server.http.post("/v1/clutches", json={"clutch_id": "c1"})
    post_tests(server.http, 0, 1000, 2000)


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


# --- Sequences, each request made of what earlier ones answered. CI sends some 50 requests; `make faults` 5,000.

#: In a sequence a clutch that was named by chance may be there, too; and that what is wrong is refused is shown address by
#: address, where a header that is wrong is not replaced.
OF_SEQUENCES = [*EXCLUDED, checks.negative_data_rejection, checks.ensure_resource_availability]
STEPS = 20
#: Requests that a round of sequences makes at least, on average; where hypothesis gives them up at once, the test ends.
FEWEST = 10


@dataclass(slots=True)
class Told:
    """What a service answered: how often each status, and what was wrong in its answers."""

    statuses: Counter[int] = field(default_factory=Counter)
    wrong: list[BaseException] = field(default_factory=list)


def is_refused_by_a_queue(response: Any, case: schemathesis.Case) -> bool:
    """Whether as many jobs wait as may, and the answer says so: on a busy machine diagnoses and replays that were asked for
    are not done before the next ones are."""
    of_job = case.method == "POST" and (case.path.endswith("/diagnoses") or case.path == "/v1/jobs")
    if not (of_job and response.status_code == 503 and "retry-after" in response.headers):
        return False
    problem = response.json()
    return problem["type"] == "urn:clutchlife:problem:busy" and "already wait" in problem["detail"]


def sequences(url: str) -> tuple[type, Told]:
    """The state machine of the description against a service, and what it is told."""
    told = Told()
    machine = schemathesis.openapi.from_dict(described()).as_state_machine()

    class Sequences(machine):  # type: ignore[misc, valid-type]
        def get_call_kwargs(self, _case: schemathesis.Case) -> dict[str, Any]:
            # a test of an alarm may be answered after 12 s
            return {"base_url": url, "headers": AT_ONCE, "timeout": 15.0}

        def validate_response(self, response: Any, case: schemathesis.Case, **more: Any) -> None:
            told.statuses[response.status_code] += 1
            if is_refused_by_a_queue(response, case):
                return
            try:
                case.validate_response(response, excluded_checks=OF_SEQUENCES, transport_kwargs=more)
            except FailureGroup as failures:
                told.wrong.append(failures)
                raise

    return Sequences, told


@pytest.mark.parametrize(
    "number", [pytest.param(50, id="50 requests"), pytest.param(5000, id="5,000 requests", marks=pytest.mark.slow)]
)
def test_no_sequence_of_requests_breaks_the_description(number: int, tmp_path: Path) -> None:
    with serving(tmp_path / "clutchlife.db", loaded=True) as server:
        machine, told = sequences(server.url)
        bounds = settings(
            max_examples=10,
            stateful_step_count=STEPS,
            phases=[Phase.generate],
            derandomize=number < 1000,
            deadline=None,
            database=None,
            suppress_health_check=list(HealthCheck),
        )
        rounds = 0
        while told.statuses.total() < number:
            rounds += 1
            assert rounds <= number / FEWEST, f"{told.statuses} after {rounds - 1} rounds"
            # the service remembers, so a sequence that is begun again may go on otherwise, which hypothesis does not like
            with suppress(FlakyStrategyDefinition):
                run_state_machine_as_test(machine, settings=bounds)
        assert told.wrong == []
        assert told.statuses[200] + told.statuses[201] > number / 20, told.statuses
        server.http.post("/v1/clutches", json={"clutch_id": "after"})
        answer = server.http.post("/v1/clutches/after/runs", json=stationary(0))
        assert answer.status_code == 201
