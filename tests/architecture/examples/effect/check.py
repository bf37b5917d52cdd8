"""A campaign whose torque peaks at 6.3 m/s is diagnosed: the new effect is the cause, with its size and its speed."""

import numpy as np

from models.diagnosis.diagnose import diagnose
from tests.models.diagnosis.campaigns import Where, campaign


def peak(at: Where) -> np.ndarray:
    """What is planted: 0.9 Nm at 6.3 m/s."""
    return 0.9 / (1.0 + ((at.velocity - 6.3) / 0.8) ** 2)


report = diagnose(campaign(7, peak), rng=np.random.default_rng(5))
assert report.causes == ("critical_speed",), (report.verdict, report.causes)
assert abs(report.candidates[0].estimate.value - 0.9) < 0.1, report.candidates[0]
