"""The scatter from run to run is estimated where there are runs to tell it, and said to be assumed where there are not."""

import pytest

from models.diagnosis.pooled_fit.projection import RunScatter, gram_of, projections_of, run_scatter
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import Study, study


def estimated(given: Study) -> RunScatter:
    problem = given.problem
    return run_scatter(list(projections_of(gram_of(problem, given.baseline.fit), problem.noise)))


@pytest.mark.slow
def test_how_much_runs_scatter_is_estimated_with_its_uncertainty() -> None:
    """Gains that scatter by 0.05, 0.6 and 1.2 %: three estimates, each about its truth. All three were reported as 0.2 %."""
    truths = (0.0005, 0.006, 0.012)
    found = [estimated(study(campaign(2, gain=gain))) for gain in truths]
    for scatter, truth in zip(found, truths, strict=True):
        assert scatter.lower < truth < scatter.upper
        assert not scatter.assumed
    assert found[0].upper < found[1].lower
    assert found[1].median < found[2].median


def test_one_run_shows_no_scatter_and_it_is_said_to_be_assumed() -> None:
    alone = estimated(study(campaign(8, cycles=(0.0,), loops=False)))
    assert alone.assumed
    assert alone.information < 0.01
    assert alone.upper > 8 * alone.lower
