"""What is left of a change in the readings after everything that the rig's baseline may adjust has been refitted to it.

    λ = min over θ of  ½ ‖W (Δ - (f(θ) - f(θ₀)))‖² + ½ Σ ((θ - θ₀)/s)²   [nats]

f are the noise-free readings, W whitens (gains included), Δ is the change. The refit is not linearised: Gauss-Newton with
Levenberg's damping, the sensitivities taken anew only where the linear prediction does not hold. The prior about the truth
θ₀ is mild (`spreads`); without it a refit would run, where the readings hardly determine it, to laws that no clutch has, a
share of -7 lost with a time scale of ten lives. Its price counts: who looks would have to pay it, too. There may be several
minima: the lowest is taken of those found downhill from a few places.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from tests.lab.blind.rig.clutch import LAWS, Clutch, slots
from tests.lab.blind.rig.plan import Plan, Site
from tests.lab.blind.rig.sensor import Sensor, Whitening
from tests.lab.blind.rig.world import read

#: The least scatter of gains that an oracle has to allow for [-], and the slowest speed of the protocol [rpm].
LEAST_GAIN, SLOWEST = 2e-3, 20.0
#: A linear prediction holds, and a refit has ended, where λ is right to this share; at most so many steps.
HOLDS, STEPS = 0.02, 40
#: Where λ is this share off the linear prediction, minima beside the nearest one are looked for.
NONLINEAR = 0.1
#: How far the logarithms of a time scale (over the span) and of an order may go at all, those of attractors half as far.
FARTHEST = 8.0
#: A curve above this [Nm] at all of these speeds [m/s] is friction.
LEAST_TORQUE, SPEEDS = 0.5, np.geomspace(0.01, 12.5, 12)


def spreads(clutch: Clutch) -> FloatArray:
    """Prior deviations of `clutch.theta`: terms of a law as good as free, shares, time scales and orders mildly held."""
    terms = {"static": (250.0, 50.0), "stribeck": (36.0, 7.0), "viscous": (250.0, 50.0), "ratio": (3.0, 3.0, 0.7)}
    laws = [spread for name in LAWS for spread in (*terms[name], 1.5, 1.5, 1.5, 0.7)]
    return np.array([*laws, *[1.5] * clutch.pressures.size, 0.6])


@dataclass(frozen=True)
class Refitted:
    """Where a refit ended: what is left [nats], the coordinates, the prediction there, sensitivities not far from there."""

    left: float
    at: FloatArray
    prediction: FloatArray
    jacobian: FloatArray


@dataclass(frozen=True)
class Refit:
    """A baseline to refit on one plan. Steps are made in coordinates in which the readings are straighter than in θ: what
    a law has lost at the end of the span instead of the shares of eq. 6.

    `base` are the readings at the truth, `jacobian` what they and the prior's rows do there, whitened, by coordinate.
    """

    plan: Plan
    clutch: Clutch
    base: list[FloatArray]
    whitened: Whitening
    jacobian: FloatArray

    def linear(self, y: FloatArray) -> float:
        """λ of a whitened change if the sensitivities at the truth held wherever the refit goes."""
        return _Bowl(self.jacobian, self._rows(y)).least

    def to(self, y: FloatArray, begin: "Refitted | None" = None, enough: float = 0.0) -> "Refitted":
        """The baseline refitted to a whitened change, from the truth or from where another refit ended.

        It ends early where no more than `enough` is left.
        """
        wanted = self._rows(y)
        truth = Refitted(0.0, coordinates(self.clutch), np.zeros_like(wanted), self.jacobian)
        now, damping, growth = begin or truth, 0.0, 2.0
        bowl = _Bowl(now.jacobian, wanted - now.prediction)
        now = replace(now, left=bowl.cost)
        for _ in range(STEPS):
            if now.left <= enough or (damping > 0 and bowl.least > (1 - HOLDS) * now.left):
                break
            step, expected = bowl.step(damping)
            prediction = self.prediction(now.at + step)
            left = np.inf if prediction is None else 0.5 * float(np.square(wanted - prediction).sum())
            if prediction is None or left >= now.left:
                damping, growth = max(growth * damping, 1e-4), 2 * growth
                continue
            ratio = min((now.left - left) / max(now.left - expected, 1e-300), 1.0)
            now = Refitted(left, now.at + step, prediction, now.jacobian)
            if abs(left - bowl.least) < HOLDS * left:
                break
            damping, growth = damping * max(0.1, 1 - (2 * ratio - 1) ** 3), 2.0
            now = replace(now, jacobian=self._sensitivities(now.at, prediction))
            bowl = _Bowl(now.jacobian, wanted - prediction)
        return now

    def lower(self, y: FloatArray, nearest: "Refitted") -> "Refitted":
        """The lowest of `nearest` and what refits find from the truth and from a clutch whose static friction falls a lot
        sooner; only where the baseline is so nonlinear there that there may be others."""
        if abs(nearest.left / max(self.linear(y), 1e-300) - 1) < NONLINEAR:
            return nearest
        sooner = coordinates(_sooner(self.clutch))
        prediction = self.prediction(sooner)
        ends = [nearest, self.to(y)]
        if prediction is not None:
            ends.append(self.to(y, Refitted(0.0, sooner, prediction, self._sensitivities(sooner, prediction))))
        return min(ends, key=lambda end: end.left)

    def prediction(self, at: FloatArray) -> FloatArray | None:
        """The readings, whitened, and the prior's rows at coordinates, less those at the truth; None at impossible ones."""
        theta = theta_at(at, self.clutch.span)
        if theta is None:
            return None
        clutch = replace(self.clutch, theta=theta)
        if not self._possible(clutch):
            return None
        change = [after - before for after, before in zip(read(self.plan, clutch), self.base, strict=True)]
        return np.concatenate([self.whitened(change), (theta - self.clutch.theta) / spreads(self.clutch)])

    def _possible(self, clutch: Clutch) -> bool:
        """Whether friction is friction everywhere, and attractors are of a size that is still quick to follow."""
        law = clutch.law(self.clutch.pressures[[0, -1], None, None], self.plan.life.cycles[:, None])
        if min(law.static.min(), law.stribeck.min()) <= 0:
            return False
        of_attractor = slice(-self.clutch.pressures.size - 1, None)
        drawn_out = np.abs(clutch.theta - self.clutch.theta)[of_attractor].max()
        return bool(law.torque(SPEEDS).min() > LEAST_TORQUE and drawn_out < FARTHEST / 2)

    def _rows(self, y: FloatArray) -> FloatArray:
        return np.concatenate([y, np.zeros(self.clutch.theta.size)])

    def _sensitivities(self, at: FloatArray, prediction: FloatArray) -> FloatArray:
        """By forward differences; a coordinate that cannot go forward stays where it is."""
        columns = []
        for i, value in enumerate(at):
            h = 1e-4 * max(abs(value), 0.1)
            ahead = self.prediction(_nudged(at, i, h))
            columns.append(np.zeros_like(prediction) if ahead is None else (ahead - prediction) / h)
        return np.stack(columns, axis=1)


