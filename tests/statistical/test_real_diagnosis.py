"""Real sweeps of a contact that is no clutch: the diagnosis says that something is there, and names nothing."""

import pytest

from models.diagnosis.explanations.verdict import Verdict
from tests.real import diagnosis, loaders

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not loaders.FOLDER.is_dir(), reason=f"the measurements are not at {loaders.FOLDER}"),
]


@pytest.mark.parametrize("count", [6, 20, 60])
def test_traction_sweeps_get_no_name(count):
    report = diagnosis.report_of(count)
    print(count, report.verdict, report.causes, report.summary)
    assert report.verdict is Verdict.UNEXPLAINED_STRUCTURE
    assert report.causes == ()
    assert report.extension is None
    # what is off is the curve's shape at the lowest speeds, where torque follows speed, and that the branches differ
    assert report.baseline is not None
    assert {each.axis for each in report.baseline.where[:3]} == {"speed_rpm", "torque_nm", "test_clock_s"}
    assert all(each.p_value < 1e-6 for each in report.baseline.where[:3])
