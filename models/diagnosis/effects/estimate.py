"""The estimated size of an effect."""

from dataclasses import dataclass
from math import erf, sqrt

#: Half the width of a normal's 90 % interval, in deviations.
HALF_WIDTH = 1.6448536269514722


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The amplitude of an effect in engineering units: its name, value, standard deviation and unit; `one_sided` where it
    cannot be negative; its 90 % interval and the probability of its sign where those are not the normal ones."""

    name: str
    value: float
    sd: float
    unit: str
    one_sided: bool = False
    stated_interval: tuple[float, float] | None = None
    stated_sign: float | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """The 90 % interval."""
        half = HALF_WIDTH * self.sd
        return self.stated_interval or (self.value - half, self.value + half)

    @property
    def sign_probability(self) -> float | None:
        """The probability that the sign is that of the value; None where nothing was estimated."""
        if self.value == 0.0 or not self.sd > 0.0:
            return None
        if self.stated_sign is not None:
            return self.stated_sign
        return 1.0 if self.one_sided else 0.5 * (1.0 + erf(abs(self.value) / self.sd / sqrt(2.0)))
