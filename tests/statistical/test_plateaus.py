"""What the cut of a raw record promises of its means, against what it holds, over protocols drawn at random."""

import numpy as np
import pytest

from models.arrays import FloatArray
from models.friction.identification import fit_curves, mean_torques
from models.records.plateaus import cut_plateaus
from models.records.runs import Plateaus, Record, curves_by_pressure
from tests.models.records.raw_records import GEOMETRY, SPEEDS, Made, Sensors, harmed, make, protocol

pytestmark = pytest.mark.slow

SEED = 20131113
#: 1,000 intervals of 90 % hold the truth in 90 % of cases with a standard deviation of 0.95 %: three of them.
COVERAGE, WITHIN = 0.90, 0.03
#: chi² over 1,000 plateaus has a mean of 1 and a deviation of 0.045: three of them, and 0.1 for what transients leave
#: (each shifts its mean by up to 0.1 deviations) and for the deviations being estimated.
CHI_SQUARED = (0.86, 1.24)
RECORDS = 8


def _misses(record: Record, made: Made) -> FloatArray:
    cut = cut_plateaus(record)
    of = np.searchsorted(made.start, 0.5 * (cut.start + cut.stop)) - 1
    assert np.unique(of).size >= made.start.size - 3
    misses = (cut.plateaus.torque - made.torque[of]) / cut.plateaus.torque_sd
    return misses[cut.settled]


def _assert_calibrated(misses: FloatArray) -> None:
    assert misses.size >= 1000
    chi_squared, coverage = float((misses**2).mean()), float((np.abs(misses) < 1.645).mean())
    print(f"{misses.size} plateaus, chi² {chi_squared:.3f}, coverage {coverage:.3f}")
    assert CHI_SQUARED[0] < chi_squared < CHI_SQUARED[1]
    assert abs(coverage - COVERAGE) < WITHIN


def _coloured(rate: float, memory: float) -> FloatArray:
    rng = np.random.default_rng([SEED, int(rate), int(100 * memory)])
    records = (
        make(*protocol(rng, SPEEDS[::2]), rng, rate=rate, tau=0.1, sensors=Sensors(memory=memory))
        for _ in range(RECORDS)
    )
    return np.concatenate([_misses(made.record, made) for made in records])


@pytest.mark.parametrize(
    ("rate", "memory"),
    [(10.0, 0.0), (10.0, 0.5), (100.0, 0.0), (100.0, 0.9), (1000.0, 0.0), (1000.0, 0.95), (2000.0, 0.9)],
)
def test_deviations_cover_under_white_and_coloured_noise(rate: float, memory: float) -> None:
    _assert_calibrated(_coloured(rate, memory))


@pytest.mark.parametrize(("rate", "memory"), [(10.0, 0.8), (10.0, 0.9), (100.0, 0.97)])
def test_deviations_nearly_cover_under_noise_that_outlasts_the_dwells(rate: float, memory: float) -> None:
    """Noise is autocorrelated over nine, nineteen and 66 samples of 50 and 500: without `slow_correlation` 45 to
    80 % were held.

    All dwells of a record share one estimate of its memory, so that eight records scatter by more than their dwells'
    number says: ten points are allowed.
    """
    misses = _coloured(rate, memory)
    coverage = float((np.abs(misses) < 1.645).mean())
    print(f"{misses.size} plateaus, coverage {coverage:.3f}")
    assert abs(coverage - COVERAGE) < 0.10


@pytest.mark.parametrize("tau", [0.02, 0.1, 0.3, 0.5])
def test_deviations_cover_whatever_the_settling_time(tau: float) -> None:
    rng = np.random.default_rng([SEED, int(1000 * tau)])
    misses, found = [], []
    for _ in range(RECORDS):
        made = make(*protocol(rng, SPEEDS[::2]), rng, tau=tau)
        misses.append(_misses(made.record, made))
        found.append(cut_plateaus(made.record).time_constant)
    _assert_calibrated(np.concatenate(misses))
    if tau >= 0.1:  # faster ones are blurred by the averages of 10 ms and the ramp of 150 ms
        ratio = np.concatenate(found) / tau
        assert abs(float(np.median(ratio)) - 1) < 0.05
        assert (np.abs(ratio - 1) < 0.2).mean() > 0.98, "also after the smallest steps, which hardly tell it alone"


@pytest.mark.parametrize("harm", ["lost", "gap", "jitter", "spikes", "all"])
def test_deviations_cover_in_harmed_records(harm: str) -> None:
    rng = np.random.default_rng([SEED, *harm.encode()])
    misses = []
    for _ in range(RECORDS):
        made = make(*protocol(rng, SPEEDS[::2]), rng, tau=0.2)
        misses.append(_misses(harmed(made.record, harm, rng), made))
    _assert_calibrated(np.concatenate(misses))


def test_negative_controls_fail() -> None:
    """A mean with its transient, and a deviation that takes coloured noise for white, are caught by the same figures."""
    rng = np.random.default_rng(SEED)
    made = make(*protocol(rng), rng, tau=0.3)
    record, naive = made.record, []
    for start, stop, torque in zip(made.start, made.stop, made.torque, strict=True):
        inside = record.torque[(record.time > start + 0.15) & (record.time < stop)]
        naive.append((inside.mean() - torque) / (inside.std() / np.sqrt(inside.size)))
    assert float((np.array(naive) ** 2).mean()) > 2 * CHI_SQUARED[1]
    made = make(*protocol(rng), rng, tau=0.1, sensors=Sensors(memory=0.9))
    cut = cut_plateaus(made.record)
    white = cut.noise / np.sqrt(cut.count)
    assert (np.abs(cut.plateaus.torque - made.torque) < 1.645 * white).mean() < COVERAGE - 10 * WITHIN


def test_the_fits_are_those_of_the_exact_plateaus() -> None:
    """Mean torques of the fitted curves miss those of the exact plateaus' by their stated deviations: 70 of them."""
    rng = np.random.default_rng(SEED)
    velocities = GEOMETRY.sliding_velocity(SPEEDS)
    misses = []
    for _ in range(10):
        made = make(*protocol(rng), rng, tau=float(np.exp(rng.uniform(np.log(0.02), np.log(0.5)))))
        record = harmed(made.record, "all", rng)
        exact = Plateaus(pressure=made.pressure, speed=made.speed, torque=made.torque)
        truth = mean_torques(fit_curves(curves_by_pressure(exact, GEOMETRY)), velocities)
        estimate = mean_torques(fit_curves(curves_by_pressure(cut_plateaus(record).plateaus, GEOMETRY)), velocities)
        misses.append((estimate[:, 0] - truth[:, 0]) / estimate[:, 1])
    root_mean_square = float(np.sqrt((np.concatenate(misses) ** 2).mean()))
    print(f"root mean square of the misses {root_mean_square:.3f}")
    assert 0.7 < root_mean_square < 1.3, "1 ± 0.085, three of them, and a margin for transients"
