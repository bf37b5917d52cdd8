"""How loud an effect is: λ [nats], what an oracle sees of it after the baseline has been refitted to what it changes.

The refit is in `refit`; of what is fast no baseline takes anything up. Who looks does not know how much the gains scatter:
they are taken to scatter by 0.2 % at least. Samples slower than the slowest plateau show nothing of sliding friction and
are not counted, except of what swings from sample to sample.

The phase of such a swing is unknown, and it is not kept for longer than a dwell: with λ_k of a stretch of 5 s whose
phase were known, λ = Σ_k E ln I₀(√(2 λ_k) R) - λ_k, R² noncentral χ² of two degrees about 2 λ_k. Many weak ones are worth
little.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import i0e
from scipy.stats import ncx2

from models.arrays import FloatArray
from tests.lab.blind.rig.clutch import Clutch
from tests.lab.blind.rig.plan import DWELL, Plan, Site
from tests.lab.blind.rig.refit import Refit, Refitted, refit_of
from tests.lab.blind.rig.sensor import Sensor, uncorrelated
from tests.lab.blind.rig.world import Effect, read


class UnreachableError(ValueError):
    """No sensible amplitude is as loud as that in this campaign."""


#: Records are averaged over so many samples where only what is smooth matters.
THIN = 5
#: An amplitude is found where λ is right to this share.
NEAR = 0.03
#: So often a search begins anew where another refit leaves less than the one that was followed.
ROUNDS = 2
#: From this share of the most on it is tried first whether even the most is loud enough.
FAR = 0.4
#: Shares of its amplitude in which an effect grows where its loudness is asked for.
GROWING = (0.25, 0.5, 1.0)


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
    """What is heard on one plan with one clutch and one sensor. The baseline is refitted on the thin plan."""

    plan: Plan
    clutch: Clutch
    sensor: Sensor
    base: list[FloatArray]
    thin: Plan
    refit: Refit

    def loudness(self, effect: Effect, amplitude: float) -> float:
        """λ of an effect at an amplitude; of a fast one at the records' own rate, where no baseline takes it up."""
        if effect.fast:
            return self._swing(effect, amplitude)
        found = self.refitted(effect, amplitude)
        return np.inf if found is None else found.left

    def refitted(self, effect: Effect, amplitude: float) -> Refitted | None:
        """The baseline refitted to an effect that is not fast; None where that is no number.

        It follows the effect as it grows: from the truth at once to a large one it may end in a worse minimum.
        """
        last: Refitted | None = None
        for share in GROWING:
            y = self.changed(effect, share * amplitude)
            if y is None:
                return None
            last = self.refit.to(y, last)
        return self.refit.lower(y, last)

    def linear(self, effect: Effect, amplitude: float) -> float:
        """λ of one that is not fast if the baseline were linear in what it adjusts."""
        y = self.changed(effect, amplitude)
        return np.inf if y is None else self.refit.linear(y)

    def amplitude_for(self, effect: Effect, lam: float) -> float:
        """The amplitude at which the effect is as loud as `lam`; raises UnreachableError beyond the effect's `most`."""
        try:
            if effect.fast:
                return _found(lambda amplitude: self._swing(effect, amplitude), lam, effect.unit, effect.most)
            return self._sought(effect, lam)
        except UnreachableError as error:
            raise UnreachableError(f"{effect.slug}: no amplitude up to {effect.most} has λ = {lam}") from error

    def _sought(self, effect: Effect, lam: float) -> float:
        try:
            begin = _found(lambda amplitude: self.linear(effect, amplitude), lam, effect.unit, effect.most)
        except UnreachableError:
            begin = effect.most
        if begin > FAR * effect.most:
            y = self.changed(effect, effect.most)
            if y is not None and self.refit.to(y, enough=lam).left <= lam:
                raise UnreachableError  # at once: a search would end there
        last: Refitted | None = None

        def heard(amplitude: float) -> float:
            nonlocal last
            y = self.changed(effect, amplitude)
            if y is None:
                return np.inf
            last = self.refit.to(y, last)
            return last.left

        for _ in range(ROUNDS):
            amplitude = _found(heard, lam, begin, effect.most)
            y = self.changed(effect, amplitude)
            if y is None or last is None:
                break
            last = self.refit.lower(y, last)
            if last.left > lam * (1 - 2 * NEAR):
                break
            begin = min(amplitude * float(np.sqrt(lam / last.left)), effect.most)
        return amplitude

    def changed(self, effect: Effect, amplitude: float) -> FloatArray | None:
        """What the effect changes in the thin plan's readings, whitened; None where that is no number."""
        sites = zip(self._delta(effect, amplitude), self.plan.sites, self.thin.sites, strict=True)
        thinned = [_averaged(part, full, few) for part, full, few in sites]
        return self.refit.whitened(thinned) if all(np.isfinite(part).all() for part in thinned) else None

    def _delta(self, effect: Effect, amplitude: float) -> list[FloatArray]:
        changed = read(self.plan, self.clutch, [(effect, amplitude)])
        return [after - before for after, before in zip(changed, self.base, strict=True)]

    def _swing(self, effect: Effect, amplitude: float) -> float:
        known = []
        for site, torque, change in zip(self.plan.sites, self.base, self._delta(effect, amplitude), strict=True):
            squares = np.square(uncorrelated(change / self.sensor.sigma(site, torque), self.sensor.rho(site)))
            starts = np.arange(0, squares.shape[1], max(1, round(DWELL / site.step)))
            known.append(0.5 * np.add.reduceat(squares, starts, axis=1).ravel())
        return float(np.interp(np.concatenate(known), *_PHASELESS).sum())


def _found(heard: Callable[[float], float], lam: float, begin: float, most: float) -> float:
    """Where `heard` is `lam`: the power law through the last two places, else halves of what is between."""
    low, high, amplitude, last, power = 0.0, np.inf, begin, (0.0, 0.0), 2.0
    for _ in range(40):
        found = heard(amplitude)
        if abs(found / lam - 1) < NEAR:
            return amplitude
        if found < lam and amplitude >= most:
            break
        low, high = (amplitude, high) if found < lam else (low, amplitude)
        if 0 < last[1] < np.inf and 0 < found < np.inf and last[0] != amplitude:
            power = float(np.clip(np.log(found / last[1]) / np.log(amplitude / last[0]), 1.0, 6.0))
        last = (amplitude, found)
        guess = amplitude * (lam / max(found, 1e-9)) ** (1 / power) if np.isfinite(found) else amplitude / 4
        guess = min(guess, most)
        amplitude = guess if low < guess < high else (min(2 * low, most) if np.isinf(high) else 0.5 * (low + high))
    raise UnreachableError


def _averaged(change: FloatArray, full: Site, few: Site) -> FloatArray:
    if full is few:
        return change
    length = few.bar.shape[1]
    return change[:, : change.shape[1] // length * length].reshape(change.shape[0], length, -1).mean(axis=2)


def listen(plan: Plan, clutch: Clutch, sensor: Sensor, count: int = THIN) -> Ear:
    """The readings without anything hidden, and the baseline as it can be refitted."""
    thin = replace(plan, sites=tuple(site.thin(count) for site in plan.sites))
    return Ear(plan, clutch, sensor, read(plan, clutch), thin, refit_of(thin, clutch, sensor.averaged(count)))
