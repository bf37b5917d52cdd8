"""Honest lives that are no eq. 6, each as runs in the order in which they are sent: nobody made a slip.

`KINDS` has a function a kind: rng -> (cycles, share of the first COF) of its tests, and what is declared between them.
"""

from collections.abc import Callable
from datetime import timedelta

import numpy as np

from models.arrays import FloatArray
from tests.lab.plausibility.bench import Body, with_gain
from tests.lab.plausibility.blind import share_lives
from tests.lab.plausibility.simulated import BEGUN
from tests.support import stationary

#: The runs of a life.
Life = list[Body]


def _test(run_id: str, cycles: float, share: float, rng: np.random.Generator) -> Body:
    """A stationary test whose mean COF is that share of when new, its gain off by half a per cent."""
    body = stationary(cycles, run_id=run_id, wear=0.0, noise=0.01, pressures=(4.0, 6.0))
    return with_gain(body, share * (1.0 + 0.005 * rng.standard_normal()))


def _tests(cycles: FloatArray, share: FloatArray, rng: np.random.Generator) -> Life:
    return [_test(f"t{k}", float(c), float(s), rng) for k, (c, s) in enumerate(zip(cycles, share, strict=True))]


def _even(rng: np.random.Generator, count: int = 14) -> FloatArray:
    return float(rng.choice([10, 200, 1000, 5000, 50_000, 1_000_000])) * np.arange(count)


def _evenly(course: Callable[[np.random.Generator, FloatArray], FloatArray]) -> Callable[[np.random.Generator], Life]:
    """A life of even tests; `course`: rng, share of the life -> share of the first COF."""

    def life(rng: np.random.Generator) -> Life:
        cycles = _even(rng)
        return _tests(cycles, course(rng, np.linspace(0, 1, cycles.size)), rng)

    return life


def knee(rng: np.random.Generator, u: FloatArray) -> FloatArray:
    """Slow, then from some test on ten times as fast."""
    return 1.0 - 0.1 * u - 0.7 * np.maximum(u - rng.uniform(0.4, 0.8), 0.0)


def levels_off(rng: np.random.Generator, u: FloatArray) -> FloatArray:
    return 1.0 - 0.8 * np.minimum(u, rng.uniform(0.3, 0.6))


def turns_up(rng: np.random.Generator, u: FloatArray) -> FloatArray:
    """Falls, then rises: the oil ages."""
    at = rng.uniform(0.3, 0.6)
    return 1.0 - 0.5 * np.minimum(u, at) + 0.4 * np.maximum(u - at, 0.0)


def step_after_event(rng: np.random.Generator) -> Life:
    """Wears, and steps by up to a quarter after a declared oil change."""
    cycles = _even(rng)
    at, step = int(rng.integers(4, 10)), float(rng.choice([-1, 1]) * rng.uniform(0.05, 0.25))
    share = 1.0 - 0.3 * np.linspace(0, 1, cycles.size) + step * (np.arange(cycles.size) >= at)
    runs = _tests(cycles, share, rng)
    when = round(0.5 * float(cycles[at - 1] + cycles[at]))
    return [*runs[:at], {"kind": "maintenance", "event": "oil_change", "run_id": "m", "cycles": when}, *runs[at:]]


def undeclared_step(rng: np.random.Generator, u: FloatArray) -> FloatArray:
    """Steps by 15 to 30 % and stays there; nobody says why."""
    at, step = int(rng.integers(4, 10)), float(rng.choice([-1, 1]) * rng.uniform(0.15, 0.3))
    return 1.0 - 0.2 * u + step * (np.arange(u.size) >= at)


def kilometres(rng: np.random.Generator) -> Life:
    """A life counted in kilometres, with decimals."""
    cycles = np.round(np.cumsum(np.append(0.0, rng.normal(12_000, 1500, 13))), 1)
    return _tests(cycles, 1.0 - 0.4 * cycles / cycles[-1], rng)


def random_spacings(rng: np.random.Generator) -> Life:
    """Gaps that differ by orders of magnitude."""
    cycles = np.append(0.0, np.cumsum(np.round(np.exp(rng.normal(np.log(1500), 1.5, 13)) + 1.0)))
    return _tests(cycles, 1.0 / (1.0 + cycles / cycles[-1]) ** 0.6, rng)


def first_late(rng: np.random.Generator) -> Life:
    """A used clutch: the first test comes late, the others soon after one another."""
    start = float(round(np.exp(rng.uniform(np.log(5e3), np.log(5e6)))))
    cycles = start + start * float(rng.choice([0.01, 0.02, 0.1])) * np.arange(14)
    return _tests(np.round(cycles), 1.0 - 0.2 * np.linspace(0, 1, 14), rng)


def odd_order(rng: np.random.Generator) -> Life:
    """An even campaign that arrives in any order."""
    runs = _evenly(knee)(rng)
    return [runs[k] for k in rng.permutation(len(runs))]


def pause(rng: np.random.Generator) -> Life:
    """Two years between two tests: as many cycles as ever, or far more, and COF is another afterwards."""
    cycles = _even(rng)
    at, after = int(rng.integers(4, 10)), float(rng.choice([0.0, 5.0, 20.0]))
    cycles = cycles + (np.arange(cycles.size) >= at) * after * float(cycles[1])
    share = 1.0 - 0.3 * np.linspace(0, 1, cycles.size) + float(rng.normal(0, 0.08)) * (np.arange(cycles.size) >= at)
    runs = _tests(cycles, share, rng)
    return [
        run | {"started_at": (BEGUN + timedelta(days=3.0 * k + 730.0 * (k >= at))).isoformat()}
        for k, run in enumerate(runs)
    ]


def real(rng: np.random.Generator) -> Life:
    """A filter, a battery, a crack or a laser as a clutch whose COF falls."""
    lives = share_lives()
    name = str(rng.choice(sorted(lives)))
    history = lives[name][int(rng.integers(len(lives[name])))]
    cycles, share = np.array(history).T
    return _tests(np.round(cycles), np.maximum(share, 0.05), rng)


KINDS: dict[str, Callable[[np.random.Generator], Life]] = {
    "a knee": _evenly(knee),
    "levelling off": _evenly(levels_off),
    "turning up": _evenly(turns_up),
    "constant": _evenly(lambda _, u: np.ones(u.size)),
    "a step after an event": step_after_event,
    "a step that nobody declared": _evenly(undeclared_step),
    "kilometres": kilometres,
    "random spacings": random_spacings,
    "a first test that comes late": first_late,
    "in any order": odd_order,
    "a pause of two years": pause,
    "filters, batteries, cracks, lasers": real,
}


def life(seed: int, kind: str, number: int) -> Life:
    """One of the lives of a kind."""
    return KINDS[kind](np.random.default_rng([seed, 5, list(KINDS).index(kind), number]))
