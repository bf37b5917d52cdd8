"""`make figures`: the figures of the documentation, into docs/figures; those of measurements where the files are there."""

import math
import sys
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.friction.stribeck import torque
from models.loops.lag_laws import attractor_torque, squeeze_film_torque
from models.loops.loops import FrictionLoop, evaluate_loops
from models.rig.sampled import DynamicTest, sampled_test
from models.rig.stationary import Sensor
from models.rig.truth import SimulatedClutch
from tests.lab.figures.svg import COLOURS, Chart
from tests.lab.measuring import ROOT
from tests.lab.real import lag
from tests.lab.real.loaders import FOLDER

SEED = 20131113
LIFE = (0, 250, 500, 1000, 2000, 3000, 4500, 6000, 8000, 10_000, 13_000)
AT_BAR = 5.0


def signs() -> str:
    """Torque off the stationary curve where it rises, by either law, and the loop's area at every pressure."""
    clutch = SimulatedClutch()
    fine = np.linspace(-10.0, 10.0, 20_001)
    turn = 2 * math.pi * lag.FREQUENCY * fine
    v = clutch.geometry.mean_radius * 1000 * 2 * math.pi / 60 * (1 + np.sin(turn))
    curve = replace(clutch.parameters(4e5, 0.0), coulomb_ratio=1.0)
    chart = Chart(3)
    for title, course in (
        ("attractor: S rises, loop negative", attractor_torque(fine, v, curve, lag.ATTRACTOR)),
        ("squeezed film: S rises, loop positive", squeeze_film_torque(fine, v, curve, lag.film_time_at(4e5))),
    ):
        off, last = course - torque(v, curve), (fine >= 0) & (v > 0.2)
        chart.panel(title, "velocity [m/s], 4 bar", "M - S(v) [Nm]", zero=True)
        for name, branch in (("accelerating", np.cos(turn) > 0), ("decelerating", np.cos(turn) <= 0)):
            x, y = v[last & branch], off[last & branch]
            order = np.argsort(x, kind="stable")
            chart.line(x[order], y[order], name)
    rows = lag.loop_signs()
    chart.panel("area of a loop", "pressure [bar]", "∮M dv [Nm m/s]", zero=True)
    for law, name, colour in (
        ("∮M dv, attractor", "attractor", COLOURS[0]),
        ("∮M dv, squeeze film", "squeezed film", COLOURS[1]),
    ):
        for kind, dashed in (("rising", False), ("nominal", True)):
            x, y = np.array([(row["pressure [bar]"], row[law]) for row in rows if row["curve"] == kind]).T
            chart.line(x, y, f"{name}, {kind} curve", dashed=dashed, colour=colour)
    return chart.drawn()


def life() -> str:
    """Figs. 14, 16 and 17 of the nominal simulated clutch: areas with their deviation from noisy dynamic tests."""
    clutch, chart = SimulatedClutch(), Chart(3)
    found = {cycles: _loops(clutch, cycles) for cycles in LIFE}
    over = np.array(LIFE, dtype=np.float64)
    chart.panel("new, by pressure (fig. 14)", "pressure [bar]", "loop area [Nm m/s]", zero=True)
    chart.points(np.array([loop.pressure / 1e5 for loop in found[0]]), *_areas(found[0]))
    chart.panel(f"at {AT_BAR:g} bar, over life (fig. 16)", "duty cycles", "loop area [Nm m/s]")
    chart.points(over, *_areas([_at(found[cycles], AT_BAR) for cycles in LIFE]))
    chart.panel("by cycles and pressure (fig. 17)", "duty cycles", "loop area [Nm m/s]")
    for bar in (loop.pressure / 1e5 for loop in found[0]):
        chart.line(over, _areas([_at(found[cycles], bar) for cycles in LIFE])[0], f"{bar:g} bar")
    return chart.drawn()


def _loops(clutch: SimulatedClutch, cycles: int) -> list[FrictionLoop]:
    record = sampled_test(clutch, cycles, DynamicTest(), np.random.default_rng([SEED, cycles]), Sensor())
    return [loop for loop in evaluate_loops(record, clutch.geometry, None) if loop.area is not None]


def _at(loops: list[FrictionLoop], bar: float) -> FrictionLoop:
    return min(loops, key=lambda loop: abs(loop.pressure - 1e5 * bar))


def _areas(loops: list[FrictionLoop]) -> FloatArray:
    """Areas and their deviations [2, n]."""
    return np.array([(loop.area, loop.area_sd) for loop in loops], dtype=np.float64).T


def measured_loops() -> str:
    """Force over speed, the mean course of ten cycles, and the loops' areas by cycles with their deviation."""
    rows, courses, chart = lag.micro_loops(), lag.loop_courses(), Chart(3)
    chart.panel("force over speed", "speed [mm/s]", "friction [N]")
    for name, speed, force in (courses[0], courses[-1]):
        chart.line(speed, force, f"cycles {name}")
    middle = 5.5 + 10.0 * np.arange(len(rows))
    chart.panel("area over speed (eq. 8)", "cycle", "∮F dv [N mm/s]")
    chart.points(middle, _column(rows, "∮F dv [N mm/s]"), _column(rows, "its deviation"))
    chart.panel("work of a cycle", "cycle", "∮F dx [mJ]")
    chart.points(middle, _column(rows, "∮F dx [mJ]"), _column(rows, "deviation of that"))
    return chart.drawn()


def measured_transient() -> str:
    """Friction after the step, and the attractor law fitted over windows of growing length."""
    fits, chart = lag.step_fits(), Chart(2)
    longest = fits[-1]
    for title, until in (("the first 20 s", 20.0), ("all 180 s", 180.0)):
        inside = longest.time <= until
        chart.panel(title, "time after the step [s]", "friction [-]")
        chart.line(longest.time[inside], longest.measured[inside], "measured", colour="#999999")
        for fit in fits:
            if fit.window <= until:
                chart.line(fit.time, fit.fitted, f"one attractor, {fit.window:g} s")
    return chart.drawn()


def measured_branches() -> str:
    """The mean up and down branches of all sweeps, and how far they lie apart by sweep."""
    (grid, down, up), rows, chart = lag.branches_of(), lag.traction_branches(), Chart(2)
    chart.panel("mean of 200 sweeps", "sliding speed [mm/s]", "traction [-]")
    chart.line(grid, down.mean(axis=0), "down")
    chart.line(grid, up.mean(axis=0), "up")
    chart.panel("up less down, by sweeps", "sweep (fifths)", "∮μ dv [mm/s]", zero=True)
    chart.points(20.5 + 40.0 * np.arange(len(rows)), _column(rows, "∮μ dv [mm/s]"), _column(rows, "its deviation"))
    return chart.drawn()


def _column(rows: list[lag.Row], name: str) -> FloatArray:
    return np.array([row[name] for row in rows])


def main() -> None:
    made = {"loop-signs": signs, "loop-area-over-life": life}
    if FOLDER.is_dir():
        made |= {
            "measured-loops": measured_loops,
            "measured-transient": measured_transient,
            "measured-branches": measured_branches,
        }
    else:
        print(f"the real measurements are not at {FOLDER}: their figures stay as they are", file=sys.stderr)
    for name, draw in made.items():
        path = ROOT / "docs" / "figures" / f"{name}.svg"
        path.write_text(draw(), encoding="utf-8")
        print(f"{path.name}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
