"""`make bench`: what the common errands cost beside the least that they could, as ratios with intervals.

Each errand and its floor take turns within one run, so that a busy machine slows both. What runs in this process is taken in
time of the processor, a request by the clock on the wall. An interval is that of the median at 95 %, by order statistics.

    make bench    ARGS=--write puts the table into README.md
"""

import json
import sqlite3
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import binom

from models.clutch import Geometry
from models.friction.identification import fit_curves
from models.friction.stribeck import StribeckParameters, torque
from models.records.runs import Curve, curves_by_pressure
from models.rig import campaign
from models.tracking.filters.particle import Particle
from models.tracking.prior import weak
from service.changes.ingest_run import ingest
from service.jobs.background import keep_memory
from service.readers.read_file import read_file
from service.runs.json_run import read_run
from storage.engine.opening import open_database
from tests.lab.benchmarks.records import write_records
from tests.lab.measuring import ROOT, fill, table
from tests.lab.rivals.laws import Ours
from tests.lab.rivals.plain import Ibis
from tests.lab.scale.copies import AT, bodies, life, name
from tests.statistical.forecasts import LAWS, observed
from tests.support import served

ROUNDS = 25
#: Tests of the life that a further one is posted to.
TESTS = 100
CLUTCH = "bench"


@dataclass(frozen=True, slots=True, kw_only=True)
class Errand:
    """Something the product does, the least that does the like, and the clock that both are taken by."""

    what: str
    beside: str
    ours: Callable[[], object]
    floor: Callable[[], object]
    clock: Callable[[], float] = time.process_time
    rounds: int = ROUNDS

    def row(self) -> tuple[str, str, str, str]:
        """What and beside what, the medians of both in ms, and the median ratio with its interval."""
        self.ours(), self.floor()
        taken = [self._round(first=bool(number % 2)) for number in range(self.rounds)]
        ratios = sorted(ours / floor for ours, floor in taken)
        outer = int(binom.ppf(0.025, len(ratios), 0.5))
        ours, floor = (1e3 * statistics.median(column) for column in zip(*taken, strict=True))
        low, high = ratios[max(outer - 1, 0)], ratios[min(len(ratios) - outer, len(ratios) - 1)]
        return (
            self.what,
            self.beside,
            f"{ours:.3g} and {floor:.3g}",
            f"{statistics.median(ratios):.3g} [{low:.3g}, {high:.3g}]",
        )

    def _round(self, *, first: bool) -> tuple[float, float]:
        """Seconds of the errand and of its floor, the errand `first` or after it."""
        order = (self.ours, self.floor) if first else (self.floor, self.ours)
        times = [self.clock()]
        for work in order:
            work()
            times.append(self.clock())
        one, other = (after - before for before, after in pairwise(times))
        return (one, other) if first else (other, one)


@contextmanager
def request() -> Iterator[Errand]:
    """The remaining life of a clutch over HTTP, and a route that does nothing."""
    with served() as (_, http):
        http.post("/v1/clutches", json={"clutch_id": CLUTCH})
        for body in bodies(12):
            http.post(f"/v1/clutches/{CLUTCH}/runs", content=body, headers={"Content-Type": "application/json"})
        yield Errand(
            what="GET of a remaining life",
            beside="an empty route",
            ours=partial(http.get, f"/v1/clutches/{CLUTCH}/remaining-useful-life"),
            floor=partial(http.get, "/livez"),
            clock=time.perf_counter,
            rounds=8 * ROUNDS,
        )


@contextmanager
def post(folder: Path) -> Iterator[Errand]:
    """A stationary test fitted, tracked, judged and stored, and its JSON in one durable row."""
    runs = bodies(TESTS + ROUNDS + 1)
    address = f"sqlite:///{folder / 'life.db'}"
    life(address, runs[:TESTS])
    waiting, again = iter(runs[TESTS:]), iter(runs[TESTS:])
    with closing(open_database(address)) as database, closing(sqlite3.connect(folder / "floor.db")) as plain:
        plain.executescript("PRAGMA journal_mode = wal; PRAGMA synchronous = full; CREATE TABLE run (body TEXT)")

        def floor() -> None:
            with plain:
                plain.execute("INSERT INTO run VALUES (?)", (json.dumps(json.loads(next(again))),))

        yield Errand(
            what=f"POST of a test to a life of {TESTS}",
            beside="its JSON parsed and stored durably",
            ours=lambda: ingest(database, name(0), read_run(next(waiting)), received_at=AT),
            floor=floor,
        )


def reading(folder: Path) -> Errand:
    """A record of 1,400 s at 1 kHz out of a CSV file."""
    path = write_records(folder)["CSV"]
    return Errand(
        what="A CSV of 1.4 million rows read",
        beside="`numpy.loadtxt`",
        ours=lambda: read_file(path, filename=path.name),
        floor=lambda: np.loadtxt(path, delimiter=",", skiprows=1),
        rounds=7,
    )


def fitting() -> Errand:
    """Seven curves of 40 points, their global optimum, and one bounded least squares each."""
    plateaus = next(run.plateaus for run in campaign.simulate(1) if run.plateaus is not None)
    curves = curves_by_pressure(plateaus, Geometry())
    start, scale = np.array([20.0, 0.8, 3.0, 1.0]), np.array([20.0, 1.0, 3.0, 1.0])

    def local(curve: Curve) -> object:
        def residual(x: np.ndarray) -> np.ndarray:
            return torque(curve.velocity, StribeckParameters.from_array(np.maximum(x, 0.0))) - curve.torque

        return least_squares(residual, start, bounds=(0, np.inf), x_scale=scale)

    return Errand(
        what="Seven Stribeck curves fitted, globally",
        beside="scipy's `least_squares`, from one start",
        ours=lambda: fit_curves(curves),
        floor=lambda: [local(curve) for curve in curves],
    )


def forecasting() -> Errand:
    """A life of 25 tests, each taken in and followed by 1,000 draws of the end of life."""
    tests = observed(next(iter(LAWS.values())), np.random.default_rng(1), 10_000.0)
    prior = weak(tests[0], falling=True)

    def follow(start: Callable[[], Ours | Ibis]) -> None:
        method = start()
        for test in tests:
            method.update(test)
            method.sample()

    return Errand(
        what="25 updates of all courses, each with a forecast",
        beside="IBIS of eq. 6 in plain numpy",
        ours=lambda: follow(lambda: Ours(Particle(), prior, np.random.default_rng(1))),
        floor=lambda: follow(lambda: Ibis(prior, np.random.default_rng(1))),
    )


def main() -> None:
    keep_memory()  # as the service's workers do
    with TemporaryDirectory() as made, ExitStack() as stack:
        folder = Path(made)
        rows = [fitting().row(), forecasting().row(), reading(folder).row()]
        rows += [stack.enter_context(errand).row() for errand in (post(folder), request())]
    lines = "\n".join(table(["what", "beside", "ms, both", "times as long [95 %]"], rows))
    print(lines)
    if "--write" in sys.argv:
        fill(ROOT / "README.md", {"bench": lines})


if __name__ == "__main__":
    main()
