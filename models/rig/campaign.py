"""A whole simulated campaign in the rig's order (fig. 2): run-in, then duty blocks with a stationary test after each.

Run-in of 200 engagements before cycle 0, a stationary test at 0, then at 500, 1000, 2000, 3000, ... duty cycles, until
the true mean COF has fallen below `stop_fraction` of its initial value or `most_tests` tests are made. All of it is
simulated, and every run id says so. When a run was made is not known here; that is for whoever sends it.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, section 2.3.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from models.protocol import RPM
from models.rig.stationary import Sensor, stationary_test
from models.rig.truth import SimulatedClutch, draw
from models.runs import Plateaus

_CLUTCH, _TEST = 0, 1  # the streams of one seed: the clutch, and each test by its cycles


class RunKind(StrEnum):
    """What the simulated rig did."""

    RUN_IN = "run_in"
    DUTY_CYCLES = "duty_cycles"
    STATIONARY_STRIBECK = "stationary_stribeck"


@dataclass(frozen=True, slots=True, kw_only=True)
class DutyBlock:
    """Engagements in a row: how many, energy of each [J], initial speed [rad/s], maximum pressure [Pa]."""

    cycles: int
    energy_per_cycle: float
    initial_speed: float
    maximum_pressure: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRun:
    """One simulated run; `cycles` = duty cycles accumulated at its end. A test has plateaus, the rest a duty block."""

    run_id: str
    kind: RunKind
    cycles: int
    plateaus: Plateaus | None = None
    duty: DutyBlock | None = None

    def __post_init__(self) -> None:
        if not self.run_id.startswith("sim-"):
            raise ValueError(f"run_id of a simulated run must start with sim-, got {self.run_id}")
        is_test = self.kind is RunKind.STATIONARY_STRIBECK
        if (self.plateaus is not None) != is_test or (self.duty is None) != is_test:
            raise ValueError(
                f"a {self.kind} run must carry {'plateaus' if is_test else 'a duty block'} and nothing else"
            )


#: 1200 rpm and 2000 rpm, both to 8 bar (sections 2.3.1, 2.3.2). The energies go as ω² and are assumed: none is printed.
RUN_IN = DutyBlock(cycles=200, energy_per_cycle=6.5e3, initial_speed=1200 * RPM, maximum_pressure=8.0e5)
_DUTY_ENERGY, _DUTY_SPEED, _DUTY_PRESSURE = 18.0e3, 2000 * RPM, 8.0e5


def simulated_clutch(seed: int) -> SimulatedClutch:
    """The clutch of the campaign with this seed >= 0: the truth that `simulate(seed)` measures."""
    return draw(_generator(seed, _CLUTCH))


def simulate(
    seed: int,
    *,
    clutch: SimulatedClutch | None = None,
    sensor: Sensor | None = None,
    stop_fraction: float = 0.45,
    most_tests: int = 40,
) -> Iterator[SimulatedRun]:
    """The runs of one simulated campaign, in rig order, made as they are asked for. The same seed gives the same bits.

    `clutch` is `simulated_clutch(seed)` unless given. A test's noise depends on the seed and its cycles alone. Raises
    ValueError on a negative seed, stop_fraction outside (0, 1) or most_tests < 1.
    """
    if seed < 0:
        raise ValueError(f"seed must not be negative, got {seed}")
    if not 0 < stop_fraction < 1:
        raise ValueError(f"stop_fraction must lie between 0 and 1, got {stop_fraction}")
    if most_tests < 1:
        raise ValueError(f"most_tests must be at least 1, got {most_tests}")
    clutch = simulated_clutch(seed) if clutch is None else clutch
    return _runs(seed, clutch, Sensor() if sensor is None else sensor, stop_fraction, most_tests)


def _runs(
    seed: int, clutch: SimulatedClutch, sensor: Sensor, stop_fraction: float, most_tests: int
) -> Iterator[SimulatedRun]:
    yield SimulatedRun(run_id=f"sim-{seed}-run-in-00000", kind=RunKind.RUN_IN, cycles=0, duty=RUN_IN)
    stop = stop_fraction * clutch.mean_cof(0.0)
    before = 0
    for cycles in itertools.islice(cycles_of_tests(), most_tests):
        if cycles > before:
            yield _duty_run(seed, before, cycles)
        plateaus = stationary_test(clutch, cycles, _generator(seed, _TEST, cycles), sensor)
        run_id = f"sim-{seed}-stationary-{cycles:05d}"
        yield SimulatedRun(run_id=run_id, kind=RunKind.STATIONARY_STRIBECK, cycles=cycles, plateaus=plateaus)
        if clutch.mean_cof(cycles) < stop:
            return
        before = cycles


def _duty_run(seed: int, before: int, cycles: int) -> SimulatedRun:
    block = DutyBlock(
        cycles=cycles - before,
        energy_per_cycle=_DUTY_ENERGY,
        initial_speed=_DUTY_SPEED,
        maximum_pressure=_DUTY_PRESSURE,
    )
    return SimulatedRun(run_id=f"sim-{seed}-duty-{cycles:05d}", kind=RunKind.DUTY_CYCLES, cycles=cycles, duty=block)


def cycles_of_tests() -> Iterator[int]:
    """Duty cycles at which the rig makes its tests: 0, 500, 1000, 2000, 3000 and so on."""
    return itertools.chain((0, 500), itertools.count(1000, 1000))


def _generator(seed: int, *stream: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=stream))
