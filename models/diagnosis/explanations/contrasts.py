"""Smooth contrasts: shapes of structure that any unknown cause might have, each on the axes on which it lives.

They are relative to the predicted torque (structure in friction scales with it): ripples over speed, which loops show with
their lag, bumps and kinks in speed, cosines over the clock and the torque, waves over a loop's phase, and single states.
What other smooth laws of speed, pressure and life would add is the law's discrepancy (`baseline.law_discrepancy`). Axes:
`design.design`.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.baseline.prediction import Prediction
from models.diagnosis.design.design import CLOCK, CYCLES, PHASE, SPEED, TEMPERATURE, TORQUE, Design

#: Waves of a nonlinear sensor over its range; ripples over speed (an encoder's, a mount's).
TORQUE_WAVES, SPEED_WAVES = 20, range(4, 17)


def contrasts_of(design: Design, prediction: Prediction) -> tuple[FloatArray, list[str]]:
    """All contrasts that the design can show: columns [N, m] Nm at the rows, and the axis [m] on which each depends."""
    rows = design.rows
    torque = rows.engaged * np.abs(prediction.torque)  # with the clutch open there is no friction to be wrong
    steady = rows.steady.astype(np.float64)
    speed, pressure = _unit(rows.velocity, design.closed), _unit(rows.pressure, design.closed)
    life = _rank(rows.cycles)
    states, levels = design.facts.states.size, design.levels.size
    lives, presses = min(states - 1, 3), min(levels - 1, 2)
    columns = list(_ripples(design, prediction).T)
    axes = [SPEED] * len(columns)

    def add(axis: str, column: FloatArray) -> None:
        if float((column * column).sum()) > 0:
            columns.append(column * torque)
            axes.append(axis)

    for centre in np.linspace(0.06, 0.94, 13):
        for width in (0.05, 0.11):
            add(SPEED, _bump(speed, centre, width))
        add(SPEED, (speed - centre) * _bump(speed, centre, 0.08))
        if lives:
            add(SPEED, _bump(speed, centre, 0.1) * _cosine(1, life))
    for z in range(1, min(states - 1, 12) + 1):
        add(CYCLES, _cosine(z, life))
        add(CYCLES, _cosine(z, life) * steady)
    for state in np.unique(rows.cycles)[:12]:
        in_state = rows.cycles == state
        add(CYCLES, in_state.astype(np.float64))
        for s in (1, 2):
            add(CYCLES, in_state * _cosine(s, speed) * steady)
    reading = _unit(torque, design.closed)
    for t in range(1, TORQUE_WAVES + 1):
        add(TORQUE, _cosine(t, reading))
    clock = rows.clock / max(float(rows.clock[rows.steady & design.closed].max(initial=1.0)), 1e-9)
    for t in range(1, 7):
        add(CLOCK, _cosine(t, clock) * steady)
        if states > 1:
            add(CLOCK, _cosine(t, clock) * steady * _cosine(1, life))
    looping = np.where(rows.steady, 0.0, 1.0)
    for h in range(1, 7):
        for wave in (np.cos(h * rows.phase), np.sin(h * rows.phase)):
            add(PHASE, wave * looping)
            if h > 4:
                continue
            for p in range(1, presses + 1):
                add(PHASE, wave * looping * _cosine(p, pressure))
            for z in range(1, min(lives, 2) + 1):
                add(PHASE, wave * looping * _cosine(z, life))
    add(PHASE, looping)
    rising = np.sign(rows.acceleration) * looping
    for s in range(4):
        add(PHASE, rising * _cosine(s, speed))
    for way in (1.0, -1.0):
        one_way = looping * (way * rows.acceleration > 0)
        for centre, width in product(np.linspace(0.06, 0.94, 11), (0.06, 0.12)):
            add(PHASE, _bump(speed, centre, width) * one_way)
    if np.isfinite(rows.temperature).any():
        warm = np.where(np.isfinite(rows.temperature), rows.temperature - design.facts.reference_temperature, 0.0) / 3.0
        for s in range(4):
            add(TEMPERATURE, warm * _cosine(s, speed))
        add(TEMPERATURE, warm**2)
        add(TEMPERATURE, warm * _cosine(1, pressure))
        if lives:
            add(TEMPERATURE, warm * _cosine(1, life))
    return np.stack(columns, axis=1) if columns else np.zeros((design.torque.size, 0)), axes


def _ripples(design: Design, prediction: Prediction) -> FloatArray:
    """Contrasts [N, m] Nm of friction that ripples over speed, with the loops' lag."""
    points, friction = design.points, np.abs(prediction.scene.curve)
    even = _unit(points.velocity, points.engaged > 0)
    shapes = np.stack([wave(np.pi * s * even) for s in SPEED_WAVES for wave in (np.cos, np.sin)], axis=1)
    shapes = shapes[:, np.abs(shapes).max(axis=0) > 1e-6]  # at even speeds a sine may be 0 at each
    return prediction.change_at_rows(design, friction[:, None] * shapes, before_lag=True)


def _bump(unit: FloatArray, centre: float, width: float) -> FloatArray:
    """A Gaussian bump [n] over positions [n]."""
    return np.asarray(np.exp(-0.5 * ((unit - centre) / width) ** 2), dtype=np.float64)


def _cosine(order: int, unit: FloatArray) -> FloatArray:
    """cos(π k x) [n] at positions x [n], of order k."""
    return np.cos(np.pi * order * unit)


def _unit(values: FloatArray, among: NDArray[np.bool_]) -> FloatArray:
    """Values [n] scaled to 0 ... 1 by the range of the selected ones (`among`), clipped to it."""
    low, high = float(values[among].min()), float(values[among].max())
    return (np.clip(values, low, high) - low) / max(high - low, 1e-300)


def _rank(values: FloatArray) -> FloatArray:
    """Values [n] scaled to 0 ... 1 by the rank of the distinct values: states crowd early in life."""
    distinct = np.unique(values)
    return np.searchsorted(distinct, values) / max(distinct.size - 1, 1)
