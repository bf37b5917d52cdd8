"""Loops and lag in the measured files, and the figure of trap 7: rows, and Markdown tables of them.

Nothing here is a wet clutch. The files show that the arithmetic of eq. 8 and of the attractor law runs on measurements,
and how far either describes them.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from models.arrays import FloatArray
from models.friction.stribeck import StribeckParameters
from models.loops.lag_laws import FILM_EXPONENT, attractor_torque, squeeze_film_torque
from models.loops.loop_area import area_of, clean_samples
from models.records.periods import Cycle, fit_cycle
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch
from tests.lab.measuring import show
from tests.lab.real.loaders import FOLDER, TRACTION_SWEEPS
from tests.models.loops.dynamic_records import attractor_area

MICRO_LOOPS = FOLDER / "micro_friction_loops" / "test_data_2.csv"
VELOCITY_STEP = FOLDER / "friction_velocity_steps" / "velstep3_TR2_exp013_sepiolite.csv"

#: Of the simulated loops: the test's sine (section 2.3.4), the attractor and the film time at 5 bar.
FREQUENCY, ATTRACTOR, FILM_TIME = 0.1, 200.0, 0.05

Row = dict[str, Any]


def film_time_at(pressure: float) -> float:
    """τ_1 [s] at a pressure [Pa]: that of one lining grows with the pressure's power 2n - 1 (`models.loops.lag_laws`)."""
    return float(FILM_TIME * (pressure / 5e5) ** (2 * FILM_EXPONENT - 1))


def loop_signs() -> list[Row]:
    """The figure "GMS loops are negative where the curve rises, positive with the squeeze film"; simulated.

    For the nominal simulated clutch when fresh, and one whose curve rises throughout: pressure [bar], whether S rises
    over most of the swing, the area [Nm m/s] by the attractor law, its closed form, and that with a squeezed film.
    """
    clutch = SimulatedClutch()
    fine = np.linspace(-10.0, 10.0, 40_001)
    swing = clutch.geometry.mean_radius * 1000 * 2 * math.pi / 60
    v = swing * (1 + np.sin(2 * math.pi * FREQUENCY * fine))
    turning = swing * 2 * math.pi * FREQUENCY * np.cos(2 * math.pi * FREQUENCY * fine)
    period = slice(20_000, None)
    rows = []
    for pressure in PROTOCOL_PRESSURES.tolist():
        nominal = clutch.parameters(pressure, 0.0)
        for name, curve in (("nominal", nominal), ("rising", replace(nominal, coulomb_ratio=1.0))):
            law = attractor_torque(fine, v, curve, ATTRACTOR)
            film = squeeze_film_torque(fine, v, curve, film_time_at(pressure))
            rows.append(
                {
                    "pressure [bar]": pressure / 1e5,
                    "curve": name,
                    "∮M dv, attractor": float(np.trapezoid(law[period], v[period])),
                    "-(1/C)∮SS'v̇²dt": attractor_area(v[20_000:-1], turning[20_000:-1], 1 / FREQUENCY, curve, ATTRACTOR),
                    "∮M dv, squeeze film": float(np.trapezoid(film[period], v[period])),
                }
            )
    return rows


def micro_loops() -> list[Row]:
    """The 50 cycles of 4 s, in tens: eq. 8 ∮F dv [N mm/s] and the work ∮F dx [mJ], with deviations.

    The motion's cycle is fitted to the position; the raw trapezoid sums over the same cycles are the witness. Friction
    is given against the motion: its sign is turned. The speed reverses, so no law of lag is fitted.
    """
    rows = []
    for name, t, x, f in _tens():
        place = fit_cycle(t, x)
        work, lag = (area_of(cycle, clean_samples(cycle, t, f)) for cycle in (place, _speed_of(place)))
        whole = (t >= place.start) & (t < place.stop)
        v = np.gradient(x, t)[whole]
        rows.append(
            {
                "cycles": name,
                "∮F dv [N mm/s]": lag.area,
                "its deviation": lag.area_sd,
                "∮F dx [mJ]": work.area,
                "deviation of that": work.area_sd,
                "∮F dv by trapezoids": float(np.trapezoid(f[whole], v)) / place.periods,
                "∮F dx by trapezoids": float(np.trapezoid(f[whole], x[whole])) / place.periods,
            }
        )
    return rows


