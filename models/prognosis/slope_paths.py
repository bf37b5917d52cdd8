"""The slope dμ/dv along a life, from the joint tracks of the four Stribeck parameters of one pressure.

The slope's own course is no eq. 6: it rises a little, passes through 0 and falls steeply, so that a track of the fitted
slopes alone sees shudder far too late. Each parameter follows its eq. 6; drawn jointly (`from_parameters.parameter_draws`)
they give the slope at any ζ by eq. 3.
"""

import numpy as np

from models.arrays import FloatArray
from models.friction.stribeck import StribeckParameters, slope
from models.prognosis.from_parameters import PressureLevel, parameter_draws


def slope_paths(level: PressureLevel, velocity: float, progress: FloatArray, rng: np.random.Generator) -> FloatArray:
    """dμ/dv [s/m] at velocity > 0 [m/s] and progress ζ [k] >= 0 of n equal draws; [k, n].

    `level` holds at least FEWEST_TESTS tests at different progress. Raises ValueError where velocity is not positive.
    """
    if not velocity > 0.0:
        raise ValueError(f"velocity must be positive, got {velocity}")
    draws = parameter_draws(level, rng)
    values = np.maximum(np.stack([track.values(progress) for track in draws]), 0.0)
    return np.asarray(slope(np.array(velocity), StribeckParameters.from_array(values)) / level.torque_per_cof)
