"""The size of an effect as it is reported."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The amplitude of an effect and its standard deviation, in engineering units."""

    name: str
    value: float
    sd: float
    unit: str
