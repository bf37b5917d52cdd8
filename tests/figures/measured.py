"""Figures of measurements: loops of a reciprocating contact, friction after a step of speed, branches of sweeps."""

import numpy as np

from models.arrays import FloatArray
from tests.figures.svg import Chart
from tests.real.lag import Row, branches_of, loop_courses, micro_loops, step_fits, traction_branches


def loops() -> str:
    """Force over speed, the mean course of ten cycles, and the loops' areas by cycles with their deviation."""
    rows, courses, chart = micro_loops(), loop_courses(), Chart(3)
    chart.panel("force over speed", "speed [mm/s]", "friction [N]")
    for name, speed, force in (courses[0], courses[-1]):
        chart.line(speed, force, f"cycles {name}")
    middle = 5.5 + 10.0 * np.arange(len(rows))
    chart.panel("area over speed (eq. 8)", "cycle", "∮F dv [N mm/s]")
    chart.points(middle, _column(rows, "∮F dv [N mm/s]"), _column(rows, "its deviation"))
    chart.panel("work of a cycle", "cycle", "∮F dx [mJ]")
    chart.points(middle, _column(rows, "∮F dx [mJ]"), _column(rows, "deviation of that"))
    return chart.drawn()


def transient() -> str:
    """Friction after the step, and the attractor law fitted over windows of growing length."""
    fits, chart = step_fits(), Chart(2)
    longest = fits[-1]
    for title, until in (("the first 20 s", 20.0), ("all 180 s", 180.0)):
        inside = longest.time <= until
        chart.panel(title, "time after the step [s]", "friction [-]")
        chart.line(longest.time[inside], longest.measured[inside], "measured", colour="#999999")
        for fit in fits:
            if fit.window <= until:
                chart.line(fit.time, fit.fitted, f"one attractor, {fit.window:g} s")
    return chart.drawn()


def branches() -> str:
    """The mean up and down branches of all sweeps, and how far they lie apart by sweep."""
    (grid, down, up), rows, chart = branches_of(), traction_branches(), Chart(2)
    chart.panel("mean of 200 sweeps", "sliding speed [mm/s]", "traction [-]")
    chart.line(grid, down.mean(axis=0), "down")
    chart.line(grid, up.mean(axis=0), "up")
    chart.panel("up less down, by sweeps", "sweep (fifths)", "∮μ dv [mm/s]", zero=True)
    chart.points(20.5 + 40.0 * np.arange(len(rows)), _column(rows, "∮μ dv [mm/s]"), _column(rows, "its deviation"))
    return chart.drawn()


def _column(rows: list[Row], name: str) -> FloatArray:
    return np.array([row[name] for row in rows])
