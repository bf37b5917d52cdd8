"""What was done on the rig: when, at which pressures and speeds, in what order, with which oil, and what was written down.

A `Site` is one stretch of measuring: series [s] by samples [n]. Stationary tests are one site (a series a run, a sample a
plateau), or, recorded raw, one site of samples in time; dynamic tests are a site a frequency (a series a loop).
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import lfilter

from models.arrays import FloatArray

RADIUS = 0.058
RPM = 2 * np.pi / 60
DWELL = 5.0
#: This share of rigs drives up and down by ramps.
RAMPS = 0.2


@dataclass(frozen=True)
class Life:
    """What all sites share, an entry a state: cycles, moment [s] of the test, pause [s] before it, energy [kJ] of the
    duty cycles before it; events are pairs of a kind and the cycles."""

    cycles: FloatArray
    moment: FloatArray
    pause: FloatArray
    energy: FloatArray
    usual_energy: float
    events: tuple[tuple[str, float], ...] = ()

    @property
    def span(self) -> float:
        return float(self.cycles[-1])


@dataclass(frozen=True)
class Site:
    """Where and when torque is measured; arrays [series, samples]. `row` counts the plateaus of a raw record."""

    kind: str  # stationary, raw, loop
    state: np.ndarray  # [series] index of the state
    bar: FloatArray
    rpm: FloatArray
    clock: FloatArray  # s since the test began
    oil: FloatArray  # true oil temperature, °C
    life: Life
    step: float  # s between samples
    row: np.ndarray | None = None
    frequency: float = 0.0

    @property
    def v(self) -> FloatArray:
        return self.rpm * RPM * RADIUS

    def thin(self, count: int) -> "Site":
        """Every count-th sample of a record, the middle one of each; plateaus stay as they are."""
        if self.kind == "stationary" or count == 1:
            return self
        keep = slice(count // 2, self.bar.shape[1] // count * count, count)
        columns = {name: getattr(self, name)[:, keep] for name in ("bar", "rpm", "clock", "oil")}
        return replace(self, **columns, step=count * self.step, row=None if self.row is None else self.row[keep])

    @property
    def cycles(self) -> FloatArray:
        return self.life.cycles[self.state][:, None]


@dataclass(frozen=True)
class Plan:
    """The whole protocol, and what of it the rig tells."""

    life: Life
    sites: tuple[Site, ...]
    tells_moments: bool
    tells_oil: bool
    tells_energy: bool
    pressures: FloatArray = field(default_factory=lambda: np.arange(4.0, 7.1, 0.5))


@dataclass(frozen=True)
class Wish:
    """What an effect needs of the protocol; None leaves it to chance."""

    states: int = 6
    loops: bool = True
    raw: bool = False
    oil: bool | None = None
    moments: bool | None = None
    energy: bool | None = None
    pauses: bool = False
    early: bool = False
    event: str | None = None
    both_ways: bool = False
    rate: float = 100.0
    full: bool = False  # the reference's 7 x 40
    speeds: int | None = None  # so few of them, from a third of the highest up
    noise: float = 1.0  # of the sensor, in percent of the torque


def draw_plan(rng: np.random.Generator, wish: Wish) -> Plan:
    """A protocol that grants the wish and is otherwise left to chance."""
    full = wish.full or rng.random() < 0.4
    count = 7 if full else int(rng.integers(5, 8))
    pressures = np.linspace(4.0, 7.0, count)
    speeds = np.linspace(20, 1970, 40 if full else int(rng.integers(20, 41)))
    if wish.raw:
        pressures, speeds = np.linspace(4.0, 7.0, 5), np.linspace(20, 1970, 20)
    if wish.speeds is not None:
        speeds = np.linspace(20, 1970, wish.speeds + 3)[2:-1]
    life = _life(rng, wish)
    order = _order(rng, pressures, speeds, wish)
    sites = [_stationary(rng, life, order, wish)]
    if wish.loops:
        sites.append(_loops(rng, life, pressures, 0.1, wish.rate))
    return Plan(
        life=life,
        sites=tuple(sites),
        tells_moments=_chance(rng, wish.moments, 0.6),
        tells_oil=_chance(rng, wish.oil, 0.8),
        tells_energy=_chance(rng, wish.energy, 0.6),
        pressures=pressures,
    )


def _chance(rng: np.random.Generator, wanted: bool | None, share: float) -> bool:
    drawn = bool(rng.random() < share)
    return drawn if wanted is None else wanted


def _life(rng: np.random.Generator, wish: Wish) -> Life:
    span = rng.uniform(11_000, 20_000)
    n = wish.states
    even = np.arange(n) / max(n - 1, 1)
    share = even ** rng.uniform(1.2, 1.9) if n < 30 else even
    if wish.early:
        share[1:3] = np.sort(rng.uniform(0.012, 0.08, 2))
    share[1:-1] *= 1 + 0.08 * rng.uniform(-1, 1, n - 2)
    cycles = np.round(np.sort(share) * span / 10) * 10
    cycles -= cycles[0]
    pause = np.where(rng.random(n) < 0.4, rng.uniform(8, 64, n), rng.uniform(0.1, 1.0, n)) * 3600
    if wish.pauses:
        pause = np.exp(rng.uniform(np.log(0.2), np.log(90), n)) * 3600
    blocks = np.diff(cycles, prepend=0.0) * 20.0
    moment = 1.767e9 + np.cumsum(blocks + pause + 2500.0)
    usual = rng.uniform(12, 24)
    varied = wish.energy or rng.random() < 0.4
    energy = usual * np.exp(rng.uniform(0.2, 0.4) * rng.standard_normal(n)) if varied else np.full(n, usual)
    events = []
    if wish.event is not None:
        k = int(rng.integers(2, n - 1))
        events.append((wish.event, float(np.round(rng.uniform(cycles[k - 1], cycles[k]), -1))))
    elif rng.random() < 0.15:
        kind = str(rng.choice(["oil_change", "rest", "sensor_zero", "other"]))
        events.append((kind, float(cycles[int(rng.integers(1, n))])))
    return Life(cycles, moment, pause, energy, usual, tuple(events))


def _order(rng: np.random.Generator, pressures: FloatArray, speeds: FloatArray, wish: Wish) -> FloatArray:
    """Rows [n, 2] of bar and rpm in the order in which they are run."""
    style = str(rng.choice(["up", "up", "down", "zigzag", "shuffled"]))
    levels = pressures if rng.random() < 0.7 else rng.permutation(pressures)
    if wish.both_ways:
        levels = np.concatenate([pressures, pressures[::-1]])
        speeds, style = speeds[::2], "up"
    rows = []
    for i, p in enumerate(levels):
        s = speeds
        if style == "down" or (style == "zigzag" and i % 2):
            s = speeds[::-1]
        if style == "shuffled":
            s = rng.permutation(speeds)
        rows += [(p, n) for n in s]
    return np.array(rows)


def oil_course(rng: np.random.Generator, clock: FloatArray, effort: FloatArray) -> FloatArray:
    """Oil temperature [°C] in a test: a thermostat that saws, warming up, the heat of sliding; it stays in 80 to 90 °C."""
    period, depth = rng.uniform(240, 900), rng.uniform(0.6, 2.4)
    phase = (clock / period + rng.random()) % 1.0
    rise = rng.uniform(0.2, 0.5)
    saw = np.where(phase < rise, phase / rise, (1 - phase) / (1 - rise)) - 0.5
    warming = -rng.uniform(0, 2.5) * np.exp(-clock / rng.uniform(100, 500))
    step = float(clock[1] - clock[0]) if clock.size > 1 else 1.0
    keep = np.exp(-step / 180.0)
    heat = lfilter([1 - keep], [1, -keep], effort - effort.mean()) * rng.uniform(0.3, 1.5)
    return np.clip(85 + rng.uniform(-2.2, 2.2) + depth * saw + warming + heat, 80.0, 90.0)


def _stationary(rng: np.random.Generator, life: Life, order: FloatArray, wish: Wish) -> Site:
    n = life.cycles.size
    bar = order[:, 0] * (1 + 0.003 * rng.standard_normal((n, order.shape[0])))
    rpm = order[:, 1] + rng.uniform(-0.5, 0.5, (n, order.shape[0]))
    row = None
    clock = np.broadcast_to(DWELL * (np.arange(order.shape[0]) + 0.5), bar.shape)
    step = DWELL
    if wish.raw:
        step = 1 / wish.rate
        each = round(DWELL * wish.rate)
        ramp = np.minimum(np.arange(each) * step / 0.12, 1.0)

        def drawn_out(levels: FloatArray) -> FloatArray:
            before = np.concatenate([levels[:, :1], levels[:, :-1]], axis=1)
            return (before[..., None] + (levels - before)[..., None] * ramp).reshape(n, -1)

        bar, rpm = drawn_out(bar), drawn_out(rpm)
        row = np.repeat(np.arange(order.shape[0]), each)
        clock = np.broadcast_to(step * np.arange(row.size), bar.shape)
    effort = bar[0] * rpm[0] / 6000
    oil = np.stack([oil_course(rng, clock[0], effort) for _ in range(n)])
    return Site("raw" if wish.raw else "stationary", np.arange(n), bar, rpm, clock, oil, life, step, row)


def _loops(rng: np.random.Generator, life: Life, pressures: FloatArray, frequency: float, rate: float) -> Site:
    n = life.cycles.size
    swing = _swing(rng, frequency, rate)
    count = swing.size
    time = np.arange(count) / rate
    series = n * pressures.size
    start = np.tile(np.arange(pressures.size) * (time[-1] + 3.0), n)[:, None]
    rpm = np.broadcast_to(swing, (series, count))
    bar = np.tile(pressures * (1 + 0.002 * rng.standard_normal(pressures.size)), n)[:, None] + np.zeros((1, count))
    effort = np.full(8, 0.5)
    level = [oil_course(rng, np.linspace(0, 120, 8), effort) for _ in range(n)]
    oil = np.stack(
        [np.interp(start[j] + time, np.linspace(0, 120, 8), level[j // pressures.size]) for j in range(series)]
    )
    state = np.repeat(np.arange(n), pressures.size)
    return Site("loop", state, bar, rpm, start + time, oil, life, 1 / rate, None, frequency)


def _swing(rng: np.random.Generator, frequency: float, rate: float) -> FloatArray:
    """Speed [rpm] at one pressure: one and a half periods as the reference has it, or other numbers of them with the speed
    held before, ramped or swung, brought back to where it was held, and held again until the pressure moves on."""
    held = rng.random() < 0.5
    periods = rng.choice([1.5, 2.0, 2.1, 3.0]) if held else 1.5
    sine = np.sin(2 * np.pi * frequency * np.arange(round(periods / frequency * rate)) / rate)
    sine = 1000 + (1800 / np.pi * np.arcsin(sine) if rng.spawn(1)[0].random() < RAMPS else 1000 * sine)
    if not held:
        return sine
    way = np.linspace(0, 1, round(rng.uniform(0.3, 1.5) * rate))
    back = sine[-1] + (1000 - sine[-1]) * way**2 * (3 - 2 * way)
    before, after = (np.full(round(rng.uniform(*ends) * rate), 1000.0) for ends in ((0.3, 3.0), (0.0, 1.0)))
    return np.concatenate([before, sine, back, after])
