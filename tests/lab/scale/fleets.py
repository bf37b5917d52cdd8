"""How long a fleet's prior takes to learn, by the number of clutches."""

import time

import numpy as np

from models.prognosis.fleet import Taught, population, taught
from models.tracking.measurement import Measurement
from tests.lab.measuring import table

SEED, DIFFERENT = 4100, 40


def lesson(number: int) -> Taught:
    """What 20 tests of a life of eq. 6 teach; lives differ in φ, by a third."""
    rng = np.random.default_rng([SEED, number])
    scale = 3_000.0 * np.exp(0.3 * rng.standard_normal())
    progress = np.linspace(0.0, 20_000.0, 20)
    values = 0.1 * (1.0 - 0.7 * (1.0 - (1.0 + progress / scale) ** -0.8)) * (1.0 + 0.003 * rng.standard_normal(20))
    tests = [
        Measurement(progress=x, value=y, variance=1e-9) for x, y in zip(progress.tolist(), values.tolist(), strict=True)
    ]
    return taught(tests, seed=number)


def main() -> None:
    """Seconds of the processor by clutches; the same lessons are repeated beyond 40, which takes as long."""
    lessons = [lesson(number) for number in range(DIFFERENT)]
    rows = []
    for count in (10, 100, 1_000):
        fleet = (lessons * (count // DIFFERENT + 1))[:count]
        start = time.process_time()
        population(fleet)
        taken = time.process_time() - start
        rows.append((count, f"{taken:.2f}", f"{taken * min(count, 20):.1f}"))
    titles = ("clutches of a kind", "the prior of all, s", "without each, or each of 20 groups, s (computed)")
    print("\n".join(table(titles, rows)))


if __name__ == "__main__":
    main()
