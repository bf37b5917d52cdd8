"""What is hidden in a simulated campaign: each effect changes torque by about its size, and a diagnosis names it."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.effects.catalogue import BY_SLUG
from models.rig.campaign import simulate, simulated_clutch
from models.rig.hidden import EFFECTS, clutch_for, effect_of, hidden_in
from models.rig.programme import RigProgramme
from models.rig.sampled import DynamicTest
from models.rig.simulated_runs import RunKind, SimulatedRun
from models.rig.stationary import SHARP
from models.rig.temperatures import with_plate
from tests.models.diagnosis.campaigns import campaign_of, look

LEVELS = (4.0e5, 5.5e5, 7.0e5)
PROGRAMME = RigProgramme(dynamic=DynamicTest(rate=50.0, pressures=LEVELS), pressures=LEVELS)


def runs(sizes: dict[str, float], most_tests: int) -> list[SimulatedRun]:
    clutch = clutch_for(simulated_clutch(7), sizes)
    simulated = simulate(7, clutch=clutch, sensor=SHARP, programme=PROGRAMME, most_tests=most_tests)
    return [hidden_in(run, clutch, sizes) for run in simulated]


@pytest.fixture(scope="module")
def bare() -> list[SimulatedRun]:
    return runs({}, 2)


def change(run: SimulatedRun, plain: SimulatedRun) -> np.ndarray:
    held, before = run.record or run.plateaus, plain.record or plain.plateaus
    return held.torque - before.torque


@pytest.mark.parametrize("slug", [slug for slug in EFFECTS if slug != "squeeze_film"])
def test_an_effect_changes_torque_and_no_more_than_it_says(slug: str, bare: list[SimulatedRun]) -> None:
    clutch = clutch_for(simulated_clutch(7), {slug: 1.0})
    size = effect_of(slug).size
    # late wear shows at the end of a life only
    late = [replace(run, cycles=15_000) for run in bare] if slug == "accelerated_wear" else bare
    largest = {}
    for kind in (RunKind.STATIONARY_STRIBECK, RunKind.DYNAMIC_STRIBECK):
        # the second of each kind: drifts are nothing at 0 cycles
        run = [run for run in late if run.kind is kind][1]
        whole, half = (change(hidden_in(run, clutch, {slug: part * size}), run) for part in (1.0, 0.5))
        largest[kind] = float(np.abs(whole).max())
        assert largest[kind] < 12
        assert np.abs(half).max() <= largest[kind]
    assert largest[RunKind.DYNAMIC_STRIBECK] > 0 or slug == "unsettled_dwell"
    assert (largest[RunKind.STATIONARY_STRIBECK] == 0) == EFFECTS[slug].loops


def test_every_hidden_effect_is_of_the_catalogue_and_a_film_is_in_the_clutch() -> None:
    assert EFFECTS.keys() <= BY_SLUG.keys()
    with pytest.raises(ValueError, match=r"torque_zero_shift \(zero shift in the end: 1.5 Nm\)"):
        effect_of("warm_oil")
    # a squeezed film is in the clutch only where it is hidden
    clutch = simulated_clutch(7)
    assert clutch_for(clutch, {"squeeze_film": 0.2}).lag.film_time == 0.2
    assert clutch_for(clutch, {"running_in": 5.0}).lag.film_time == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("slug", "rise", "named"),
    [("interface_heating", 25.0, True), ("interface_heating", 0.0, False), ("oil_temperature", 0.0, False)],
)
def test_heating_is_named_by_a_warm_plate_only(slug: str, rise: float, named: bool) -> None:
    geometry = simulated_clutch(7).geometry
    given = campaign_of(with_plate(run, geometry, rise) for run in runs({slug: effect_of(slug).size}, 9))
    report = look(replace(given, duty=()), 1)
    assert ("interface_heating" in report.causes) is named, (report.verdict, report.causes, report.summary)
    assert not named or report.causes == (slug,)
