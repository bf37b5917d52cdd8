"""The matched filter: noise comes out even whatever its memory, and a swing as loud as it is."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import i0e

from models.diagnosis.raw_records.settling_transient import SettlingEvidence, settling_evidence
from models.diagnosis.raw_records.swing import amplitude, rice
from models.diagnosis.raw_records.whitened_torque import WhitenedRecord, whitened_record
from models.records.plateaus import cut_plateaus
from models.records.runs import Record
from tests.models.diagnosis.raw_campaigns import loops, reversing, stepped, with_ripple


def demodulated(of: WhitenedRecord, hertz: float) -> tuple[np.ndarray, np.ndarray]:
    """u and N of a line in windows of two seconds, by plain sums."""
    power, weight = [], []
    for first in range(0, of.time.size - 200, 200):
        rows = slice(first, first + 200)
        weight.append(of.weight[rows].sum() * float(of.response(np.array(hertz))))
        power.append(abs(of.matched[rows] @ np.exp(-2j * np.pi * hertz * of.time[rows])) ** 2 / weight[-1])
    return np.array(power), np.array(weight)


@pytest.mark.parametrize("memory", [0.0, 0.7, 0.95])
def test_power_of_noise_is_exponential_of_mean_one(memory: float) -> None:
    rng = np.random.default_rng(11)
    power = []
    for _ in range(6):
        record = whitened_record(loops(rng, memory=memory))
        assert record is not None
        power += [demodulated(record, hertz)[0] for hertz in (8.0, 17.0, 31.0)]
    u = np.concatenate(power)
    assert u.mean() == pytest.approx(1.0, abs=4 / np.sqrt(u.size))
    assert np.mean(u > 2.0) == pytest.approx(np.exp(-2.0), abs=4 * np.sqrt(np.exp(-2.0) / u.size))


def test_a_line_comes_out_with_its_amplitude() -> None:
    rng = np.random.default_rng(12)
    record = loops(rng)
    loud = Record(
        time=record.time,
        pressure=record.pressure,
        speed=record.speed,
        torque=record.torque + 0.1 * np.sin(2 * np.pi * 17.0 * record.time),
    )
    here = whitened_record(loud)
    assert here is not None
    assert amplitude(*demodulated(here, 17.0)) == pytest.approx(0.1, rel=0.1)
    assert amplitude(*demodulated(here, 31.0)) < 0.03


def test_the_table_of_the_bessel_function() -> None:
    power, lam = np.meshgrid(np.geomspace(1e-3, 1e4, 200), np.geomspace(1e-3, 1e4, 200))
    root = 2 * np.sqrt(power * lam)
    np.testing.assert_allclose(rice(power, lam), np.log(i0e(root)) + root - lam, atol=3e-3, rtol=1e-9)


def test_records_that_are_too_slow_or_still_have_none() -> None:
    record = loops(np.random.default_rng(13))
    slow = Record(
        time=record.time[::20], pressure=record.pressure[::20], speed=record.speed[::20], torque=record.torque[::20]
    )
    still = Record(time=record.time, pressure=record.pressure, speed=record.speed, torque=0 * record.torque)
    assert whitened_record(slow) is None
    assert whitened_record(still) is None
    assert whitened_record(with_ripple(record, 0.1, 1.0)) is not None


def test_what_reverses_is_cut_where_it_does_and_settles_before_it_counts() -> None:
    """Three pressures of two swings of 20 s: four ways of 10 s each, all but the first without their first second
    at least."""
    found = whitened_record(reversing(np.random.default_rng(14), frequency=0.05))
    assert found is not None
    pieces = [slice(*ends) for ends in itertools.pairwise(found.starts)]
    assert len(pieces) == 3 * 4
    for number, piece in enumerate(pieces):
        way = found.speed[piece]
        assert np.abs(np.sign(way[1:]) - (-1) ** number).max() == 0.0
        assert 790 < way.size <= (1001 if number % 4 == 0 else 901)


@pytest.mark.parametrize("encoder", [0.0, 1.0, 3.0])
def test_an_encoders_noise_is_no_swing_of_the_speed(encoder: float) -> None:
    """Dwells from 20 rpm on, a line of 9 Hz: it is seen however the encoder scatters [rpm]."""
    rng = np.random.default_rng(3)
    record = stepped(rng)
    record = replace(
        record,
        speed=record.speed + encoder * 2 * np.pi / 60 * rng.standard_normal(record.time.size),
        torque=record.torque + 0.1 * np.sin(2 * np.pi * 9.0 * record.time),
    )
    spans = np.stack([np.arange(0.0, 200.0, 5.0) + 1.0, np.arange(5.0, 205.0, 5.0)], axis=1)
    here = whitened_record(record, spans)
    assert here is not None
    assert amplitude(*demodulated(here, 9.0)) == pytest.approx(0.1, rel=0.15)


# --- Dwells that still settle are distinguished from friction's own lag, from drift and from autocorrelated noise.

SEED = 11
STEP, DWELL, COUNT = 0.02, 5.0, 40


def record(*, share: float = 0.0, late: float = 2.0, lag: float = 0.15, drift: float = 0.0, seed: int = SEED) -> Record:
    """Dwells of a shuffled sweep: torque follows steps within `lag` s, and a `share` of each step within `late` s."""
    rng = np.random.default_rng(seed)
    each = round(DWELL / STEP)
    speed = np.repeat(rng.permutation(np.linspace(10.0, 200.0, COUNT)), each)
    level = 15.0 - 3.0 * (1 - np.exp(-speed / 60.0)) + 0.01 * speed
    time = STEP * np.arange(speed.size)

    def followed(seconds: float) -> np.ndarray:
        keep = np.exp(-STEP / seconds)
        return np.asarray(lfilter([1 - keep], [1, -keep], level, zi=[keep * level[0]])[0])

    torque = (1 - share) * followed(lag) + share * followed(late) + drift * (time % DWELL)
    noise = lfilter([1.0], [1.0, -0.5], rng.standard_normal(speed.size)) * np.sqrt(1 - 0.25)
    return Record(time=time, pressure=np.full(speed.size, 5e5), speed=speed, torque=torque + 0.1 * noise)


def evidence_of(**wanted: float) -> SettlingEvidence:
    made = record(**wanted)
    return settling_evidence([(made, cut_plateaus(made))])


def test_a_transient_is_seen_and_its_time_is_estimated() -> None:
    found = evidence_of(share=0.3)
    assert found.evidence > 15.0
    assert abs(found.time_constant - 2.0) < 2.0 * found.deviation < 3.0


@pytest.mark.parametrize("wanted", [{}, {"lag": 0.08}, {"lag": 0.3}, {"drift": 0.02}], ids=str)
def test_lag_drift_and_noise_are_no_transient(wanted: dict[str, float]) -> None:
    assert max(evidence_of(**wanted, seed=seed).evidence for seed in range(4)) < 3.0


def test_one_dwell_says_nothing() -> None:
    assert settling_evidence([]).evidence == pytest.approx(0.0, abs=1e-9)
