"""What a simulated campaign consists of: which tests beside the stationary one, and what ages the clutch.

The default is the quick one: plateaus, and duty blocks whose energies are assumed. `WHOLE` is all of fig. 2.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, section 2.3 and fig. 2.
"""

from dataclasses import dataclass
from enum import StrEnum

from models.rig.sampled import PROTOCOL, DynamicTest, RawTest

#: Dissipated energy [J] that ages by as much as one cycle, where energy does: what an engagement of the nominal clutch
#: dissipates over most of its life.
CYCLE_ENERGY = 8.0e3


class Ageing(StrEnum):
    """What drives eq. 6: duty cycles, or the energy dissipated in engagements and tests alike."""

    CYCLES = "cycles"
    ENERGY = "energy"


@dataclass(frozen=True, slots=True, kw_only=True)
class Programme:
    """`dynamic`: the dynamic test after each stationary one, None: none, and `further` ones, at other frequencies. `raw`:
    stationary tests as sampled records, None: as plateaus, at `pressures` [Pa]. `engagements`: integrate one a block, for
    its energy and its trace.

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


QUICK = Programme()
WHOLE = Programme(dynamic=DynamicTest(), engagements=True)
