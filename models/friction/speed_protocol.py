"""The speeds over which a mean is taken, so that a missing or repeated plateau does not shift it.

The reference steps 20 to 1970 rpm by 50 rpm at every pressure (section 2.3.3). A mean over the fitted curve at these
speeds is a property of the clutch; a mean over the rows of one test is not.
"""

import math

import numpy as np

from models.arrays import FloatArray

RPM = 2 * math.pi / 60
REFERENCE_SPEEDS: FloatArray = np.linspace(20.0, 1970.0, 40) * RPM


def protocol_speeds(lowest: float, highest: float, tolerance: float = 105.0 * RPM) -> FloatArray:
    """The protocol's speeds [40] rad/s for a test whose speeds run from `lowest` to `highest` rad/s.

    The reference's 20 to 1970 rpm where the test's ends lie within `tolerance` of its ends, two steps and 5 rpm of scatter
    (so that a lost first or last plateau changes nothing); else as many equal steps over the test's own range. Raises
    ValueError unless 0 <= lowest < highest.
    """
    if not (0 <= lowest < highest and math.isfinite(highest)):
        raise ValueError(f"lowest and highest must be finite and 0 <= lowest < highest, got {lowest} and {highest}")
    near = abs(lowest - REFERENCE_SPEEDS[0]) <= tolerance and abs(highest - REFERENCE_SPEEDS[-1]) <= tolerance
    return REFERENCE_SPEEDS if near else np.linspace(lowest, highest, REFERENCE_SPEEDS.size)
