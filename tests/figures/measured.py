"""Figures of measurements: loops of a reciprocating contact, friction after a step of speed, branches of sweeps."""

import numpy as np

from tests.figures.svg import Panel, Series, chart
from tests.real.lag import branches_of, loop_courses, micro_loops, step_fits, traction_branches


def loops() -> str:
    """Force over speed, the mean course of ten cycles, and the loops' areas by cycles with their deviation."""
    rows = micro_loops()
    middle = np.array([5.5 + 10 * number for number in range(len(rows))])
    courses = loop_courses()
    return chart(
        [
            Panel(
                title="force over speed",
                x_label="speed [mm/s]",
                y_label="friction [N]",
                series=[Series(x=v, y=force, name=f"cycles {name}") for name, v, force in (courses[0], courses[-1])],
            ),
            *(
                Panel(
                    title=title,
                    x_label="cycle",
                    y_label=unit,
                    series=[
                        Series(
                            x=middle,
                            y=np.array([row[value] for row in rows]),
                            deviation=np.array([row[deviation] for row in rows]),
                            points=True,
                        )
                    ],
                )
                for title, unit, value, deviation in (
                    ("area over speed (eq. 8)", "∮F dv [N mm/s]", "∮F dv [N mm/s]", "its deviation"),
                    ("work of a cycle", "∮F dx [mJ]", "∮F dx [mJ]", "deviation of that"),
                )
            ),
        ]
    )


def transient() -> str:
    """Friction after the step, and the attractor law fitted over windows of growing length."""
    fits = step_fits()
    longest = fits[-1]
    measured = Series(x=longest.time, y=longest.measured, name="measured", colour="#999999")
    panels = []
    for title, until in (("the first 20 s", 20.0), ("all 180 s", 180.0)):
        inside = longest.time <= until
        shown = [fit for fit in fits if fit.window <= until]
        panels.append(
            Panel(
                title=title,
                x_label="time after the step [s]",
                y_label="friction [-]",
                series=[
                    Series(x=measured.x[inside], y=measured.y[inside], name=measured.name, colour=measured.colour),
                    *(Series(x=fit.time, y=fit.fitted, name=f"one attractor, {fit.window:g} s") for fit in shown),
                ],
            )
        )
    return chart(panels)


def branches() -> str:
    """The mean up and down branches of all sweeps, and how far they lie apart by sweep."""
    grid, down, up = branches_of()
    rows = traction_branches()
    return chart(
        [
            Panel(
                title="mean of 200 sweeps",
                x_label="sliding speed [mm/s]",
                y_label="traction [-]",
                series=[Series(x=grid, y=down.mean(axis=0), name="down"), Series(x=grid, y=up.mean(axis=0), name="up")],
            ),
            Panel(
                title="up less down, by sweeps",
                x_label="sweep (fifths)",
                y_label="∮μ dv [mm/s]",
                zero=True,
                series=[
                    Series(
                        x=np.array([20.5 + 40 * number for number in range(len(rows))]),
                        y=np.array([row["∮μ dv [mm/s]"] for row in rows]),
                        deviation=np.array([row["its deviation"] for row in rows]),
                        points=True,
                    )
                ],
            ),
        ]
    )