class _Bowl:
    """½ ‖r - J x‖² in x: where it is least, and how deep it is there."""

    def __init__(self, jacobian: FloatArray, residual: FloatArray) -> None:
        gram = jacobian.T @ jacobian
        self._scale = 1 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
        values, self._vectors = np.linalg.eigh(gram * self._scale[:, None] * self._scale)
        self._values = np.maximum(values, 1e-12)
        self._slope = self._vectors.T @ (self._scale * (jacobian.T @ residual))
        self.cost = 0.5 * float(residual @ residual)
        self.least = self.cost - 0.5 * float((self._slope**2 / self._values).sum())

    def step(self, damping: float) -> tuple[FloatArray, float]:
        """The damped step, and the depth there."""
        x = self._slope / (self._values + damping)
        depth = self.cost - float(x @ self._slope) + 0.5 * float((self._values * x**2).sum())
        return self._scale * (self._vectors @ x), depth


def refit_of(plan: Plan, clutch: Clutch, sensor: Sensor) -> Refit:
    """A refit on one plan; sensitivities at the truth by central differences."""
    lean = replace(plan, sites=tuple(_lean(site) for site in plan.sites))
    base = read(lean, clutch)
    careful = replace(sensor, gain=max(sensor.gain, LEAST_GAIN))
    refit = Refit(lean, clutch, base, Whitening(lean, careful, base, SLOWEST), np.zeros((0, 0)))
    at, columns = coordinates(clutch), []
    for i, value in enumerate(at):
        h = 1e-4 * max(abs(value), 0.1)
        up, down = refit.prediction(_nudged(at, i, h)), refit.prediction(_nudged(at, i, -h))
        columns.append((up - down) / (2 * h))
    return replace(refit, jacobian=np.stack(columns, axis=1))


def _sooner(clutch: Clutch) -> Clutch:
    _, _, scale, _ = slots()[0]
    return clutch.nudged(scale, -3.0)


def coordinates(clutch: Clutch) -> FloatArray:
    """θ with what is lost by the end of the span instead of shares."""
    at = clutch.theta.copy()
    for _, shares, scale, order in slots():
        at[shares] *= _gone(clutch.span, at[scale], at[order])
    return at


def theta_at(at: FloatArray, span: float) -> FloatArray | None:
    """The inverse of `coordinates`; None where a time scale or an order is out of all bounds."""
    theta = at.copy()
    for _, shares, scale, order in slots():
        if max(abs(theta[scale] - np.log(span)), abs(theta[order])) > FARTHEST:
            return None
        theta[shares] /= _gone(span, theta[scale], theta[order])
    return theta


def _gone(cycles: float, log_scale: float, log_order: float) -> float:
    return float(-np.expm1(-np.exp(log_order) * np.log1p(cycles / np.exp(log_scale))))


def _nudged(at: FloatArray, index: int, by: float) -> FloatArray:
    moved = at.copy()
    moved[index] += by
    return moved


def _lean(site: Site) -> Site:
    """The same with constant columns stored once; what is computed from them is broadcast."""
    bar = site.bar[:, :1] if np.ptp(site.bar, axis=1).max() == 0 else site.bar
    rpm = site.rpm[:1] if np.ptp(site.rpm, axis=0).max() == 0 else site.rpm
    return replace(site, bar=bar, rpm=rpm)
