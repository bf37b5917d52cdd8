"""The clutch: geometry, the sliding velocity of eq. 1, and the step from torque to coefficient of friction and back.

Eq. 1 of the reference prints r_m = (d_i + d_o)/2. With diameters that is the mean *diameter*; the mean radius is
(d_i + d_o)/4, 58 mm for the 99/133 mm disc, and that is what is computed here, unless a better known value overrides it.

Source: Ompusunggu, Janssens, Sas, "Friction Behavior of a Wet Clutch Subjected to Accelerated Degradation",
ISRN Tribology 2013, 607279, section 2.2 and eq. 1.
"""

import math
from dataclasses import dataclass

from models.arrays import FloatArray, require_finite


@dataclass(frozen=True, slots=True, kw_only=True)
class Geometry:
    """The friction disc. Defaults are the reference's: 99/133 mm, one disc, two faces.

    Lengths in m. `pressure_factor` [-] scales line pressure to lining pressure (piston area, return spring, grooves).
    Raises ValueError where a length is not positive, the ring has no width or there is no face.
    """

    inner_diameter: float = 0.099
    outer_diameter: float = 0.133
    friction_faces: int = 2
    mean_radius_override: float | None = None
    pressure_factor: float = 1.0

    def __post_init__(self) -> None:
        require_finite(self, ("inner_diameter", "pressure_factor", "mean_radius_override"), positive=True)
        if not (math.isfinite(self.outer_diameter) and self.outer_diameter > self.inner_diameter):
            raise ValueError(
                f"outer_diameter must exceed inner_diameter {self.inner_diameter}, got {self.outer_diameter}"
            )
        if self.friction_faces < 1:
            raise ValueError(f"friction_faces must be at least 1, got {self.friction_faces}")

    @property
    def mean_radius(self) -> float:
        """r_m = (d_i + d_o)/4 [m] with diameters, or the override."""
        if self.mean_radius_override is not None:
            return self.mean_radius_override
        return (self.inner_diameter + self.outer_diameter) / 4

    @property
    def lining_area(self) -> float:
        """Gross lining area of one face, π/4 (d_o² - d_i²) [m²]."""
        return math.pi / 4 * (self.outer_diameter**2 - self.inner_diameter**2)

    def sliding_velocity(self, speed: FloatArray) -> FloatArray:
        """Eq. 1, v = ω r_m [m/s], from the shaft's speed ω [rad/s], shape kept, either sign."""
        return speed * self.mean_radius

    def torque_per_cof(self, pressure: float) -> float:
        """Torque of a unit COF [Nm]: faces · pressure · pressure_factor · lining area · mean radius; pressure > 0 [Pa]."""
        if not (math.isfinite(pressure) and pressure > 0):
            raise ValueError(f"pressure must be finite and positive, got {pressure}")
        return self.friction_faces * pressure * self.pressure_factor * self.lining_area * self.mean_radius

    def torque(self, cof: float, pressure: float) -> float:
        """Torque [Nm] from coefficient of friction [-] at line pressure [Pa]."""
        return cof * self.torque_per_cof(pressure)
