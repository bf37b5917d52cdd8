"""The heading of a diagnosis: what is certain is said to be, though what is beside it is open."""

from collections.abc import Callable

import pytest

from tests.browser.modules import Module

pytestmark = pytest.mark.browser


@pytest.mark.parametrize(
    ("probability", "heading", "said"),
    [
        (0.95, "Cause certain, others possible", "and oil change accounts for it."),
        (0.6, "Cause ambiguous", "The cause may be oil change or inertia torque"),
    ],
)
def test_the_heading_says_which_cause_is_certain(
    loaded: Callable[[str], Module], probability: float, heading: str, said: str
) -> None:
    report = loaded("diagnosis/report.js")
    candidates = [
        {"effect": "oil_change", "probability": probability},
        {"effect": "inertia_torque", "probability": 0.4},
    ]
    diagnosis = {
        "verdict": "cause_ambiguous",
        "causes": ["oil_change", "inertia_torque"],
        "candidates": candidates,
    }
    assert report("heading", diagnosis) == heading
    assert said in report("sentence", diagnosis)
