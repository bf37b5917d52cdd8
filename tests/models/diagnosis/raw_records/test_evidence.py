"""Evidence out of raw records: found where it is, named for what it is, and silent where there is only noise."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.campaign import Campaign
from models.diagnosis.raw_records import whitened_torque
from models.diagnosis.raw_records.evidence import raw_evidence
from models.records.plateaus import cut_plateaus
from models.records.runs import Record
from tests.models.diagnosis.raw_campaigns import (
    RPM,
    campaign,
    loops,
    ragged,
    reversing,
    stepped,
    swinging,
    with_bursts,
    with_line,
    with_ripple,
    with_wandering_ripple,
)
from tests.support import one_quick


def found(of: Campaign) -> dict[str, tuple[float, float]]:
    return {each.effect: (each.estimate.value, each.estimate.sd) for each in raw_evidence(of)}


@pytest.mark.parametrize("memory", one_quick([0.8, 0.0, 0.95]))
def test_autocorrelated_noise_is_no_evidence(memory: float) -> None:
    print("seeds 0 to 3")
    rngs = [np.random.default_rng(seed) for seed in range(4)]
    assert [found(campaign([stepped(rng, memory=memory)], [swinging(rng, memory)])) for rng in rngs] == [{}] * 4


def test_ripple_is_found_at_its_order_with_its_amplitude() -> None:
    rng = np.random.default_rng(1)
    evidence = raw_evidence(campaign([with_ripple(stepped(rng), 0.03, 2.0) for _ in range(2)], []))
    assert [each.effect for each in evidence] == ["shaft_ripple"]
    assert "2 times a revolution" in evidence[0].note
    assert evidence[0].estimate.value == pytest.approx(0.03, rel=0.25)


def test_ripple_is_found_in_dynamic_tests_alone() -> None:
    rng = np.random.default_rng(2)
    assert found(campaign([], [with_ripple(swinging(rng), 0.05, 1.0) for _ in range(3)])).keys() == {"shaft_ripple"}


@pytest.mark.parametrize("record", [stepped, swinging])
def test_stick_slip_is_a_line_at_low_speed_only(record: Callable[[np.random.Generator], Record]) -> None:
    rng = np.random.default_rng(3)
    records = [with_line(record(rng), 0.15, 17.0, below=2.0) for _ in range(3)]
    evidence = raw_evidence(campaign(*((records, []) if record is stepped else ([], records))))
    assert [each.effect for each in evidence] == ["stick_slip"]
    assert "17" in evidence[0].note


def test_a_line_at_every_speed_is_neither() -> None:
    rng = np.random.default_rng(4)
    assert found(campaign([with_line(stepped(rng), 0.05, 30.0) for _ in range(2)], [])).keys() == {"fixed_line"}


def test_both_at_once_are_distinguished() -> None:
    rng = np.random.default_rng(5)
    records = [with_line(with_ripple(stepped(rng), 0.05, 2.0), 0.2, 17.0, below=2.0) for _ in range(2)]
    assert found(campaign(records, [])).keys() == {"shaft_ripple", "stick_slip"}


def test_what_no_loop_shows_all_loops_show_together() -> None:
    """Swings of a fifth of the noise's deviation, whose phase no loop knows of another; half of the loops show nothing."""
    rng = np.random.default_rng(8)
    ripple = [with_wandering_ripple(loops(rng), rng, 0.03, 1.0) for _ in range(6)]
    bursts = [with_bursts(loops(rng), rng, 0.08, 12.0, 200 * RPM) for _ in range(6)]
    wrong = [with_wandering_ripple(loops(rng), rng, 0.03, 1.37) for _ in range(6)]
    assert found(campaign([], ripple)).keys() == {"shaft_ripple"}
    assert found(campaign([], ripple[:1])).get("shaft_ripple", (0.0, 0.0))[0] < 0.1
    evidence = raw_evidence(campaign([], bursts))
    assert [each.effect for each in evidence] == ["stick_slip"]
    assert float(evidence[0].note.split(" Hz")[0].split()[-1]) == pytest.approx(12.0, abs=0.3)
    assert found(campaign([], wrong)) == {}


