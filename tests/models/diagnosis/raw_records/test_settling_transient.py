"""Dwells that still settle are distinguished from friction's own lag, from drift and from autocorrelated noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

from models.diagnosis.raw_records.settling_transient import SettlingEvidence, settling_evidence
from models.records.plateaus import cut_plateaus
from models.records.runs import Record

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
