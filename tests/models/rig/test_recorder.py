"""The simulated recorder: noise, counts, losses and spikes."""

import numpy as np
import pytest

from models.rig.recorder import Recorder
from models.rig.stationary import Sensor


def rng(seed: int = 2) -> np.random.Generator:
    return np.random.default_rng(seed)


class TestRecorder:
    def test_noise_is_what_was_asked_for_and_autocorrelated(self) -> None:
        count = 200_000
        still = np.full(count, 20.0)
        recorder = Recorder(torque_noise=0.3, memory=0.02, torque_counts=0.0, speed_noise=0.2, speed_counts=0.0)
        record = recorder.record(np.arange(count) / 1000, still * 1e4, still, still, rng(), Sensor(gain_scatter=0.0))
        noise = record.torque - 20
        # autocorrelation time 20 samples: 200,000 of them know a deviation to 1 % (one sigma)
        assert noise.std() == pytest.approx(0.3, rel=0.05)
        assert np.corrcoef(noise[:-20], noise[20:])[0, 1] == pytest.approx(np.exp(-1), abs=0.05)
        assert record.speed.std() == pytest.approx(0.2, rel=0.01)

    def test_counts_losses_and_spikes(self) -> None:
        count = 60_000
        still = np.full(count, 20.0)
        recorder = Recorder(torque_counts=200.0, lost=0.1, spikes_per_minute=30.0, torque_noise=0.01)
        record = recorder.record(np.arange(count) / 100, still * 1e4, still, still, rng(), Sensor())
        assert np.array_equal(record.torque, np.round(record.torque * 200) / 200)
        assert record.time.size == pytest.approx(0.9 * count, rel=0.01)
        assert (np.diff(record.time) > 0).all()
        assert 200 < (np.abs(record.torque - 20) > 4).sum() < 330  # 300 in ten minutes, a tenth of them lost

    @pytest.mark.parametrize("name", Recorder.__slots__)
    def test_refuses_what_is_no_deviation(self, name: str) -> None:
        with pytest.raises(ValueError, match=f"{name} must be finite and not negative, got -1"):
            Recorder(**{name: -1.0})
