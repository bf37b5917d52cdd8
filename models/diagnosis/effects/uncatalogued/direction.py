"""The direction in which pressure or speed was last changed before a plateau: what a hysteresis depends on."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.points import IntArray
from models.diagnosis.effects.uncatalogued.criteria import HELD_SHARE, LEAST_EACH_WAY


def last_direction(values: FloatArray, previous: IntArray) -> FloatArray:
    """[P] 1 where a value was last raised before a plateau, -1 where it was lowered, 0 where that is unknown. `previous` [P]
    is the plateau before it, -1 where there is none; plateaus of a run follow each other."""
    has_previous = previous >= 0
    change = np.where(has_previous, values - values[np.maximum(previous, 0)], 0.0)
    changed = ~has_previous | (np.abs(change) > HELD_SHARE * np.abs(values))
    last_change = np.maximum.accumulate(np.where(changed, np.arange(values.size), 0))
    return np.asarray(np.sign(change)[last_change], dtype=np.float64)


def direction_if_both(scene: Scene, values: FloatArray) -> FloatArray:
    """`last_direction` [P] of values at the scene's points, or 0 where nearly all changes go one way."""
    direction = last_direction(values, scene.points.previous)
    least = LEAST_EACH_WAY * np.count_nonzero(scene.points.steady)
    each_way = min(np.count_nonzero(direction > 0), np.count_nonzero(direction < 0))
    return direction if each_way >= max(least, 1.0) else np.zeros_like(direction)
