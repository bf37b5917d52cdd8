"""Figures of simulated loops: their sign by the two laws of lag, and their area over a life (figs. 14, 16, 17)."""

import math
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.friction.stribeck import torque
from models.loops.lag_laws import attractor_torque, squeeze_film_torque
from models.loops.loops import Loop, evaluate_loops
from models.rig.sampled import DynamicTest, sampled_test
from models.rig.stationary import Sensor
from models.rig.truth import SimulatedClutch
from tests.figures.svg import COLOURS, Chart
from tests.real.lag import ATTRACTOR, FREQUENCY, film_time_at, loop_signs

SEED = 20131113
LIFE = (0, 250, 500, 1000, 2000, 3000, 4500, 6000, 8000, 10_000, 13_000)
AT_BAR = 5.0


def signs() -> str:
    """Torque off the stationary curve where it rises, by either law, and the loop's area at every pressure."""
    clutch = SimulatedClutch()
    fine = np.linspace(-10.0, 10.0, 20_001)
    turn = 2 * math.pi * FREQUENCY * fine
    v = clutch.geometry.mean_radius * 1000 * 2 * math.pi / 60 * (1 + np.sin(turn))
    curve = replace(clutch.parameters(4e5, 0.0), coulomb_ratio=1.0)
    chart = Chart(3)
    for title, course in (
        ("attractor: S rises, loop negative", attractor_torque(fine, v, curve, ATTRACTOR)),
        ("squeezed film: S rises, loop positive", squeeze_film_torque(fine, v, curve, film_time_at(4e5))),
    ):
        off, last = course - torque(v, curve), (fine >= 0) & (v > 0.2)
        chart.panel(title, "velocity [m/s], 4 bar", "M - S(v) [Nm]", zero=True)
        for name, branch in (("accelerating", np.cos(turn) > 0), ("decelerating", np.cos(turn) <= 0)):
            x, y = v[last & branch], off[last & branch]
            order = np.argsort(x, kind="stable")
            chart.line(x[order], y[order], name)
    rows = loop_signs()
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


def _loops(clutch: SimulatedClutch, cycles: int) -> list[Loop]:
    record = sampled_test(clutch, cycles, DynamicTest(), np.random.default_rng([SEED, cycles]), Sensor())
    return [loop for loop in evaluate_loops(record, clutch.geometry, None) if loop.area is not None]


def _at(loops: list[Loop], bar: float) -> Loop:
    return min(loops, key=lambda loop: abs(loop.pressure - 1e5 * bar))


def _areas(loops: list[Loop]) -> FloatArray:
    """Areas and their deviations [2, n]."""
    return np.array([(loop.area, loop.area_sd) for loop in loops], dtype=np.float64).T
