"""The public report: what adoption does to the remaining life, in words."""

from dataclasses import replace
from typing import Any, cast

import pytest

from models.diagnosis.explanations.verdict import Verdict
from service.lives.diagnosis.report import public
from tests.models.diagnosis.report.test_summary import findings


def life(median: float) -> dict[str, Any]:
    return {"remaining_cycles": {"0.5": median}}


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (0.0, 880.0, "If you adopt it, the end is not reached any more: a median of about 880 cycles remains."),
        (880.0, 0.0, "If you adopt it, the end is reached; without it, a median of about 880 cycles remains."),
        (9000.0, 5700.0, "from about 9,000 to about 5,700 cycles."),
    ],
)
def test_an_end_that_adoption_takes_back_is_said_so(before: float, after: float, said: str) -> None:
    """From about 0 to about 880 cycles was all that was said."""
    found = replace(findings(Verdict.CAUSE_NAMED, "pressure_offset"), extension=cast("Any", object()))
    answer = public(found, origin=0.0, before=life(before), after=life(after), notes=())
    assert answer["summary"].endswith(said)
