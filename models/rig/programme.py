"""What a simulated campaign consists of: which tests beside the stationary one, and what ages the clutch.

The default is the quick one: plateaus, and duty blocks whose energies are assumed. `WHOLE` is all of fig. 2.
"""

from dataclasses import dataclass, replace
from enum import StrEnum

from models.rig.sampled import PROTOCOL, DynamicTest, RawTest
from models.rig.stationary import OIL_TEMPERATURE

#: Dissipated energy [J] that ages by as much as one cycle, where energy does: what an engagement of the nominal clutch
#: dissipates over most of its life.
CYCLE_ENERGY = 8.0e3


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedTest:
    """A test that a diagnosis advises: stationary at `pressures` [Pa] and `speeds` [rad/s] in their order, or, with a
    `frequency` [Hz], dynamic with so many `periods` a pressure between the lowest and the highest speed; the oil kept at
    `oil` [K], `repeats` times over, at `cycles` since new."""

    pressures: tuple[float, ...]
    speeds: tuple[float, ...]
    cycles: int
    frequency: float | None = None
    periods: int = 1
    oil: float = OIL_TEMPERATURE
    repeats: int = 1

    def dynamic(self) -> DynamicTest:
        """The planned test as a dynamic test."""
        low, high = min(self.speeds), max(self.speeds)
        swing = DynamicTest(frequency=0.1 if self.frequency is None else self.frequency, pressures=self.pressures)
        middle, duration = 0.5 * (low + high), self.periods / swing.frequency
        return replace(swing, offset=middle, amplitude=min(middle, 0.5 * (high - low)), duration=duration)


class Ageing(StrEnum):
    """The quantity that drives eq. 6: duty cycles, or the energy dissipated in engagements and tests alike."""

    CYCLES = "cycles"
    ENERGY = "energy"


@dataclass(frozen=True, slots=True, kw_only=True)
class RigProgramme:
    """The tests and the ageing of a simulated campaign. `dynamic`: the dynamic test after each stationary one, None:
    none, and `further` ones, at other frequencies. `raw`: stationary tests as sampled records, None: as plateaus, at
    `pressures` [Pa]. `engagements`: integrate one a block, for its energy and its trace.

    Raises ValueError where energy is to age the clutch and no engagement gives it.
    """

    dynamic: DynamicTest | None = None
    further: tuple[DynamicTest, ...] = ()
    raw: RawTest | None = None
    pressures: tuple[float, ...] = PROTOCOL
    engagements: bool = False
    ageing: Ageing = Ageing.CYCLES

    def __post_init__(self) -> None:
        if self.ageing is Ageing.ENERGY and not self.engagements:
            raise ValueError("ageing by energy needs engagements, got engagements=False")


QUICK = RigProgramme()
WHOLE = RigProgramme(dynamic=DynamicTest(), engagements=True)
