"""`make benchmark`: how long things take here, beside what a rival takes in the same run, as Markdown."""

import platform
import sqlite3
import statistics
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.optimize import Bounds, least_squares, minimize

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.identification import fit_curves
from models.friction.stribeck import StribeckParameters, gradient, torque
from models.records.runs import Curve, curves_by_pressure
from models.rig import campaign
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.prior import weak
from tests.lab.benchmarks.formats import formats
from tests.lab.benchmarks.pages import pages, start_page
from tests.lab.benchmarks.records import records
from tests.lab.measuring import show
from tests.lab.scale.copies import bodies
from tests.models.tracking.tracked_series import sent
from tests.support import served


def milliseconds(
    work: Callable[[], object], repeats: int = 30, clock: Callable[[], float] = time.perf_counter
) -> float:
    work()
    taken = []
    for _ in range(repeats):
        start = clock()
        work()
        taken.append(clock() - start)
    return 1e3 * statistics.median(taken)


def service() -> None:
    """A life of 60 tests posted over HTTP, run by run."""
    posts, headers = [], {"Content-Type": "application/json"}
    address = "/v1/clutches/bench"
    with served() as (_, http):
        http.post("/v1/clutches", json={"clutch_id": "bench"})
        for body in bodies(60):
            start = time.perf_counter()
            answer = http.post(f"{address}/runs", content=body, headers=headers)
            posts.append(1e3 * (time.perf_counter() - start))
            assert answer.status_code == 201
        rows = {
            "POST a stationary run (7 x 40), median of a life of 60": statistics.median(posts),
            "the same, the last ten": statistics.median(posts[-10:]),
            "the same, 95 % of them": statistics.quantiles(posts, n=20)[-1],
        }
        life = f"{address}/remaining-useful-life"
        known = {"If-None-Match": http.get(life).headers["etag"]}
        asked = {
            "GET remaining-useful-life": (partial(http.get, life), 200),
            "GET remaining-useful-life, 304": (partial(http.get, life, headers=known), 200),
            "GET livez, the floor of the transport": (partial(http.get, "/livez"), 200),
            "GET remaining-useful-life?pressure_bar=5, cached": (partial(http.get, f"{life}?pressure_bar=5"), 50),
            "GET degradation, cached": (partial(http.get, f"{address}/degradation"), 20),
            "GET stribeck": (partial(http.get, f"{address}/stribeck"), 10),
        }
        rows |= {name: milliseconds(ask, repeats) for name, (ask, repeats) in asked.items()}
    show("## The service, over a socket", ({"what": name, "ms": f"{taken:.1f}"} for name, taken in rows.items()))


def identification() -> None:
    """All pressures of a fresh clutch's test at once, beside the reference's algorithm and a bounded least squares, a curve
    each."""
    plateaus = next(run.plateaus for run in campaign.simulate(1) if run.plateaus is not None)
    found = curves_by_pressure(plateaus, Geometry())
    start, scale = np.array([20.0, 0.8, 3.0, 1.0]), np.array([20.0, 1.0, 3.0, 1.0])

    def residual(x: FloatArray, curve: Curve) -> FloatArray:
        return torque(curve.velocity, StribeckParameters.from_array(np.maximum(x, 0.0))) - curve.torque

    def cost(x: FloatArray, curve: Curve) -> float:
        return 0.5 * float(np.sum(residual(x, curve) ** 2))

    def slope(x: FloatArray, curve: Curve) -> FloatArray:
        return gradient(curve.velocity, StribeckParameters.from_array(np.maximum(x, 0.0))).T @ residual(x, curve)

    def trust(curve: Curve) -> object:
        bounds = Bounds(np.zeros(4), np.full(4, np.inf))
        return minimize(cost, start, args=(curve,), jac=slope, method="trust-constr", bounds=bounds)

    def bounded(curve: Curve) -> object:
        return least_squares(residual, start, args=(curve,), bounds=(0, np.inf), x_scale=scale)

    ours = milliseconds(lambda: fit_curves(found))
    rows = {
        "`fit_curves`, global": ours,
        "scipy `least_squares`, bounded, one start": milliseconds(lambda: [bounded(each) for each in found], 5),
        "scipy `trust-constr` with gradients, one start": milliseconds(lambda: [trust(each) for each in found], 1),
    }
    show(
        "## Seven curves of 40 points fitted",
        ({"what": name, "ms": f"{taken:.1f}", "times ours": f"{taken / ours:.1f}"} for name, taken in rows.items()),
    )


def tracking() -> None:
    """One more measurement on the way to 20 and to 60, and the last ten of them; in time of the processor alone."""
    law = campaign.simulated_clutch(1)
    rng, rows = np.random.default_rng(1), []
    for count in (20, 60):
        zeta = np.linspace(0.0, 12_000.0, count)
        level = np.array([law.mean_cof(each) for each in zeta])
        seen = sent(zeta, level * (1 + 0.003 * rng.standard_normal(count)), (0.001 * level) ** 2)
        for tracker in (Grid(), Particle(), Ukf()):
            state = tracker.start(weak(seen[0], falling=True))
            updates = []
            for each in seen:
                start = time.process_time()
                state = tracker.update(state, each, rng)
                updates.append(1e3 * (time.process_time() - start))
            draw = partial(tracker.posterior, state, 1000, rng)
            taken = {
                "update, mean, ms": statistics.mean(updates),
                "the last ten, ms": statistics.mean(updates[-10:]),
                "1,000 draws, ms": milliseconds(draw, 10, time.process_time),
            }
            rows.append({"filter": tracker.name, "tests": count} | {what: f"{ms:.2f}" for what, ms in taken.items()})
    show("## One measurement more, and the prediction's draws", rows)


if __name__ == "__main__":
    print(f"Python {platform.python_version()}, numpy {np.__version__}, SQLite {sqlite3.sqlite_version}\n")
    service()
    identification()
    tracking()
    records()
    formats()
    pages()
    start_page()
