"""Real sweeps of a contact that is no clutch: the diagnosis says that something is there, and names nothing."""

import pytest

from models.diagnosis.explanations.verdict import Verdict
from tests.real import diagnosis, loaders

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not loaders.FOLDER.is_dir(), reason=f"the measurements are not at {loaders.FOLDER}"),
]


@pytest.mark.xfail(
    strict=True,
    reason="drag is named, and late wear beside it: both imitate a form that no effect has (real-measurements.md)",
)
@pytest.mark.parametrize("count", [20, 60])
def test_traction_sweeps_get_no_name(count: int) -> None:
    report = diagnosis.report_of(count)
    assert report.verdict is Verdict.UNEXPLAINED_STRUCTURE
    assert report.causes == ()
    assert report.extension is None
