"""What an effect of the catalogue is: one value that says what it is, what it needs and what it changes in torque.

An effect changes the torque at every point of a scene (`baseline.laws.Scene`: the points and what the baseline
says there) by an amount that is scaled by one *amplitude*, in engineering units, and formed by *shapes* (a change point, a
time constant, an exponent). Amplitude 0 is no effect. Adding an effect is adding one value and its name in `catalogue.py`;
what other chapters need to know of it are fields of the effect, so its slug stands nowhere else.

Of amplitudes most are small and a few large,

    p(a) ∝ (1 + a²/(ν s²))^{-(ν + 1)/2}

with s the effect's prior deviation and ν its tails (Student's t; normal where ν is infinite). A normal prior would cost an
effect of six deviations 18 nats, and an effect that imitates it with a small amplitude would be named instead.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeAlias

import numpy as np
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.design import IntArray, Points
from models.diagnosis.design.facts import Facts
from models.diagnosis.design.loop_bins import PHASES
from models.relaxation import recursion

#: Powers of life in which an offset, a zero or a gain that creeps is tried first [-].
CREEPS = (0.5, 1.0, 2.0)
#: The onset of what is at work in every test [cycles].
FROM_THE_START = -1.0
#: Values of an effect's shape parameters, in the order of `Effect.shapes`.
Shape: TypeAlias = tuple[float, ...]


class EffectKind(StrEnum):
    """ARTEFACT: in the measurement or the test's conditions; COURSE: in the clutch's life; LAG: in loops only;
    VIBRATION: seen in raw records."""

    ARTEFACT = "artefact"
    COURSE = "course"
    LAG = "lag"
    VIBRATION = "vibration"


class Measure(StrEnum):
    """The quantity to which an effect's usual size is proportional: a clutch of ten times the torque has a sensor of
    ten times the zero shift."""

    TORQUE = "torque"
    PRESSURE = "pressure"


class Discrepancy(StrEnum):
    """An axis along which a template's form is uncertain (`effects.fitted_effect`); MOTION: loops against plateaus. How
    an effect depends on pressure is the mark that distinguishes it from others, so no effect's own discrepancy is over
    PRESSURE; the small one of every template is."""

    SPEED = "speed"
    PRESSURE = "pressure"
    LIFE = "life"
    CLOCK = "clock"
    MOTION = "motion"


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapeParameter:
    """A shape parameter of an effect: name, unit, bounds, and how a fit treats it."""

    name: str
    unit: str
    lowest: float = -math.inf
    highest: float = math.inf
    smooth: bool = False  # the change may be differentiated in it: it is refined between grid values, within its bounds
    held: bool = False  # a smooth one that stays at the values of `Effect.courses` while a size is averaged over them
    lags_from: float = math.inf  # friction in loops lags behind the change where the value is this or more


@dataclass(frozen=True, slots=True, kw_only=True)
class Felt:
    """A conversion of a unitless amplitude to a consequence on the rig, which the report's sentence states."""

    unit: str
    of: Callable[[float], float]  # of the amplitude in the effect's unit; monotonic


def of_twice(exponent: float) -> float:
    """Factor 2^x by which a power law with exponent x responds to a doubling; x is limited to ±100."""
    return math.exp2(max(min(exponent, 100.0), -100.0))


