"""The clutch that the blind rig ages: eq. 2-3 with laws over pressure, eq. 6 over cycles, in a form of its own.

In bar and m/s:  M_s, V_S, C_v = a + b p,  M̄_c = c + e exp(-p/p0).  Eq. 6 multiplies a whole law in some clutches, and
its two terms by different final shares in others; time scale and order of the decay are one pair a law either way. The
attractor drifts over life. Everything that a baseline may adjust stands in one vector `theta`, the two shares apart even
where they are equal: who looks does not know which kind of clutch it is.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray

LAWS = ("static", "stribeck", "viscous", "ratio")
GAMMA = 0.3


def slots() -> list[tuple[slice, slice, int, int]]:
    """Where in `theta` each of LAWS has its terms (ln p0 among them), its two shares, log time scale, log order."""
    found, at = [], 0
    for name in LAWS:
        terms = 3 if name == "ratio" else 2
        found.append((slice(at, at + terms), slice(at + terms, at + terms + 2), at + terms + 2, at + terms + 3))
        at += terms + 4
    return found


@dataclass(frozen=True)
class Law:
    """The four of eq. 3 somewhere: M_s [Nm], M̄_c [-], V_S [m/s], C_v [Nm (s/m)^0.3], arrays that broadcast."""

    static: FloatArray
    ratio: FloatArray
    stribeck: FloatArray
    viscous: FloatArray
    elsewhere: "Callable[[FloatArray | None, FloatArray | None], Law] | None" = None

    def at(self, bar: FloatArray) -> "Law":
        """The same clutch in the same state under another pressure [bar]."""
        return self.elsewhere(bar, None)

    def later(self, cycles: FloatArray) -> "Law":
        """The same clutch under the same pressure after other cycles."""
        return self.elsewhere(None, cycles)

    def torque(self, v: FloatArray, *, film: FloatArray | None = None, gamma: FloatArray | float = GAMMA) -> FloatArray:
        """Eq. 3 at v >= 0 [m/s]; `film` is the speed to which the present film belongs, v if it is at rest with itself."""
        w = np.maximum(v if film is None else film, 1e-9)
        return self.static * (1 + (self.ratio - 1) * np.exp(-self.stribeck / w)) + self.viscous * v**gamma


@dataclass(frozen=True)
class Clutch:
    """`theta` holds for each law its two terms (and ln p0), two final shares, log time scale, log order; then ln C a
    pressure and what it gains over `span` cycles."""

    theta: FloatArray
    span: float
    pressures: FloatArray  # bar, at which an attractor is defined
    soon: float = 0.0  # the attractor's drift bends after this share of the span, as eq. 6 does; 0: it is straight

    def law(self, bar: FloatArray, cycles: FloatArray) -> Law:
        """The laws at a pressure [bar] after `cycles`."""
        found = {}
        for name, (terms, ends, scale, order) in zip(LAWS, slots(), strict=True):
            first, second, *decay = self.theta[terms]
            shape = np.exp(-bar / np.exp(decay[0])) if decay else bar
            shares = self.theta[ends]
            gone = 1 - (1 + cycles / np.exp(self.theta[scale])) ** -np.exp(self.theta[order])
            found[name] = first * (1 + shares[0] * gone) + second * shape * (1 + shares[1] * gone)

        def elsewhere(other: FloatArray | None, later: FloatArray | None) -> Law:
            return self.law(bar if other is None else other, cycles if later is None else later)

        return Law(**found, elsewhere=elsewhere)

    def attractor(self, bar: FloatArray, cycles: FloatArray) -> FloatArray:
        """C [Nm/s] of the attractor law at a pressure [bar] after `cycles`."""
        fresh = np.interp(bar, self.pressures, self.theta[-self.pressures.size - 1 : -1])
        x = cycles / self.span
        course = x if self.soon == 0.0 else (1 - (1 + x / self.soon) ** -1.2) / (1 - (1 + 1 / self.soon) ** -1.2)
        return np.exp(fresh + self.theta[-1] * course)

    def nudged(self, index: int, by: float) -> "Clutch":
        """One entry of theta moved."""
        theta = self.theta.copy()
        theta[index] += by
        return replace(self, theta=theta)


def draw_clutch(rng: np.random.Generator, pressures: FloatArray, span: float) -> Clutch:
    """A clutch about as in the reference's figures: torque falls over `span` cycles, C_v rises, no two alike."""
    parts = bool(rng.random() < 0.5)
    grip = rng.uniform(0.6, 1.5)

    def course(low: float, high: float) -> list[float]:
        share = rng.uniform(low, high)
        other = share * (rng.uniform(0.75, 1.25) if parts else 1.0)
        return [share, other, np.log(span * rng.uniform(0.12, 0.5)), np.log(rng.uniform(0.5, 1.2))]

    decay = rng.uniform(1.3, 2.4)
    floor = rng.uniform(0.55, 0.72)
    excess = (rng.uniform(0.86, 0.99) - floor) * np.exp(pressures[0] / decay)
    theta = [grip * rng.uniform(0.2, 2.5), grip * rng.uniform(4.2, 5.0), *course(-0.62, -0.35)]
    theta += [rng.uniform(0.1, 0.8), rng.uniform(0.7, 1.1), *course(-0.75, -0.35)]
    theta += [grip * rng.uniform(0.05, 0.4), grip * rng.uniform(0.18, 0.3), *course(0.35, 1.0)]
    theta += [floor, excess, np.log(decay), *course(-0.4, -0.15)]
    attractor = np.log(grip * rng.uniform(80, 300)) + rng.uniform(-0.3, 0.8) * np.log(pressures / 5)
    attractor = attractor + 0.05 * rng.standard_normal(pressures.size)
    drift = rng.uniform(-0.3, 0.3)
    aside = rng.spawn(1)[0]  # what is drawn here changes nothing that is drawn later
    soon = float(aside.choice([0.0, aside.uniform(0.05, 0.5)]))
    return Clutch(np.array([*theta, *attractor, drift]), span, pressures, soon)