def loop_courses() -> list[tuple[str, FloatArray, FloatArray]]:
    """The mean course of ten cycles: which, speed [200] mm/s and force [200] N over a turn, closed."""
    courses = []
    for name, t, x, f in _tens():
        place = fit_cycle(t, x)
        turn = np.linspace(0.0, 2 * math.pi, 201)
        part = np.digitize(np.mod(place.phase(t), 2 * math.pi), turn[1:-1])
        force = np.bincount(part, weights=f, minlength=200) / np.maximum(np.bincount(part, minlength=200), 1)
        middle = 0.5 * (turn[1:] + turn[:-1])
        speed = 2 * math.pi * place.frequency * place.gradient(middle)
        courses.append((name, np.append(speed, speed[0]), np.append(force, force[0])))
    return courses


def _tens() -> Iterator[tuple[str, FloatArray, FloatArray, FloatArray]]:
    """Ten cycles at a time: which, time [n] s, position [n] mm, force along the motion [n] N."""
    time, normal, position, friction = np.loadtxt(MICRO_LOOPS, delimiter=",", skiprows=1).T
    loaded = np.flatnonzero(normal > 0.9 * np.median(normal))
    rows_loaded = slice(int(loaded[0]), int(loaded[-1]) + 1)
    time, position, force = time[rows_loaded], position[rows_loaded], -friction[rows_loaded] / 1e6
    whole = fit_cycle(time, position)
    length = 1 / whole.frequency
    for first in range(0, whole.periods - 9, 10):
        inside = (time >= whole.start + first * length) & (time < whole.start + (first + 10) * length)
        yield f"{first + 1} to {first + 10}", time[inside], position[inside], force[inside]


