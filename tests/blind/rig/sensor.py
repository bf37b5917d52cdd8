"""Noise of the blind rig, and the same noise taken out again (whitened) to say what an oracle could see.

σ² = (s M)² + f² a sample, remembering from sample to sample with ρ; every run has a gain of its own (deviation g); the
recorder rounds. A plateau that was averaged on the rig is one sample.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from models.arrays import FloatArray
from tests.blind.rig.plan import Plan, Site


@dataclass(frozen=True)
class Sensor:
    """Shares of torque unless said otherwise; `misjudged` is by what the rig's own torque_sd is wrong, None tells none."""

    noise: float
    floor: float  # Nm
    memory: float
    sample_noise: float
    sample_memory: float
    gain: float
    count: float  # Nm
    misjudged: float | None
    thinned: float = 1.0

    def sigma(self, site: Site, torque: FloatArray) -> FloatArray:
        if site.kind == "stationary":
            return np.hypot(self.noise * torque, self.floor)
        return self.thinned * np.hypot(self.sample_noise * torque, self.floor)

    def averaged(self, count: int) -> "Sensor":
        """White noise as strong as this one's on what is smooth over `count` samples, a sample for their mean."""
        rho = self.sample_memory
        return (
            self
            if count == 1
            else replace(self, sample_memory=0.0, thinned=float(np.sqrt((1 + rho) / (1 - rho) / count)))
        )

    def rho(self, site: Site) -> float:
        return self.memory if site.kind == "stationary" else self.sample_memory


def draw_sensor(rng: np.random.Generator, *, misjudged: float | None = None) -> Sensor:
    """A sensor of about 1 %."""
    factor = float(rng.uniform(0.9, 1.1)) if rng.random() < 0.5 else None
    return Sensor(
        noise=0.01 * rng.uniform(0.7, 1.3),
        floor=rng.uniform(0.01, 0.08),
        memory=float(rng.choice([0.0, 0.0, 0.3, 0.5])),
        sample_noise=0.01 * rng.uniform(0.8, 2.0),
        sample_memory=float(rng.choice([0.0, 0.4, 0.7])),
        gain=rng.uniform(0.0, 0.005),
        count=float(rng.choice([0.001, 0.01])),
        misjudged=misjudged if misjudged is not None else factor,
    )


def measure(rng: np.random.Generator, plan: Plan, sensor: Sensor, truth: list[FloatArray]) -> list[FloatArray]:
    """What the recorder writes [Nm]."""
    told = []
    for site, torque in zip(plan.sites, truth, strict=True):
        rho = sensor.rho(site)
        white = rng.standard_normal(torque.shape)
        white[:, 1:] *= np.sqrt(1 - rho**2)
        noise = sensor.sigma(site, torque) * lfilter([1.0], [1.0, -rho], white, axis=1)
        gain = 1 + sensor.gain * rng.standard_normal(plan.life.cycles.size)[site.state][:, None]
        told.append(np.round((torque * gain + noise) / sensor.count) * sensor.count)
    return told


class Whitening:
    """Takes the noise out of changes of torque, given the readings `base` without them.

    Samples of records below `slowest` rpm count for nothing.
    """

    def __init__(self, plan: Plan, sensor: Sensor, base: list[FloatArray], slowest: float = 0.0) -> None:
        self._sites = []
        for site, torque in zip(plan.sites, base, strict=True):
            sigma, rho = sensor.sigma(site, torque), sensor.rho(site)
            if site.kind != "stationary":
                sigma = np.where(site.rpm < slowest, 1e9, sigma)
            u = uncorrelated(sensor.gain * torque / sigma, rho)
            runs = [(rows, u[rows].ravel()) for k in range(plan.life.cycles.size) if (rows := site.state == k).any()]
            self._sites.append((1 / sigma, rho, [(rows, gain, float(gain @ gain)) for rows, gain in runs]))

    def __call__(self, changes: list[FloatArray]) -> FloatArray:
        """Changes in deviations, uncorrelated: one vector over all sites."""
        out = []
        for change, (weight, rho, runs) in zip(changes, self._sites, strict=True):
            y = uncorrelated(change * weight, rho)
            for rows, gain, square in runs:
                part = y[rows].ravel()
                if square > 1e-12:
                    part = part - (1 - 1 / np.sqrt(1 + square)) / square * (gain @ part) * gain
                out.append(part)
        return np.concatenate(out)


def uncorrelated(x: FloatArray, rho: float) -> FloatArray:
    """Series [series, n] that remember with ρ, freed of their memory."""
    y = x.copy()
    y[:, 1:] = (x[:, 1:] - rho * x[:, :-1]) / np.sqrt(1 - rho**2)
    return y
