"""An alarm that no refitted effect confirms must be loud to count."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.attribution.decide import confirmed
from models.diagnosis.detection.alarm import Alarms
from models.diagnosis.detection.likelihood_ratio import AlarmStatistic


@pytest.mark.parametrize(
    ("name", "beyond", "holds"),
    [("effects", 3.0, False), ("effects", 7.0, True), ("contrasts", 3.0, True), ("contrasts", 1.0, False)],
)
def test_an_alarm_that_nothing_confirms_must_be_loud_that_of_the_effects_more_so(
    name: str, beyond: float, holds: bool
) -> None:
    """Where no effect comes to anything once it is refitted, the shape that raised the alarm was one of many."""
    calm = AlarmStatistic(value=5.0, threshold=10.0, p_value=0.5, index=0)
    alarms = replace(Alarms(effects=calm, contrasts=calm, lines=calm), **{name: replace(calm, value=10.0 + beyond)})
    assert confirmed(alarms, [], -np.inf) is holds
    assert confirmed(alarms, [], 3.5)
