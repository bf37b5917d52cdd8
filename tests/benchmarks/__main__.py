"""`make benchmark`: how long things take here, beside what a rival takes in the same run, as Markdown."""

import json
import platform
import sqlite3
import statistics
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import httpx2
import numpy as np
from scipy.optimize import Bounds, least_squares, minimize

from models.clutch import Geometry
from models.friction.identification import fit_curves
from models.friction.stribeck import StribeckParameters, gradient, torque
from models.records.runs import Curve, curves_by_pressure
from models.rig import campaign
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from service.run_files.simulated import simulated_body
from tests.benchmarks.pages import pages
from tests.benchmarks.records import records
from tests.support import serving


def milliseconds(
    work: Callable[[], object], repeats: int = 30, clock: Callable[[], float] = time.perf_counter
) -> float:
    """The median time of some work."""
    work()
    taken = []
    for _ in range(repeats):
        start = clock()
        work()
        taken.append(clock() - start)
    return 1e3 * statistics.median(taken)


def service() -> None:
    """A life of 60 tests posted over HTTP, run by run."""
    runs = campaign.simulate(1, stop_fraction=0.01, most_tests=60)
    bodies = [json.dumps(simulated_body(run)).encode() for run in runs if run.plateaus is not None]
    posts, headers = [], {"Content-Type": "application/json"}
    address = "/v1/clutches/bench"
    with (
        tempfile.TemporaryDirectory() as folder,
        serving(Path(folder) / "bench.db") as server,
        httpx2.Client(base_url=server.url, timeout=60) as http,
    ):
        http.post("/v1/clutches", json={"clutch_id": "bench"})
        for body in bodies:
            start = time.perf_counter()
            answer = http.post(f"{address}/runs", content=body, headers=headers)
            posts.append(1e3 * (time.perf_counter() - start))
            assert answer.status_code == 201
        rows = {
            "POST a stationary run (7 x 40), median of a life of 60": statistics.median(posts),
            "the same, the last ten": statistics.median(posts[-10:]),
            "the same, 95 % of them": statistics.quantiles(posts, n=20)[-1],
            "GET remaining-useful-life": milliseconds(lambda: http.get(f"{address}/remaining-useful-life"), 200),
            "GET livez, the floor of the transport": milliseconds(lambda: http.get("/livez"), 200),
            "GET remaining-useful-life?pressure_bar=5, cached": milliseconds(
                lambda: http.get(f"{address}/remaining-useful-life?pressure_bar=5"), 50
            ),
            "GET degradation, cached": milliseconds(lambda: http.get(f"{address}/degradation"), 20),
            "GET stribeck": milliseconds(lambda: http.get(f"{address}/stribeck"), 10),
        }
    print("## The service, over a socket\n\n| what | ms |\n|---|---|")
    for name, taken in rows.items():
        print(f"| {name} | {taken:.1f} |")


def curves() -> tuple[Curve, ...]:
    """A fresh simulated clutch's seven curves."""
    run = next(run for run in campaign.simulate(1) if run.plateaus is not None)
    assert run.plateaus is not None
    return curves_by_pressure(run.plateaus, Geometry())


def identification() -> None:
    """All pressures of a test at once, beside the reference's algorithm and a bounded least squares, a curve each."""
    found = curves()
    start = np.array([20.0, 0.8, 3.0, 1.0])
    scale = np.array([20.0, 1.0, 3.0, 1.0])

    def residual(
        x: np.ndarray[tuple[int], np.dtype[np.float64]], curve: Curve
    ) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return torque(curve.velocity, StribeckParameters.from_array(np.maximum(x, 0.0))) - curve.torque

    def trust(curve: Curve) -> object:
        def cost(x: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
            return 0.5 * float(np.sum(residual(x, curve) ** 2))

        def slope(x: np.ndarray[tuple[int], np.dtype[np.float64]]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
            at = StribeckParameters.from_array(np.maximum(x, 0.0))
            return gradient(curve.velocity, at).T @ residual(x, curve)

        return minimize(cost, start, jac=slope, method="trust-constr", bounds=Bounds(np.zeros(4), np.full(4, np.inf)))

    def bounded(curve: Curve) -> object:
        return least_squares(residual, start, args=(curve,), bounds=(0, np.inf), x_scale=scale)

    ours = milliseconds(lambda: fit_curves(found))
    rows = {
        "`fit_curves`, global": ours,
        "scipy `least_squares`, bounded, one start": milliseconds(lambda: [bounded(each) for each in found], 5),
        "scipy `trust-constr` with gradients, one start": milliseconds(lambda: [trust(each) for each in found], 1),
    }
    print("\n## Seven curves of 40 points fitted\n\n| what | ms | times ours |\n|---|---|---|")
    for name, taken in rows.items():
        print(f"| {name} | {taken:.1f} | {taken / ours:.1f} |")


def tracking() -> None:
    """One more measurement on the way to 20 and to 60, and the last ten of them; in time of the processor alone."""
    law = campaign.simulated_clutch(1)
    rng = np.random.default_rng(1)
    print("\n## One measurement more, and the prediction's draws\n")
    print("| filter | tests | update, mean, ms | the last ten, ms | 1,000 draws, ms |\n|---|---|---|---|---|")
    for count in (20, 60):
        zeta = np.linspace(0.0, 12_000.0, count)
        level = np.array([law.mean_cof(each) for each in zeta])
        seen = [
            Measurement(
                progress=float(z),
                value=float(y * (1 + 0.003 * rng.standard_normal())),
                variance=float((0.001 * y) ** 2),
            )
            for z, y in zip(zeta, level, strict=True)
        ]
        for tracker in (Grid(), Particle(), Ukf()):
            state = tracker.start(weak(seen[0], falling=True))
            updates = []
            for each in seen:
                start = time.process_time()
                state = tracker.update(state, each, rng)  # type: ignore[arg-type]
                updates.append(1e3 * (time.process_time() - start))
            draw = partial(tracker.posterior, state, 1000, rng)  # type: ignore[arg-type]
            every, last = statistics.mean(updates), statistics.mean(updates[-10:])
            print(
                f"| {tracker.name} | {count} | {every:.2f} | {last:.2f} | {milliseconds(draw, 10, time.process_time):.2f} |"
            )


if __name__ == "__main__":
    print(f"Python {platform.python_version()}, numpy {np.__version__}, SQLite {sqlite3.sqlite_version}\n")
    service()
    identification()
    tracking()
    records()
    pages()
