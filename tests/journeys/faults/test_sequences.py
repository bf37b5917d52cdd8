"""Whole sequences of requests, each made of what earlier ones answered: no answer breaks the description, none is a fault.

CI sends some 200 requests; `make faults` sends 5,000.
"""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, settings
from hypothesis.stateful import run_state_machine_as_test
from schemathesis import checks

from service.app import create_app
from service.settings import Settings
from tests.support import ONCE, serving, stationary

#: What the description cannot say is refused all the same, and a clutch that was named by chance may be there.
EXCLUDED = [checks.positive_data_acceptance, checks.ensure_resource_availability]
STEPS = 20


def sequences(url: str) -> tuple[type, Counter[str]]:
    """The state machine of the description against a service, and how often it got each status."""
    statuses: Counter[str] = Counter()
    machine = schemathesis.openapi.from_dict(create_app(Settings()).openapi()).as_state_machine()

    class Sequences(machine):  # type: ignore[misc, valid-type]
        def get_call_kwargs(self, _case: schemathesis.Case) -> dict[str, Any]:
            # a diagnosis is asked for and not waited for
            return {"base_url": url, "headers": {"Prefer": "wait=0"}}

        def validate_response(self, response: Any, case: schemathesis.Case, **more: Any) -> None:
            statuses[f"{response.status_code // 100}xx"] += 1
            case.validate_response(response, excluded_checks=EXCLUDED, transport_kwargs=more)

    return Sequences, statuses


@pytest.mark.parametrize(
    "number", [pytest.param(200, id="200 requests"), pytest.param(5000, id="5,000 requests", marks=pytest.mark.slow)]
)
def test_no_sequence_of_requests_breaks_the_description(number: int, tmp_path: Path) -> None:
    with serving(tmp_path / "clutchlife.db", loaded=True) as server:
        machine, statuses = sequences(server.url)
        while statuses.total() < number:
            run_state_machine_as_test(
                machine,
                settings=settings(
                    max_examples=max(2, (number - statuses.total()) // STEPS),
                    stateful_step_count=STEPS,
                    phases=[Phase.generate],
                    deadline=None,
                    database=None,
                    suppress_health_check=list(HealthCheck),
                ),
            )
        assert statuses["2xx"] > number / 20, statuses
        assert statuses["5xx"] == 0, statuses
        ONCE.post(f"{server.url}/v1/clutches", json={"clutch_id": "after"})
        answer = ONCE.post(f"{server.url}/v1/clutches/after/runs", json=stationary(0))
        assert answer.status_code == 201