def within(most: float | None) -> tuple[float, float]:
    """Bounds ±`most`; infinite where the campaign does not determine them (None)."""
    return (-math.inf, math.inf) if most is None else (-most, most)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """One point of a shape grid and the log of its prior weight (weights need not sum to one)."""

    shape: Shape
    log_weight: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """An effect of the catalogue, or a rig fault."""

    slug: str  # public, as the title is
    title: str
    physics: str = ""  # a sentence; none for what is never named, as the next two
    formula: str = ""  # the change of torque
    source: str = ""
    kind: EffectKind
    channels: tuple[str, ...] = ()  # what must have been measured or sent for it to be judged (public names)
    amplitude: str  # its name
    unit: str
    # its prior deviation in SI units (zero mean), for a clutch of the reference's size where it `grows_with` something
    prior_sd: float
    # between which it lies, likewise; its prior ends there
    lowest: float = -math.inf
    highest: float = math.inf
    between: Callable[[Facts], tuple[float, float]] | None = None  # the same where the campaign says them
    scale: float = 1.0  # turns the SI amplitude into `unit`
    felt: Felt | None = None  # the number that a sentence states
    shapes: tuple[ShapeParameter, ...] = ()
    # the shapes to be tried, none where the campaign cannot show the effect
    grid: Callable[[Facts], tuple[Tried, ...]] = lambda _: (Tried(shape=()),)
    # (scene, amplitude, shape) -> [P] Nm at the scene's points (0: averages do not show it)
    change: Callable[[Scene, float, Shape], FloatArray] = lambda scene, _, __: np.zeros_like(scene.curve)
    # whether it changes the stationary curve, which friction in loops then lags behind, or the measured torque itself; None
    # where that is unknown and a shape says
    before_lag: bool | None
    discrepancies: tuple[Discrepancy, ...] = ()  # along what its form is uncertain; an exact law has none
    tails: float = 2.0  # degrees of freedom of the amplitude's prior, infinite for a normal one
    # the shapes between which a size is averaged; None: as it was fitted
    courses: Callable[[Facts], tuple[Tried, ...]] | None = None
    # (scene, settings) -> [P, m] Nm, the change for many (amplitude, shape) at once, where that is cheaper
    several: Callable[[Scene, Sequence[tuple[float, Shape]]], FloatArray] | None = None
    has_onset: bool = False  # whether its last shape is the cycle from which on it is at work (`with_onset` below)
    grows_with: Measure | None = None
    counts_in_severity: bool = False  # its amplitude is the exponent by which ζ counts engagements, no torque
    named: bool = True  # whether it may be named as a cause; else what it explains is uncatalogued and lies on `axis`
    axis: str = ""
    article: str = ""  # what stands before its name where it is the cause (`a`, `changed`)
    check: str = ""  # what to look at on the rig where it is the cause, after "Next: "
    repair: str = ""  # what ends it, where an adopted model corrects for it
    states: str = ""  # the size in a sentence, {} in its place
    states_below: str = ""  # of a negative size, its amount in the place
    opposite_physics: str = ""  # a sentence for a negative amplitude, where `physics` holds for a positive one only

    def changes(self, scene: Scene, settings: Sequence[tuple[float, Shape]]) -> FloatArray:
        """Changes of torque [P, m] Nm for several pairs (amplitude, shape)."""
        if self.several is not None:
            return self.several(scene, settings)
        return np.stack([self.change(scene, amplitude, shape) for amplitude, shape in settings], axis=1)

    def stiff(self, shape: Shape) -> Shape:
        """The values of the shapes that a refit does not move."""
        return tuple(value for value, parameter in zip(shape, self.shapes, strict=True) if not parameter.smooth)

    def smooth(self, shape: Shape) -> list[tuple[float, ShapeParameter]]:
        """The values of the shapes that a refit moves, each with its parameter."""
        return [(x, parameter) for x, parameter in zip(shape, self.shapes, strict=True) if parameter.smooth]

    def onset(self, shape: Shape) -> float:
        """The cycle from which the effect is at work."""
        return shape[-1] if self.has_onset else FROM_THE_START

    def from_the_start(self, shape: Shape) -> Shape:
        """The shape of an effect that is at work in every test."""
        return (*shape[:-1], FROM_THE_START) if self.has_onset else shape

    def lags(self, shape: Shape) -> bool:
        """Whether the effect changes the stationary curve, so that friction in loops lags behind its change."""
        if self.before_lag is not None:
            return self.before_lag
        return any(value >= parameter.lags_from for value, parameter in zip(shape, self.shapes, strict=False))

    def sized(self, facts: Facts) -> "Effect":
        """The effect with the prior that fits this campaign's clutch."""
        factor = 1.0
        if self.grows_with is Measure.TORQUE:
            factor = facts.usual_torque / criteria.USUAL_TORQUE
        elif self.grows_with is Measure.PRESSURE:
            factor = facts.usual_pressure / criteria.USUAL_PRESSURE
        lowest, highest = self.between(facts) if self.between else (factor * self.lowest, factor * self.highest)
        return replace(self, prior_sd=factor * self.prior_sd, lowest=lowest, highest=highest)

    @property
    def positive(self) -> bool:
        """Whether the amplitude cannot be negative."""
        return self.lowest >= 0.0

    def within(self, amplitude: float) -> float:
        """The amplitude, limited to its bounds. A negative amplitude of a one-sided effect is left as it is: a fit
        passes through there, and a fit that ends there found nothing at work."""
        return min(amplitude if self.positive else max(amplitude, self.lowest), self.highest)

    def unit_changes(self, scene: Scene, shapes: Sequence[Shape]) -> FloatArray:
        """Changes of torque [P, m] Nm per unit of a small amplitude: the columns of the linear screen."""
        step = 1e-3 * self.prior_sd
        return self.changes(scene, [(step, shape) for shape in shapes]) / step

    def amplitude_cost(self, amplitude: float) -> float:
        """-ln p(a)/p(0) [nats]."""
        squared = (amplitude / self.prior_sd) ** 2
        if math.isinf(self.tails):
            return 0.5 * squared
        return 0.5 * (self.tails + 1.0) * math.log1p(squared / self.tails)

    def amplitude_precision(self, amplitude: float) -> float:
        """(d cost/da)/a, in 1/unit²: the precision of a normal prior with the same slope at a."""
        if math.isinf(self.tails):
            return float(self.prior_sd**-2.0)
        return float((self.tails + 1.0) / (self.tails * self.prior_sd**2 + amplitude**2))

    @property
    def log_amplitude_peak(self) -> float:
        """ln(p(0) √(2π)) [nats], with a in its unit."""
        peak = -math.log(self.prior_sd)
        if math.isinf(self.tails):
            return peak
        half = 0.5 * self.tails
        return peak + math.lgamma(half + 0.5) - math.lgamma(half) - 0.5 * math.log(half)


