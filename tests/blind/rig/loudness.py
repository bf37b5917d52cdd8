"""How loud an effect is: λ = ½ ‖(I - P) Δ/σ‖² [nats], what an oracle sees of it after the baseline has been refitted.

P projects on the sensitivities of the rig's own baseline, by central differences; Δ is the exact change of the readings.
Who looks does not know how much the gains scatter: they are reckoned to scatter by 0.2 % at least. Samples slower than the
slowest plateau say nothing of sliding friction and are not counted, except of what swings from sample to sample.

Of such a swing nobody knows the phase, and it does not keep it for longer than a dwell: with λ_k of a stretch of 5 s whose
phase were known, λ = Σ_k E ln I₀(√(2 λ_k) R) - λ_k, R² noncentral χ² of two degrees about 2 λ_k. Many weak ones are worth
little.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr
from scipy.special import i0e
from scipy.stats import ncx2

from models.arrays import FloatArray
from tests.blind.rig.clutch import Clutch
from tests.blind.rig.plan import DWELL, Plan, Site
from tests.blind.rig.sensor import Sensor, uncorrelated, whiten
from tests.blind.rig.world import Effect, read


class UnreachableError(ValueError):
    """No sensible amplitude is as loud as that in this campaign."""


#: Records are averaged over so many samples where only what is smooth matters.
THIN = 5
#: The least scatter of gains that an oracle has to allow for [-], and the slowest speed of the protocol [rpm].
LEAST_GAIN, SLOWEST = 2e-3, 20.0


def _phaseless() -> tuple[FloatArray, FloatArray]:
    """λ of a swing of unknown phase over λ of a known one."""
    known = np.concatenate([[0.0], np.geomspace(1e-3, 1e5, 60)])
    shares = (np.arange(400) + 0.5) / 400
    found = [0.0]
    for one in known[1:]:
        x = np.sqrt(2 * one * ncx2.ppf(shares, 2, 2 * one))
        found.append(max(float(np.mean(np.log(i0e(x)) + x) - one), 0.0))
    return known, np.array(found)


_PHASELESS = _phaseless()


@dataclass(frozen=True)
class Ear:
    """What is heard on one plan with one clutch and one sensor. Sensitivities are taken on the `thin` plan."""

    plan: Plan
    clutch: Clutch
    sensor: Sensor
    count: int
    thin: Plan
    base: list[FloatArray]
    thin_base: list[FloatArray]
    basis: FloatArray

    def loudness(self, effect: Effect, amplitude: float) -> float:
        """λ of an effect at an amplitude; of a fast one at the records' own rate, where no baseline takes it up."""
        changed = read(self.plan, self.clutch, [(effect, amplitude)])
        delta = [after - before for after, before in zip(changed, self.base, strict=True)]
        if not all(np.isfinite(part).all() for part in delta):
            return np.inf
        if effect.fast:
            return self._swing(delta)
        smooth = [
            _averaged(part, full, few) for part, full, few in zip(delta, self.plan.sites, self.thin.sites, strict=True)
        ]
        y = _heard(self.thin, self.sensor, self.count, self.thin_base, smooth)
        return 0.5 * (float(y @ y) - float(np.square(self.basis.T @ y).sum()))

    def _swing(self, delta: list[FloatArray]) -> float:
        known = []
        for site, torque, change in zip(self.plan.sites, self.base, delta, strict=True):
            squares = np.square(uncorrelated(change / self.sensor.sigma(site, torque), self.sensor.rho(site)))
            starts = np.arange(0, squares.shape[1], max(1, round(DWELL / site.step)))
            known.append(0.5 * np.add.reduceat(squares, starts, axis=1).ravel())
        return float(np.interp(np.concatenate(known), *_PHASELESS).sum())

    def amplitude_for(self, effect: Effect, lam: float) -> float:
        """The amplitude at which the effect is as loud as `lam`; raises UnreachableError beyond the effect's `most`."""
        amplitude, low, high = effect.unit, 0.0, np.inf
        for _ in range(40):
            found = self.loudness(effect, amplitude)
            if abs(found / lam - 1) < 0.02:
                return amplitude
            low, high = (amplitude, high) if found < lam else (low, amplitude)
            guess = amplitude * np.sqrt(lam / max(found, 1e-9)) if np.isfinite(found) else amplitude / 4
            guess = min(guess, effect.most)
            amplitude = guess if low < guess < high else (2 * low if np.isinf(high) else 0.5 * (low + high))
            if low >= 0.999 * effect.most:
                break
        raise UnreachableError(f"{effect.slug}: no amplitude up to {effect.most} has λ = {lam}")


def _averaged(change: FloatArray, full: Site, few: Site) -> FloatArray:
    if full is few:
        return change
    length = few.bar.shape[1]
    return change[:, : change.shape[1] // length * length].reshape(change.shape[0], length, -1).mean(axis=2)


def _heard(plan: Plan, sensor: Sensor, count: int, base: list[FloatArray], change: list[FloatArray]) -> FloatArray:
    few = replace(sensor.averaged(count), gain=max(sensor.gain, LEAST_GAIN))
    return whiten(plan, few, base, change, slowest=SLOWEST)


def listen(plan: Plan, clutch: Clutch, sensor: Sensor, count: int = THIN) -> Ear:
    """The readings without anything hidden and the orthonormal basis of what a refit of the baseline takes up."""
    thin = replace(plan, sites=tuple(site.thin(count) for site in plan.sites))
    base = read(thin, clutch)
    columns = []
    for i, value in enumerate(clutch.theta):
        h = 1e-4 * max(abs(value), 0.1)
        up, down = read(thin, clutch.nudged(i, h)), read(thin, clutch.nudged(i, -h))
        change = [(a - b) / (2 * h) for a, b in zip(up, down, strict=True)]
        column = _heard(thin, sensor, count, base, change)
        norm = np.linalg.norm(column)
        if norm > 0:
            columns.append(column / norm)
    basis, triangle, _ = qr(np.stack(columns, axis=1), mode="economic", pivoting=True)
    kept = np.abs(np.diag(triangle)) > 1e-7
    return Ear(plan, clutch, sensor, count, thin, read(plan, clutch), base, basis[:, kept])
