"""Priors of the pooled fit: weak, scaled by the data, and rows of the least-squares problem like any other.

½ |R θ - m|²,     one row for each parameter, and one for each law whose two shares are expected to drift alike
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.baseline.criteria import USUAL_CURVATURE
from models.diagnosis.baseline.laws import (
    ATTRACTOR,
    BLOCK,
    DRIFT,
    FALL,
    KAPPA,
    OPEN_DRAG,
    Frame,
)
from models.diagnosis.criteria import ALIKE_SD, DRAG_SD
from models.diagnosis.design.design import Design


@dataclass(frozen=True, slots=True, kw_only=True)
class Priors:
    """Rows of prior on θ: (combination θ - mean)/sd, `rows` [q, θ.size] already divided by sd, `means` [q] too; `free`
    [θ.size] which entries are fitted at all."""

    rows: FloatArray
    means: FloatArray
    free: NDArray[np.bool_]


def priors_of(design: Design, start: FloatArray, frame: Frame) -> Priors:
    """Weak priors around scales of the data; what the campaign cannot determine at all is held fixed."""
    size = start.size
    level = design.usual_torque
    fastest = 2.0 * frame.reference_velocity
    sds, means = np.full(size, np.nan), start.copy()
    spreads = {0: 10 * level, 1: 3.0, 2: 3 * fastest, 3: 10 * level}
    for k, spread in spreads.items():
        block = k * BLOCK
        sds[block : block + BLOCK] = [spread, spread, 1.5, 1.5, 1.5, 0.7]
        means[block + 2 : block + BLOCK] = [0.0, 0.0, np.log(0.5 * design.facts.life), np.log(0.8)]
    sds[FALL], means[FALL] = (0.7, 1.2), (np.log(0.6 * frame.span), np.log(USUAL_CURVATURE))
    sds[DRIFT:ATTRACTOR], means[DRIFT:ATTRACTOR] = (0.6, 0.4, 0.3), 0.0
    # friction may follow at once: one wide prior, and a step of deviation 1 from pressure to pressure
    sds[KAPPA], means[KAPPA] = 1.0, 0.0
    sds[KAPPA.start], means[KAPPA.start] = 3.0, np.log(12 * level)
    sds[OPEN_DRAG], means[OPEN_DRAG] = DRAG_SD * level, 0.0
    rows = np.diag(1 / sds)
    nodes = np.arange(size)[KAPPA]
    rows[nodes[1:], nodes[:-1]] = -1.0
    alike = np.zeros((4, size))
    for k in range(4):
        alike[k, k * BLOCK + 2], alike[k, k * BLOCK + 3] = 1 / ALIKE_SD, -1 / ALIKE_SD
    return Priors(
        rows=np.concatenate([rows, alike]),
        means=np.concatenate([means / sds, np.zeros(4)]),
        free=_free(design, size),
    )


def _free(design: Design, size: int) -> NDArray[np.bool_]:
    closed = design.closed
    states, levels = np.unique(design.rows.cycles[closed]).size, design.levels.size
    loop_states = np.unique(design.rows.cycles[design.plateaus :][closed[design.plateaus :]]).size
    free = np.ones(size, dtype=np.bool_)
    for k in range(4):
        block = k * BLOCK
        free[block + 1] = levels > 1
        free[block + 2 : block + 4] = states > 1, states > 1 and levels > 1
        free[block + 4 : block + 6] = states > 2
    free[FALL] = levels > 2, levels > 3
    free[DRIFT:ATTRACTOR] = loop_states > 1, loop_states > 2, loop_states > 1 and levels > 1
    free[OPEN_DRAG] = not closed.all()
    return free
