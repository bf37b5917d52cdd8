"""What a report calls visible is seen at twice that amplitude; a small sample, `make visible` hides 200."""

import re

import numpy as np
import pytest

from models.diagnosis.diagnose import diagnose
from tests.lab.visible.trial import Shown, shown
from tests.models.diagnosis.campaigns import rehearsal


def test_an_offset_that_raises_no_alarm_is_not_called_visible() -> None:
    """A pressure offset of 0.5 bar in the end is absorbed by eq. 6; 0.058 bar was said to show."""
    report = diagnose(
        rehearsal(7, {"pressure_offset": 0.5}, dynamic=False, tests=12, noise=0.01), rng=np.random.default_rng(1)
    )
    offset = next(each for each in report.visible if each.effect == "pressure_offset")
    assert offset.amplitude > 0.5 or report.verdict != "model_adequate"
    assert offset.least < 0.2  # of one that steps less would do
    forms = re.search(r"pressure offset of ([\d.]+) bar.*must be larger, or may not show at all", report.summary)
    assert report.verdict != "model_adequate" or (forms is not None and float(forms[1]) < 0.2)


@pytest.mark.slow
def test_nine_in_ten_of_what_is_visible_raise_an_alarm() -> None:
    """Not all of them can be hidden: an amplitude may be beyond what makes sense on the rig."""
    slugs = ("hydrodynamic_drag", "unsettled_dwell", "inertia_torque", "running_in", "oil_change", "accelerated_wear")
    found = [shown((20262, k), slug) for k in range(5) for slug in slugs]
    found += [shown((20261, 3), slug) for slug in ("oil_temperature", "interface_heating")]
    assert all(isinstance(each, Shown) and each.seen for each in found[-2:])
    seen = [each.seen for each in found if isinstance(each, Shown)]
    assert len(seen) >= 15
    assert np.mean(seen) >= 0.75
