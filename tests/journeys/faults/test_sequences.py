"""Whole sequences of requests, each made of what earlier ones answered: no answer breaks the description, none is a fault.

CI sends some 50 requests; `make faults` sends 5,000.
"""

from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, settings
from hypothesis.errors import FlakyStrategyDefinition
from hypothesis.stateful import run_state_machine_as_test
from schemathesis import checks
from schemathesis.core.failures import FailureGroup

from tests.service.clients import described
from tests.support import ONCE, serving, stationary

#: What the description cannot say is refused all the same; a clutch that was named by chance may be there; and that what is
#: wrong is refused, test_openapi shows address by address, where a header that is wrong is not replaced.
EXCLUDED = [checks.positive_data_acceptance, checks.negative_data_rejection, checks.ensure_resource_availability]
STEPS = 20
#: Requests that a round of sequences makes at least, on average; where hypothesis gives them up at once, the test ends.
FEWEST = 10


class Told:
    """What a service answered: how often each status, and what was wrong in its answers."""

    def __init__(self) -> None:
        self.statuses: Counter[int] = Counter()
        self.wrong: list[BaseException] = []


def asks_for_a_diagnosis(case: schemathesis.Case) -> bool:
    """Whether a request is one that a bounded queue may refuse."""
    return case.method == "POST" and case.path.endswith("/diagnoses")


def sequences(url: str) -> tuple[type, Told]:
    """The state machine of the description against a service, and what it is told."""
    told = Told()
    machine = schemathesis.openapi.from_dict(described()).as_state_machine()

    class Sequences(machine):  # type: ignore[misc, valid-type]
        def get_call_kwargs(self, _case: schemathesis.Case) -> dict[str, Any]:
            # a diagnosis is asked for and not waited for
            return {"base_url": url, "headers": {"Prefer": "wait=0"}}

        def validate_response(self, response: Any, case: schemathesis.Case, **more: Any) -> None:
            told.statuses[response.status_code] += 1
            if response.status_code == 503 and asks_for_a_diagnosis(case) and "retry-after" in response.headers:
                return  # as many wait as may
            try:
                case.validate_response(response, excluded_checks=EXCLUDED, transport_kwargs=more)
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
        ONCE.post(f"{server.url}/v1/clutches", json={"clutch_id": "after"})
        answer = ONCE.post(f"{server.url}/v1/clutches/after/runs", json=stationary(0))
        assert answer.status_code == 201
