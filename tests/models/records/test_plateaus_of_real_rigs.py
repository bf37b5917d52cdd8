"""Raw records as controllers make them: speeds that overshoot, friction that follows slowly, steps in any order."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from models.arrays import FloatArray
from models.records.plateaus import PlateauCut, cut_plateaus
from models.records.runs import Record
from tests.models.records.raw_records import RPM, make, true_torque

FINE = 1000.0


def overshooting(levels: FloatArray, dwell: float, natural: float, damping: float) -> FloatArray:
    """A speed loop of second order that follows the levels [k], `dwell` s each."""
    told = np.repeat(levels, round(dwell * FINE))
    numerator, denominator, _ = cont2discrete(
        ([natural**2], [1, 2 * damping * natural, natural**2]), 1 / FINE, method="zoh"
    )
    return np.asarray(lfilter(numerator.ravel(), denominator, told - told[0]) + told[0], dtype=np.float64)


def recorded(
    levels: FloatArray, speed: FloatArray, lag: float, noise: float, rate: float, seed: int
) -> tuple[Record, FloatArray]:
    """At 5 bar, torque a lag [s] behind its steady value; the torque [k] that the levels would settle at."""
    pressure = np.full(speed.size, 5e5)
    steady = true_torque(pressure, speed)
    keep = np.exp(-1 / (FINE * lag))
    torque = lfilter([1 - keep], [1, -keep], steady, zi=[keep * steady[0]])[0]
    rng, every = np.random.default_rng(seed), round(FINE / rate)
    time = np.arange(speed.size)[::every] / FINE
    record = Record(
        time=time,
        pressure=pressure[::every] + 500.0 * rng.standard_normal(time.size),
        speed=speed[::every] + RPM * rng.standard_normal(time.size),
        torque=torque[::every] + noise * rng.standard_normal(time.size),
    )
    return record, true_torque(np.full(levels.size, 5e5), levels)


def which(cut: PlateauCut, dwell: float) -> list[int]:
    """The dwell in which each plateau lies."""
    return np.floor(0.5 * (cut.start + cut.stop) / dwell).astype(int).tolist()


@pytest.mark.parametrize("rate", [20.0, 50.0, 100.0])
@pytest.mark.parametrize(("natural", "damping"), [(7.0, 0.6), (4.0, 0.5), (10.0, 0.4)])
def test_the_crest_of_an_overshoot_is_no_plateau(rate: float, natural: float, damping: float) -> None:
    levels = np.concatenate([np.arange(20.0, 1971.0, 140.0), np.arange(1900.0, 19.0, -180.0)]) * RPM
    speed = overshooting(levels, 5.0, natural, damping)
    record, wanted = recorded(levels, speed, 0.2, 0.05, rate, 4)
    cut = cut_plateaus(record)
    assert which(cut, 5.0) == list(range(levels.size))
    assert np.abs(cut.plateaus.torque - wanted).max() < 0.04


@pytest.mark.parametrize("short", [600.0, 800.0, 900.0])
def test_a_short_dwell_that_is_no_crest_stays(short: float) -> None:
    """One second on the way from 200 to 1000 rpm."""
    told = np.concatenate([np.full(5000, 200.0), np.full(1000, short), np.full(5000, 1000.0)]) * RPM
    record, _ = recorded(np.array([200.0]) * RPM, told, 0.02, 0.02, 200.0, 1)
    assert np.round(cut_plateaus(record).plateaus.speed / RPM, -2).tolist() == [200.0, short, 1000.0]


def test_a_dwell_that_lost_samples_is_no_crest() -> None:
    """A second of the dwell, then a gap, then the rest of it."""
    told = np.concatenate([np.full(5000, 200.0), np.full(6000, 1000.0)]) * RPM
    record, _ = recorded(np.array([200.0]) * RPM, told, 0.02, 0.02, 200.0, 1)
    keep = (record.time < 6.0) | (record.time > 6.4)
    cut = cut_plateaus(
        Record(**{name: getattr(record, name)[keep] for name in ("time", "pressure", "speed", "torque")})
    )
    assert "overshoot" not in {code for code, _ in cut.notes}
    assert np.round(cut.plateaus.speed / RPM, -2).tolist() == [200.0, 1000.0, 1000.0]


@pytest.mark.slow
@pytest.mark.parametrize("lag", [0.2, 0.4])
@pytest.mark.parametrize("rate", [50.0, 100.0])
def test_hardly_a_share_of_the_plateau_before_is_left_whatever_the_order(lag: float, rate: float) -> None:
    """Steps of some 6 Nm: the transient itself must not make the means look so unsure that much of it may stay."""
    rng = np.random.default_rng(8)
    left, steps = [], []
    for seed in range(10):
        pressure = rng.permutation(np.repeat([4e5, 5e5, 6e5, 7e5], 12))
        speed = rng.permutation(np.tile(np.linspace(20.0, 1970.0, 12), 4)) * RPM
        made = make(pressure, speed, np.random.default_rng(seed), ramp=0.3, tau=lag, rate=rate)
        cut = cut_plateaus(made.record)
        dwell = np.array(which(cut, 5.0))
        assert dwell.size >= 40  # of 48, some of which are on the level of the one before
        later = dwell > 0
        left += (cut.plateaus.torque - made.torque[dwell])[later].tolist()
        steps += (made.torque[dwell - 1] - made.torque[dwell])[later].tolist()
    assert abs(np.dot(left, steps) / np.dot(steps, steps)) < 0.003
