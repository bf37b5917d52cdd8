"""The verdict as it is read off lists of explanations."""

import pytest

from models.diagnosis.explanations.decide import decide
from models.diagnosis.explanations.verdict import UNCATALOGUED, Explanation, Verdict

U = UNCATALOGUED


def listed(shares: dict[tuple[str, ...], float]) -> tuple[Explanation, ...]:
    assert sum(shares.values()) == pytest.approx(1.0)
    return tuple(Explanation(effects=effects, probability=share) for effects, share in shares.items())


@pytest.mark.parametrize(
    ("shares", "verdict", "causes"),
    [
        ({(): 1.0}, Verdict.MODEL_ADEQUATE, ()),
        ({(): 0.51, ("a",): 0.49}, Verdict.MODEL_ADEQUATE, ()),
        ({("a",): 0.95, (): 0.05}, Verdict.CAUSE_NAMED, ("a",)),
        ({("a",): 0.6, ("a", "b"): 0.4}, Verdict.CAUSE_NAMED, ("a",)),
        ({("a", "b"): 0.95, ("a",): 0.05}, Verdict.CAUSE_NAMED, ("a", "b")),
        ({("a",): 0.45, ("a", "b"): 0.3, ("a", "c"): 0.25}, Verdict.CAUSE_AMBIGUOUS, ("a", "b", "c")),
        ({("a",): 0.6, ("b",): 0.35, (): 0.05}, Verdict.CAUSE_AMBIGUOUS, ("a", "b")),
        ({("a",): 0.85, (U,): 0.15}, Verdict.CAUSE_AMBIGUOUS, ("a", U)),
        ({("a",): 0.8, ("a", U): 0.2}, Verdict.CAUSE_AMBIGUOUS, ("a", U)),
        ({(U,): 0.5, ("a",): 0.3, (): 0.2}, Verdict.UNEXPLAINED_STRUCTURE, ()),
        ({("a", U): 0.92, (U,): 0.08}, Verdict.CAUSE_AMBIGUOUS, ("a", U)),
        ({("a", U): 0.8, (U,): 0.2}, Verdict.UNEXPLAINED_STRUCTURE, ()),
        ({(): 0.4, (U,): 0.35, ("a",): 0.25}, Verdict.UNEXPLAINED_STRUCTURE, ()),
        ({(): 0.4, (U,): 0.2, ("a",): 0.4}, Verdict.CAUSE_AMBIGUOUS, ("a", U)),
    ],
)
def test_verdict(shares: dict[tuple[str, ...], float], verdict: Verdict, causes: tuple[str, ...]) -> None:
    found = decide(listed(shares))
    assert found[0] is verdict
    assert set(found[1]) == set(causes)
