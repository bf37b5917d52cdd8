"""The estimated size of an effect."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The amplitude of an effect in engineering units: its name, value, standard deviation and unit."""

    name: str
    value: float
    sd: float
    unit: str
