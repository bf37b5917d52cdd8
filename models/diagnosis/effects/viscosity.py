"""Oil viscosity over temperature after Walther and ASTM D341, from two measured points.

    log10 log10(ν + 0.7) = A - B log10 T,    ν in mm²/s (cSt), T in K

Valid from about 2 cSt upwards and from -40 to 150 °C for mineral and similar synthetic oils.

Source: ASTM D341-20, eq. 1; the two points are the clutch record's (40 °C and 100 °C).
"""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import Oil

_CST = 1e-6
_LOW, _HIGH = 273.15 + 40.0, 273.15 + 100.0


def viscosity(temperature: FloatArray, oil: Oil) -> FloatArray:
    """ν [n] m²/s at temperature [n] K > 0.

    >>> viscosity(np.array([353.15, 363.15]), Oil()).round(8).tolist()
    [1.49e-05, 1.163e-05]
    """
    at_40, at_100 = (np.log10(np.log10(point / _CST + 0.7)) for point in (oil.viscosity_40, oil.viscosity_100))
    slope = (at_40 - at_100) / (np.log10(_HIGH) - np.log10(_LOW))
    double_log = at_40 - slope * (np.log10(np.clip(temperature, 200.0, 600.0)) - np.log10(_LOW))
    return np.asarray(np.maximum(10.0 ** (10.0**double_log) - 0.7, 1e-3) * _CST, dtype=np.float64)


def log_viscosity_ratio(temperature: FloatArray, reference: float, oil: Oil) -> FloatArray:
    """ln ν(T)/ν(reference) [n]; 0 where the temperature [n] K was not measured (NaN)."""
    measured = np.where(np.isfinite(temperature), temperature, reference)
    return np.asarray(np.log(viscosity(measured, oil) / viscosity(np.array([reference]), oil)), dtype=np.float64)
