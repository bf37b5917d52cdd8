"""Noise of the blind rig, and the same noise taken out again (whitened) to say what an oracle could see.

σ² = (s M)² + f² a sample, autocorrelated from sample to sample by ρ; every run has a gain of its own (deviation g), on
some rigs every pressure of a run once more (c); the recorder rounds. A plateau that was averaged on the rig is one sample.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from models.arrays import FloatArray
from tests.lab.blind.rig.plan import Plan, Site


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
    curve: float = 0.0  # scatter of the gain from pressure to pressure of a run

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


def draw_sensor(rng: np.random.Generator, percent: float = 1.0) -> Sensor:
    """A sensor of about so much noise; on quieter ones the scatter of gains and the count stay as they are."""
    factor = float(rng.uniform(0.9, 1.1)) if rng.random() < 0.5 else None
    return Sensor(
        noise=0.01 * percent * rng.uniform(0.7, 1.3),
        floor=percent * rng.uniform(0.01, 0.08),
        memory=float(rng.choice([0.0, 0.0, 0.3, 0.5])),
        sample_noise=0.01 * percent * rng.uniform(0.8, 2.0),
        sample_memory=0.9 if rng.spawn(1)[0].random() < 0.2 else float(rng.choice([0.0, 0.4, 0.7])),
        gain=rng.uniform(0.0, 0.005),
        count=float(rng.choice([0.001, 0.01])),
        misjudged=factor,
        curve=float(rng.uniform(0.0, 0.003)) if rng.random() < 0.4 else 0.0,
    )


def curves(plan: Plan, site: Site, shape: tuple[int, ...]) -> np.ndarray:
    """Which pressure of which state each sample of a site [series, samples] is at, as one number."""
    level = np.abs(site.bar[..., None] - plan.pressures).argmin(axis=-1)
    return np.broadcast_to(level + plan.pressures.size * site.state[:, None], shape)


def measure(rng: np.random.Generator, plan: Plan, sensor: Sensor, truth: list[FloatArray]) -> list[FloatArray]:
    """What the recorder writes [Nm]."""
    readings = []
    for site, torque in zip(plan.sites, truth, strict=True):
        rho = sensor.rho(site)
        white = rng.standard_normal(torque.shape)
        white[:, 1:] *= np.sqrt(1 - rho**2)
        noise = sensor.sigma(site, torque) * lfilter([1.0], [1.0, -rho], white, axis=1)
        states = plan.life.cycles.size
        gain = 1 + sensor.gain * rng.standard_normal(states)[site.state][:, None]
        if sensor.curve > 0:
            each = rng.standard_normal(states * plan.pressures.size)
            gain = gain * (1 + sensor.curve * each[curves(plan, site, torque.shape)])
        readings.append(np.round((torque * gain + noise) / sensor.count) * sensor.count)
    return readings


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
            u = uncorrelated(torque / sigma, rho)
            numbers = curves(plan, site, torque.shape)
            here = [rows for k in range(plan.life.cycles.size) if (rows := site.state == k).any()]
            runs = [_Gains(rows, u[rows].ravel(), numbers[rows].ravel(), sensor) for rows in here]
            self._sites.append((1 / sigma, rho, runs))

    def __call__(self, changes: list[FloatArray]) -> FloatArray:
        """Changes in deviations, uncorrelated: one vector over all sites."""
        out = []
        for change, (weight, rho, runs) in zip(changes, self._sites, strict=True):
            y = uncorrelated(change * weight, rho)
            out += [run.without(y[run.rows].ravel()) for run in runs]
        return np.concatenate(out)


class _Gains:
    """The gains of a run's curves and of the run, to be taken out of its samples; `torque` in deviations."""

    def __init__(self, rows: np.ndarray, torque: FloatArray, numbers: np.ndarray, sensor: Sensor) -> None:
        self.rows, self._torque = rows, torque
        _, self._curve = np.unique(numbers, return_inverse=True)
        self._share = _taken(sensor.curve**2 * np.bincount(self._curve, weights=torque**2))
        self._share /= np.maximum(np.bincount(self._curve, weights=torque**2), 1e-300)
        self._run = sensor.gain * self._without_curves(torque)
        square = float(self._run @ self._run)
        self._off = float(_taken(np.array(square))) / square if square > 1e-12 else 0.0

    def without(self, y: FloatArray) -> FloatArray:
        y = self._without_curves(y)
        return y - self._off * (self._run @ y) * self._run

    def _without_curves(self, y: FloatArray) -> FloatArray:
        along = np.bincount(self._curve, weights=self._torque * y)
        return y - self._torque * (self._share * along)[self._curve]


def _taken(square: FloatArray) -> FloatArray:
    return np.asarray(1 - 1 / np.sqrt(1 + square))


def uncorrelated(x: FloatArray, rho: float) -> FloatArray:
    """Autocorrelated series [series, n], whitened by their ρ."""
    y = x.copy()
    y[:, 1:] = (x[:, 1:] - rho * x[:, :-1]) / np.sqrt(1 - rho**2)
    return y
