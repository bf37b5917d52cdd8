"""The runs of a simulated campaign, as values: what kind, after how many cycles, and what was measured."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from models.records.runs import Plateaus, Record
from models.rig.stationary import PLATEAU_DURATION


class RunKind(StrEnum):
    """The kinds of run that the simulated rig makes."""

    RUN_IN = "run_in"
    DUTY_CYCLES = "duty_cycles"
    STATIONARY_STRIBECK = "stationary_stribeck"
    DYNAMIC_STRIBECK = "dynamic_stribeck"


@dataclass(frozen=True, slots=True, kw_only=True)
class DutyBlock:
    """A row of equal engagements: their number, energy of each [J], initial speed [rad/s], maximum pressure [Pa]."""

    cycles: int
    energy_per_cycle: float
    initial_speed: float
    maximum_pressure: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRun:
    """One simulated run; `cycles` = duty cycles accumulated at its end.

    A stationary test has plateaus, or a record where it is raw; a dynamic test has a record; the rest a duty block and
    perhaps the record of its first engagement. `wear` is the truth, unknown to a rig: the ζ of eq. 6 at the run's end.
    """

    run_id: str
    kind: RunKind
    cycles: int
    plateaus: Plateaus | None = None
    record: Record | None = None
    duty: DutyBlock | None = None
    wear: float = 0.0

    def __post_init__(self) -> None:
        if not self.run_id.startswith("sim-"):
            raise ValueError(f"run_id of a simulated run must start with sim-, got {self.run_id}")
        has = (self.plateaus is not None, self.record is not None, self.duty is not None)
        rule, allowed = _CARRIED[self.kind]
        if has not in allowed:
            raise ValueError(f"a {self.kind} run must carry {rule} and nothing else")

    def dissipated(self) -> float:
        """Energy [J] turned into heat: of a test by its own channels, of a duty block by its engagements."""
        if self.duty is not None:
            return self.duty.cycles * self.duty.energy_per_cycle
        if self.plateaus is not None:
            return PLATEAU_DURATION * float(self.plateaus.torque @ self.plateaus.speed)
        if self.record is None:
            return 0.0
        return float(np.trapezoid(self.record.torque * self.record.speed, self.record.time))


_BLOCK = "a duty block, perhaps a record,", ((False, False, True), (False, True, True))
#: What a run of each kind carries: in words, and which of plateaus, record and duty block.
_CARRIED = {
    RunKind.RUN_IN: _BLOCK,
    RunKind.DUTY_CYCLES: _BLOCK,
    RunKind.STATIONARY_STRIBECK: ("plateaus or a record", ((True, False, False), (False, True, False))),
    RunKind.DYNAMIC_STRIBECK: ("a record", ((False, True, False),)),
}
