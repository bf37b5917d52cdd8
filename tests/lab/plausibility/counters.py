"""Dated lives whose counter changes from some run on, or that get another clutch's runs; and the same without.

`CAUSES` has a function a cause: rng, the runs by date, the first run that it concerns -> the runs as they are sent, and the
names of those that are wrong.
"""

from collections.abc import Callable, Sequence
from datetime import timedelta
from typing import Any

import numpy as np

from tests.lab.plausibility import honest_lives
from tests.lab.plausibility.bench import Bench, Body
from tests.lab.plausibility.simulated import BEGUN

Cause = Callable[[np.random.Generator, list[Body], int], tuple[list[Body], set[str]]]
COURSES: dict[str, Callable[[np.random.Generator, np.ndarray], np.ndarray]] = {
    "even": lambda _, u: 1.0 - 0.4 * u,
    "slowing": lambda _, u: (1.0 + 3.0 * u) ** -0.5,
    "a knee": honest_lives.knee,
    "levelling off": honest_lives.levels_off,
    "constant": lambda _, u: np.ones(u.size),
}
FALLING = ("even", "slowing")
TESTS = 14
STANDS_STILL = "stands still"


def dated_life(rng: np.random.Generator, name: str = "t", *, courses: Sequence[str] = tuple(COURSES)) -> list[Body]:
    """Tests at even or ragged gaps, as fast as the rig goes but for idle days."""
    step = float(rng.choice([100, 500, 1_000, 6_000, 20_000]))
    ragged = rng.random() < 0.5
    gaps = step * (np.exp(0.3 * rng.standard_normal(TESTS - 1)) if ragged else np.ones(TESTS - 1))
    cycles = np.round(np.append(0.0, np.cumsum(gaps)))
    course = COURSES[str(rng.choice(courses))](rng, cycles / cycles[-1])
    idle = rng.exponential(5.0, TESTS - 1) * (rng.random(TESTS - 1) < 0.2)
    days = np.append(
        0.0, np.cumsum(gaps / step * rng.uniform(0.2, 3.0) * np.exp(0.15 * rng.standard_normal(TESTS - 1)) + idle)
    )
    runs = honest_lives._tests(cycles, course, rng)
    return [
        run | {"run_id": f"{name}{k}", "started_at": (BEGUN + timedelta(days=float(day))).isoformat()}
        for k, (run, day) in enumerate(zip(runs, days, strict=True))
    ]


def _from(runs: list[Body], k: int, cycles: Callable[[float], float]) -> tuple[list[Body], set[str]]:
    after = [run | {"cycles": float(round(cycles(run["cycles"])))} for run in runs[k:]]
    return [*runs[:k], *after], {run["run_id"] for run in after}


def restart(rng: np.random.Generator, runs: list[Body], k: int) -> tuple[list[Body], set[str]]:
    at = runs[k - 1]["cycles"] + float(rng.choice([0.0, rng.random(), 1.0])) * (
        runs[k]["cycles"] - runs[k - 1]["cycles"]
    )
    return _from(runs, k, lambda cycles: cycles - at)


def roll_over(rng: np.random.Generator, runs: list[Body], k: int) -> tuple[list[Body], set[str]]:
    """A counter that had come to where it rolls over between two tests: the life is shifted to lie there."""
    modulus = float(rng.choice([m for m in (1e4, 65_536.0, 1e5, 1e6) if m > 1.2 * runs[k]["cycles"]] or [1e7]))
    shift = round(modulus - 0.5 * (runs[k]["cycles"] + runs[k - 1]["cycles"]))
    shifted = [run | {"cycles": run["cycles"] + shift} for run in runs]
    return _from(shifted, k, lambda cycles: cycles % modulus)


def offset(rng: np.random.Generator, runs: list[Body], k: int) -> tuple[list[Body], set[str]]:
    """A used counter."""
    ahead = float(np.exp(rng.uniform(np.log(10.0), np.log(1e3)))) * (runs[k]["cycles"] - runs[k - 1]["cycles"])
    return _from(runs, k, lambda cycles: cycles + ahead)


def stuck(rng: np.random.Generator, runs: list[Body], k: int) -> tuple[list[Body], set[str]]:
    """Unplugged for three to five tests."""
    until = min(k + int(rng.integers(3, 6)), len(runs) - 2)
    still = [run | {"cycles": runs[k - 1]["cycles"]} for run in runs[k:until]]
    return [*runs[:k], *still, *runs[until:]], {run["run_id"] for run in still}


def unit(rng: np.random.Generator, runs: list[Body], k: int) -> tuple[list[Body], set[str]]:
    factor = float(rng.choice([1e3, 1e-3, 0.621_371, 1.609_344]))
    return _from(runs, k, lambda cycles: cycles / factor)


def two_clutches(rng: np.random.Generator, runs: list[Body], k: int) -> tuple[list[Body], set[str]]:
    """The tests of another, younger clutch come between, dated as theirs were made."""
    other = dated_life(rng, "o")[: int(rng.integers(3, 7))]
    place = {"cycles": 0.0}
    between = []
    for run, theirs in zip(runs[k:], other, strict=False):
        moment = _moment(run) + 0.4 * (_moment(runs[k]) - _moment(runs[k - 1]))
        place["cycles"] = theirs["cycles"]
        between.append(theirs | {"started_at": moment.isoformat()})
    return sorted([*runs, *between], key=_moment), {run["run_id"] for run in between}


def _moment(run: Body) -> Any:
    return BEGUN.fromisoformat(run["started_at"])


CAUSES: dict[str, Cause] = {
    "restart at zero": restart,
    "roll-over": roll_over,
    "another counter": offset,
    STANDS_STILL: stuck,
    "another unit": unit,
    "two clutches": two_clutches,
}


def trial(seed: int, cause: str, number: int) -> dict[str, Any]:
    """A life in which a cause begins with the fourth to tenth test; "" for none. How many of its runs are wrong, how many of
    these and of the others are held in the end, how many were when they came in, and the codes."""
    rng = np.random.default_rng([seed, 6, list(CAUSES).index(cause) if cause else len(CAUSES), number])
    # a counter that stands still while friction does cannot be told
    runs, wrong = dated_life(rng, courses=FALLING if cause == STANDS_STILL else tuple(COURSES)), set[str]()
    if cause:
        runs, wrong = CAUSES[cause](rng, runs, int(rng.integers(3, 10)))
    bench = Bench({})
    answers = {run["run_id"]: bench.answer(run).codes for run in runs}
    held = {event.run_id for event in bench.held}
    return {
        "runs": len(runs),
        "wrong": len(wrong),
        "found": len(wrong & held),
        "honest held": len(held - wrong),
        "asked at once": sum(bool(answers[name]) for name in wrong),
        "honest asked": sum(bool(codes) for name, codes in answers.items() if name not in wrong),
        "codes": sorted({code for codes in answers.values() for code in codes}),
    }