@pytest.mark.parametrize("rate", one_quick([25.0, 100.0, 500.0]))
def test_loops_of_noise_are_no_evidence(rate: float) -> None:
    print("seed 9")
    rng = np.random.default_rng(9)
    for memory, deviation, count, pointed in [
        (0.0, 0.15, 0.01, False),
        (0.95, 0.15, 0.1, False),
        (0.7, 0.02, 0.001, True),
        (0.4, 0.02, 0.5, False),
    ]:
        records = [
            ragged(
                loops(rng, rate=rate, memory=memory, deviation=deviation, count=count, pointed=pointed), rng, 0.02, 0.01
            )
            for _ in range(3)
        ]
        assert found(campaign([], records)) == {}


def test_ripple_stands_lost_samples_and_a_clock_that_jitters() -> None:
    rng = np.random.default_rng(10)
    records = [ragged(with_wandering_ripple(loops(rng), rng, 0.05, 1.0), rng, 0.1, 0.02) for _ in range(6)]
    assert found(campaign([], records)).keys() == {"shaft_ripple"}


@pytest.mark.parametrize(("frequency", "rate"), [(0.05, 50.0), (0.1, 100.0), (0.1, 200.0)])
def test_torque_that_turns_with_the_clutch_is_no_ripple(
    frequency: float, rate: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It jumps at the same angle of the shaft in every swing: taken as they are, records that reverse show a ripple of
    half a newton metre and more."""
    rng = np.random.default_rng(1)
    given = campaign([], [reversing(rng, frequency=frequency, rate=rate) for _ in range(4)])
    assert found(given) == {}
    monkeypatch.setattr(whitened_torque, "REVERSES", 2.0)
    assert "shaft_ripple" in found(given)


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_ripple_is_found_between_slow_reversals(order: float) -> None:
    rng = np.random.default_rng(11)
    records = [reversing(rng, frequency=0.05, deviation=0.2) for _ in range(4)]
    given = campaign([], [with_ripple(record, 0.05, order, 100.0) for record in records])
    (evidence,) = raw_evidence(given)
    assert evidence.effect == "shaft_ripple"
    assert f"{order:g} times a revolution" in evidence.note
    assert evidence.estimate.value == pytest.approx(0.05, rel=0.25)


def test_dwells_that_end_before_torque_settles() -> None:
    slow = found(campaign([stepped(np.random.default_rng(6), settling=2.0)], []))
    assert slow.keys() == {"unsettled_dwell"}
    time_constant, deviation = slow["unsettled_dwell"]
    assert abs(time_constant - 2.0) < 2.0 * deviation < 2.0
    assert found(campaign([stepped(np.random.default_rng(6), settling=0.3)], [])) == {}


def test_dwells_that_look_late_but_settle_from_anywhere_are_no_evidence() -> None:
    """Torque that wanders into each dwell, from above or from below whatever the step: each dwell was given half a nat."""
    rng = np.random.default_rng(12)
    calm = stepped(rng)
    dwells = 40
    time = calm.time % 5.0
    side = 2.0 * rng.choice([-1, 1], dwells) * rng.uniform(0.5, 1.5, dwells)
    wander = np.repeat(side, calm.time.size // dwells) * np.exp(-time / 1.5)
    wandering = replace(calm, torque=calm.torque + wander)
    late = cut_plateaus(wandering)
    assert np.count_nonzero(late.time_constant > 1.0) > 0.5 * dwells
    assert found(campaign([wandering], [])) == {}


def test_records_that_hold_nothing_say_nothing() -> None:
    rng = np.random.default_rng(7)
    short = swinging(rng)
    cut = type(short)(
        time=short.time[:20], pressure=short.pressure[:20], speed=short.speed[:20], torque=short.torque[:20]
    )
    still = type(short)(time=short.time, pressure=short.pressure, speed=0 * short.speed, torque=0 * short.torque)
    assert raw_evidence(campaign([cut, still], [cut, still])) == ()
    assert raw_evidence(Campaign()) == ()


@pytest.mark.parametrize("where", ["evidence.cut_plateaus", "whitened_torque.clean"])
def test_a_fault_of_the_code_is_no_record_that_holds_nothing(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ValueError("shapes (3,) and (4,) do not match")

    monkeypatch.setattr(f"models.diagnosis.raw_records.{where}", broken)
    with pytest.raises(ValueError, match="do not match"):
        raw_evidence(campaign([stepped(np.random.default_rng(0))], [swinging(np.random.default_rng(1), 0.0)]))