def with_onset(effect: Effect) -> Effect:
    """The effect with one more shape, its onset: the cycles from which on it is at work, or FROM_THE_START.

    A start before the first test has half the prior probability, the possible onsets (`Facts.onsets`) share the other
    half. An onset is tried with the likeliest kinds of shapes alone, and of each with its likeliest shape: a refit
    moves the others. Every effect that may set in has one, for if only one effect's template had a step, any step would
    be taken for that effect."""
    own = len(effect.shapes)

    def grid(facts: Facts) -> tuple[Tried, ...]:
        tried = effect.grid(facts)
        always = [Tried(shape=(*t.shape, FROM_THE_START), log_weight=t.log_weight) for t in tried]
        if not tried or facts.states.size < 3:
            return tuple(always)
        kinds: dict[Shape, list[Tried]] = {}
        for one in tried:
            kinds.setdefault(effect.stiff(one.shape), []).append(one)
        weights = [float(logsumexp([one.log_weight for one in kind])) for kind in kinds.values()]
        likeliest = [k for k, w in zip(kinds.values(), weights, strict=True) if w > max(weights) - 1e-6]
        shapes = [max(kind, key=lambda one: one.log_weight).shape for kind in likeliest]
        onsets = [onset for _, onset, _ in facts.onsets]
        weight = float(logsumexp(weights) - np.log(len(shapes) * len(onsets)))
        later = [Tried(shape=(*shape, onset), log_weight=weight) for shape in shapes for onset in onsets]
        return (*always, *later)

    def several(scene: Scene, settings: Sequence[tuple[float, Shape]]) -> FloatArray:
        # an extension that was stored without an onset is at work from the start
        onsets = np.array([max(shape[own:], default=FROM_THE_START) for _, shape in settings])
        at_work = scene.points.cycles[:, None] > onsets
        return np.where(at_work, effect.changes(scene, [(size, shape[:own]) for size, shape in settings]), 0.0)

    return replace(
        effect,
        shapes=(*effect.shapes, ShapeParameter(name="onset ζ_k", unit="cycles")),
        has_onset=True,
        grid=grid,
        change=lambda scene, amplitude, shape: several(scene, [(amplitude, shape)])[:, 0],
        several=None if effect.several is None else several,
    )


#: Deviations of the two normal distributions that approximate p where everything is linear, in s; each has half the weight.
SCALES = (1.0, 6.0)


def followed(target: FloatArray, points: Points, settling: float) -> FloatArray:
    """The mean over each plateau [P] of a quantity that relaxes towards that plateau's target [P] with the time
    constant `settling` [s], from its value at the end of the plateau before. A run's first plateau and loops are at
    their target."""
    follows = np.flatnonzero(points.previous >= 0)  # each follows the point just before it
    before = points.previous[follows]
    durations = np.maximum(points.clock[follows] - points.clock[before], 1e-6) / settling  # in time constants
    keep = np.zeros(points.previous.size)
    keep[follows] = np.exp(-durations)
    out = target.copy()
    ends = recursion(keep, (1.0 - keep) * target)
    out[follows] += (ends[before] - target[follows]) * (1.0 - keep[follows]) / durations
    return out


def by_loop(points: Points, looping: IntArray) -> tuple[FloatArray, FloatArray]:
    """Velocity [l, PHASES] m/s and angular frequency [l, 1] rad/s of loops by the indices [l · PHASES] of their points."""
    columns = (values[looping].reshape(-1, PHASES) for values in (points.velocity, points.angular_frequency))
    velocity, frequency = columns
    return velocity, frequency[:, :1]


def lagging(target: FloatArray, frequency: FloatArray, time: float) -> FloatArray:
    """The periodic response [l, PHASES] of a first-order lag of `time` s to a target [l, PHASES], harmonic by harmonic;
    frequency [l, 1] rad/s."""
    waves = np.fft.rfft(target, axis=1)
    waves = waves / (1 + 1j * np.arange(waves.shape[1]) * frequency * time)
    return np.asarray(np.fft.irfft(waves, target.shape[1], axis=1), dtype=np.float64)


def flattening(life: FloatArray, share: float) -> FloatArray:
    """The course x (1 + s)/(x + s) over the share x [n] of life, 1 at its end; half of it is done after about s."""
    return life * (1.0 + share) / (life + share)