def _speed_of(place: Cycle) -> Cycle:
    """The cycle of dx/dt from that of x."""
    order = 2 * math.pi * place.frequency * np.arange(1, place.cosine.size + 1)
    turn = np.block(
        [[np.zeros((order.size, order.size)), np.diag(order)], [-np.diag(order), np.zeros((order.size,) * 2)]]
    )
    return replace(
        place,
        mean=0.0,
        cosine=order * place.sine,
        sine=-order * place.cosine,
        covariance=turn @ place.covariance @ turn.T,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StepFit:
    """The attractor law on `window` s after the step: time, measured and fitted friction [n], C [1/s] with its deviation
    by white noise, the new level, the residual's deviation over the noise."""

    window: float
    time: FloatArray
    measured: FloatArray
    fitted: FloatArray
    attractor: float
    attractor_sd: float
    level: float
    misfit: float


def step_fits() -> list[StepFit]:
    """Friction after the step from 0.2 to 2 µm/s, fitted by the attractor law over windows of growing length.

    dμ/dt = C (1 - μ/S) with S the new level, fitted along with C [1/s] and the level before; if the law were right, C
    would not depend on the window and the misfit would be the noise (the deviation within a second before the step).
    """
    time, displacement, friction, _ = np.loadtxt(VELOCITY_STEP, delimiter=",", skiprows=1).T
    speed = (displacement[10:] - displacement[:-10]) / (time[10:] - time[:-10])
    onset = int(np.flatnonzero(speed > 1.0)[0])
    clock = time - time[onset]
    noise = float(np.std(np.diff(friction[onset - 500 : onset]))) / math.sqrt(2)
    return [_step_fit(clock, friction, noise, window) for window in (5.0, 20.0, 60.0, 180.0)]


def _step_fit(clock: FloatArray, friction: FloatArray, noise: float, window: float) -> StepFit:
    inside = (clock >= 0) & (clock <= window)
    t, measured = clock[inside], friction[inside]

    def law(x: FloatArray) -> FloatArray:
        level = StribeckParameters(
            static_torque=float(x[1]), coulomb_ratio=1.0, stribeck_velocity=1.0, viscous_coefficient=0.0
        )
        return attractor_torque(t, np.ones_like(t), level, math.exp(x[0]), start=float(x[2]))

    start = [math.log(0.05), float(measured[-1]), float(measured[0])]
    fit = least_squares(lambda x: law(x) - measured, start, x_scale=[1.0, 0.1, 0.1])
    sd = math.sqrt(np.linalg.inv(fit.jac.T @ fit.jac)[0, 0] * 2 * fit.cost / (t.size - 3))
    return StepFit(
        window=window,
        time=t,
        measured=measured,
        fitted=law(fit.x),
        attractor=math.exp(fit.x[0]),
        attractor_sd=math.exp(fit.x[0]) * sd,
        level=float(fit.x[1]),
        misfit=math.sqrt(2 * fit.cost / t.size) / noise,
    )


def velocity_step() -> list[Row]:
    return [
        {
            "window [s]": fit.window,
            "points": fit.time.size,
            "C [1/s]": fit.attractor,
            "± (white noise)": fit.attractor_sd,
            "S/C [s]": fit.level / fit.attractor,
            "new level": fit.level,
            "misfit over noise": fit.misfit,
        }
        for fit in step_fits()
    ]


def branches_of() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sliding speed [36] mm/s, and traction [sweeps, 36] while it falls and while it rises.

    Branches are laid over one another at equal sliding speed, 0.5 to 4 mm/s; v falls at first, then rises.
    """
    columns = np.genfromtxt(TRACTION_SWEEPS, delimiter=",", names=True, usecols=(0, 5, 7), dtype=None, encoding="utf-8")
    grid = np.linspace(0.5, 4.0, 36)
    found = []
    for _, group in itertools.groupby(columns, key=lambda row: int(row[0])):
        rows = np.array([(abs(row[1]), row[2]) for row in group])
        turn = int(np.argmin(rows[:, 0]))
        parts = [part[np.argsort(part[:, 0], kind="stable")] for part in (rows[: turn + 1], rows[turn:])]
        found.append([np.interp(grid, part[:, 0], part[:, 1]) for part in parts])
    both = np.array(found)
    return grid, both[:, 0], both[:, 1]


def traction_branches() -> list[Row]:
    """Sweeps in fifths: the mean difference of the up branch from the down branch [-], and ∮μ dv [mm/s], per sweep.

    The area is positive where traction is higher while the speed rises.
    """
    grid, down, up = branches_of()
    off = up - down
    scatter = np.diff(off, axis=1).std(axis=1) / math.sqrt(2 * grid.size)
    area = np.trapezoid(off, grid, axis=1)
    rows: list[Row] = []
    for part in np.array_split(np.arange(off.shape[0]), 5):
        count = math.sqrt(part.size)
        mean = off[part].mean(axis=1)
        rows.append(
            {
                "sweeps": f"{part[0] + 1} to {part[-1] + 1}",
                "up - down [-]": float(mean.mean()),
                "±": float(mean.std(ddof=1)) / count,
                "within a sweep ±": float(scatter[part].mean()),
                "∮μ dv [mm/s]": float(area[part].mean()),
                "its deviation": float(area[part].std(ddof=1)) / count,
            }
        )
    return rows


def main() -> None:
    for title, rows in (
        ("GMS loops are negative where the curve rises, positive with the squeeze film (simulated)", loop_signs()),
        ("Reciprocating contact: loops and areas", micro_loops()),
        ("Friction after a step of speed", velocity_step()),
        ("Traction sweeps: up against down", traction_branches()),
    ):
        show(f"### {title}", rows)


if __name__ == "__main__":
    main()
