"""The estimated size of an effect."""

from dataclasses import dataclass
from math import erf, sqrt


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The amplitude of an effect in engineering units: its name, value, standard deviation and unit; `one_sided` where it
    cannot be negative."""

    name: str
    value: float
    sd: float
    unit: str
    one_sided: bool = False

    @property
    def sign_probability(self) -> float | None:
        """The probability that the sign is that of the value; None where nothing was estimated."""
        if self.value == 0.0 or not self.sd > 0.0:
            return None
        return 1.0 if self.one_sided else 0.5 * (1.0 + erf(abs(self.value) / self.sd / sqrt(2.0)))
