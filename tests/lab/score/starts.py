"""The safe bound after the first tests of a life that show no wear: level ones, and ones that run in."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from models.prognosis.criteria import HORIZON
from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.stated_end import stated_end
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior, weak
from tests.lab.real.lives import WORLDS
from tests.lab.real.loaders import FOLDER
from tests.lab.score.table import percents, written
from tests.models.tracking.tracked_series import sent

DRAWS, END, MOST_TESTS = 1_000, 20_000.0, 8
#: A real life shows no wear yet while it has come less than this share of the way to its end.
UNWORN = 0.05
GRID = Grid(nodes=13, rows=13, levels=7)
#: The name of a row, the tests of a start, and the end of the life.
Start = tuple[str, list[Measurement], float]


def starts(count: int, seed: int) -> str:
    """By kind of start: how often the safe bound lies beyond the end, and where it lies."""
    real = list(real_starts(count, seed))
    found, rows = bounds([*simulated_starts(count, seed), *real], seed), []
    for name, outcomes in [*found.items(), ("all", [one for each in found.values() for one in each])]:
        bound, now, end = np.array(outcomes).T
        shares = np.quantile((bound - now) / (end - now), [0.5, 0.95]).tolist()
        rows.append(
            (name, bound.size, f"{100 * np.mean(bound > end):.1f} %", percents(shares), f"{np.median(bound / now):.2f}")
        )
    return written(
        f"{count} simulated starts and {len(real)} of real lives, seed {seed}, 3 to {MOST_TESTS} tests",
        "start | starts | safe bound beyond the end | of what is left, median/95 %: % | over the cycles tested, median",
        rows,
    )


def bounds(of: Iterable[Start], seed: int) -> dict[str, list[tuple[float, float, float]]]:
    """By kind of start: the safe bound, the cycles tested and the end of each."""
    found: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    for index, (name, tests, end) in enumerate(of):
        found[name].append((safe_bound(tests, np.random.default_rng([seed, index])), tests[-1].progress, end))
    return found


def safe_bound(tests: Sequence[Measurement], rng: np.random.Generator, prior: TrackPrior | None = None) -> float:
    """The 5 % quantile of the end of life, under the weak prior unless another is given."""
    now = tests[-1].progress
    drawn = GRID.posterior(GRID.from_history(prior or weak(tests[0], falling=True), tests), DRAWS, rng)
    end = stated_end(drawn, fraction=0.5, as_of=now, horizon=HORIZON, tests=tests)
    return float(weighted_quantiles(np.minimum(end.ends, HORIZON), end.weight, (0.05,))[0])


def simulated_starts(count: int, seed: int) -> Iterator[Start]:
    """Clutches that stay level, or run in by 3 to 12 %, before they wear evenly, faster and faster, or slower and slower:
    tested until wear begins at the latest."""
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        onset, share = rng.uniform(0.05, 0.7), rng.uniform(0.3, 1.0)
        rise = rng.uniform(0.03, 0.12) if index % 2 else 0.0
        course = _course(onset, rise, rng.uniform(0.1, 0.5) * onset, float(rng.choice([0.6, 1.0, 2.0])))
        tests, scatter = int(rng.integers(3, MOST_TESTS + 1)), rng.choice([0.001, 0.003, 0.01])
        at = np.linspace(0.0, share * onset, tests)
        values = 0.1 * np.array([course(x) for x in at.tolist()]) * (1.0 + scatter * rng.standard_normal(tests))
        yield "runs in" if rise else "level", sent(END * at, values), END


def _course(onset: float, rise: float, settling: float, power: float) -> Callable[[float], float]:
    """COF over the share of life, as a share of that when new; half of it at the end."""

    def course(x: float) -> float:
        run_in = 1.0 + rise * (1.0 - np.exp(-x / settling))
        return float(run_in - (0.5 + rise) * (max(x - onset, 0.0) / (1.0 - onset)) ** power)

    return course


def real_starts(count: int, seed: int) -> Iterator[Start]:
    """Real lives cut while they show no wear; none where their data are not there."""
    found: list[Start] = []
    for name, world in WORLDS.items() if FOLDER.is_dir() else ():
        for number, (_, tests, end) in enumerate(world()):
            fallen = [1.0 - test.value / tests[0].value > 0.5 * UNWORN for test in tests]
            unworn = fallen.index(True) if True in fallen else len(tests)
            if unworn >= 3:
                rng = np.random.default_rng([seed, number])
                found.append((name, tests[: int(rng.integers(3, min(unworn, MOST_TESTS) + 1))], end))
    rng = np.random.default_rng(seed)
    yield from (found[k] for k in sorted(rng.permutation(len(found))[:count].tolist()))
