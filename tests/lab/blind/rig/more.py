"""The advised test, made on the same rig with the same secret: its runs are measured and added to the campaign."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from tests.lab.blind.rig.hide import Hidden
from tests.lab.blind.rig.plan import Life, Site, oil_course
from tests.lab.blind.rig.sensor import measure
from tests.lab.blind.rig.world import Drag, read

#: What each advice asks for: states to come, energy of their duty, pause [s] before every second, oil [°C], pressures,
#: order, loops [Hz], how many tests.
ADVISED: dict[str, dict[str, float]] = {
    "loops_0.3hz": {"frequency": 0.3},
    "light_loops": {"frequency": 0.3, "pressure": 0.25},
    "light_loops_60c": {"frequency": 0.3, "pressure": 0.25, "oil": 60.0},
    "open_sweep": {"pressure": 0.0},
    "open_loops": {"frequency": 0.3, "pressure": 0.0},
    "sweep_60c": {"oil": 60.0},
    "sweeps_60c": {"oil": 60.0, "times": 3},
    "sweep_100c": {"oil": 100.0},
    "falling_speeds": {"falling": 1.0, "times": 3},
    "light_sweep": {"pressure": 0.25},
    "light_sweeps": {"pressure": 0.25, "times": 5},
    "repeats": {"times": 5},
    "more_states": {"states": 3},
    "rests": {"states": 3, "rest": 48 * 3600.0},
    "half_energy": {"states": 2, "energy": 0.5},
    "twice_energy": {"states": 2, "energy": 2.0},
}
#: Advice that asks for several of these.
TOGETHER = {
    "open_clutch": ("open_sweep", "open_loops"),
    "open_clutch_and_light": ("open_sweep", "open_loops", "light_sweep", "light_loops"),
    "all_loads_and_open": ("light_sweep", "loops_0.3hz", "light_loops", "open_sweep", "open_loops"),
    "light_tests": ("light_sweep", "light_loops"),
    "light_tests_60c": ("light_sweep", "light_loops_60c"),
    "warm_and_cool": ("light_sweep", "light_loops", "light_loops_60c"),
    "all_loads": ("light_sweep", "loops_0.3hz", "light_loops"),
    "all_loads_and_60c": ("light_sweep", "loops_0.3hz", "light_loops", "light_loops_60c"),
}


def with_test(hidden: Hidden, key: str) -> Hidden:
    """The campaign after the test of that key has been made too; raises KeyError for a test the rig does not know."""
    if key in TOGETHER:
        for part in TOGETHER[key]:
            hidden = with_test(hidden, part)
        return hidden
    advised = ADVISED[key]
    rng = np.random.default_rng([*hidden.seed, 99, len(hidden.plan.sites)])
    life = _lived_on(hidden.plan.life, advised)
    new = np.arange(hidden.plan.life.cycles.size, life.cycles.size)
    old = tuple(replace(site, life=life) for site in hidden.plan.sites)
    site = _loops(rng, hidden, life, advised) if "frequency" in advised else _sweeps(rng, old[0], new, advised)
    added = replace(hidden.plan, life=life, sites=(site,))
    truth = read(added, hidden.clutch, hidden.effects, drag=drag_of(hidden.seed))
    readings = measure(rng, added, hidden.sensor, truth)
    plan = replace(hidden.plan, life=life, sites=(*old, site))
    return replace(hidden, plan=plan, measured=[*hidden.measured, *readings])


def drag_of(seed: Sequence[int]) -> Drag:
    """What the open clutch drags at v [m/s]: it rises with speed, and falls again where the film between discs ruptures."""
    dice = np.random.default_rng([*seed, 55])
    size, power, rupture = dice.uniform(0.0, 1.0), dice.uniform(0.7, 1.4), dice.uniform(0.0, 2.0)

    def drag(v: FloatArray) -> FloatArray:
        x = v / 6.0
        return size * x**power / (1 + rupture * x**2)

    return drag


def _lived_on(life: Life, advised: dict[str, float]) -> Life:
    """A state a test: further on in life, or again where it is."""
    states = int(advised.get("states", advised.get("times", 1)))
    step = float(np.median(np.diff(life.cycles)[life.cycles.size // 2 - 1 :])) if "states" in advised else 0.0
    cycles = life.cycles[-1] + step * (1 + np.arange(states))
    pause = np.where(np.arange(states) % 2 == 0, advised.get("rest", 600.0), 600.0)
    moment = life.moment[-1] + 3600 + np.cumsum(20 * step + pause + 2500 * np.ones(states))
    energy = np.full(states, advised.get("energy", 1.0) * life.usual_energy)
    return replace(
        life,
        cycles=np.append(life.cycles, cycles),
        pause=np.append(life.pause, pause),
        moment=np.append(life.moment, moment),
        energy=np.append(life.energy, energy),
    )


def _sweeps(rng: np.random.Generator, last: Site, new: np.ndarray, advised: dict[str, float]) -> Site:
    """The stationary test in its own order, or with speeds falling, at each new state."""
    rows = np.arange(last.bar.shape[1])
    if advised.get("pressure") == 0.0:  # the speeds at one pressure, five times over
        rows = np.tile(rows[np.abs(last.bar[-1] - last.bar[-1, 0]) < 0.2], 5)
    if "falling" in advised and last.kind == "stationary":
        rows = np.lexsort((-last.rpm[-1], np.round(2 * last.bar[-1]) / 2))
    bar = advised.get("pressure", 1.0) * np.repeat(last.bar[-1:, rows], new.size, axis=0)
    rpm = np.repeat(last.rpm[-1:, rows], new.size, axis=0)
    effort = bar[0] * rpm[0] / 6000
    clock = last.clock[-1] if rows.size == last.bar.shape[1] else last.step * (np.arange(rows.size) + 0.5)
    oil = np.stack([oil_course(rng, clock, effort) for _ in new]) + advised.get("oil", 85.0) - 85.0
    return replace(last, state=new, bar=bar, rpm=rpm, clock=np.repeat(clock[None], new.size, axis=0), oil=oil)


def _loops(rng: np.random.Generator, hidden: Hidden, life: Life, advised: dict[str, float]) -> Site:
    """Ten periods at every pressure, or at three light ones, two hundred samples a period."""
    frequency, pressures = advised["frequency"], hidden.plan.pressures
    if "pressure" in advised:
        pressures = advised["pressure"] * pressures[0] * np.array([1.0, 1.5, 2.0] if advised["pressure"] else [1.0])
    time = np.arange(2001) / (200 * frequency)
    rpm = np.broadcast_to(1000 - 1000 * np.cos(2 * np.pi * frequency * time), (pressures.size, time.size))
    clock = np.arange(pressures.size)[:, None] * (time[-1] + 3.0) + time
    oil = np.full(clock.shape, advised.get("oil", 85.0) + rng.uniform(-2, 2))
    state = np.full(pressures.size, life.cycles.size - 1)
    bar = pressures[:, None] + np.zeros_like(time)
    return Site("loop", state, bar, rpm, clock, oil, life, float(time[1]), None, frequency)
