"""A whole simulated campaign in the rig's order (section 2.3, fig. 2): run-in, then duty blocks with the tests after each.

Run-in of 200 engagements before cycle 0, tests at 0, then at 500, 1000, 2000, 3000, ... duty cycles, until the true mean
COF has fallen below `stop_fraction` of its initial value or `most_tests` stationary tests are made. The tests are those of
a `RigProgramme`. All of it is simulated, and every run id says so. Runs have no time of day: the sender adds it.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from models.engagements.simulation import Drive, engage
from models.friction.speed_protocol import RPM
from models.records.runs import Record
from models.rig.programme import CYCLE_ENERGY, QUICK, Ageing, PlannedTest, RigProgramme
from models.rig.sampled import DynamicTest, engagement_record, sampled_test
from models.rig.simulated_runs import DutyBlock, RunKind, SimulatedRun
from models.rig.stationary import Sensor, stationary_test
from models.rig.truth import SimulatedClutch, draw

#: The streams of one seed: the clutch, by cycles the stationary test, the dynamic test and the engagement, and by number
#: the tests of plans.
_CLUTCH, _TEST, _DYNAMIC, _ENGAGEMENT, _PLANNED = range(5)

#: 1200 rpm and 2000 rpm, both to 8 bar (sections 2.3.1, 2.3.2). The energies go as ω² and are assumed, none is printed:
#: they stand where no engagement is integrated.
RUN_IN = DutyBlock(cycles=200, energy_per_cycle=6.5e3, initial_speed=1200 * RPM, maximum_pressure=8.0e5)
_LIFE_TEST = DutyBlock(cycles=1, energy_per_cycle=18.0e3, initial_speed=2000 * RPM, maximum_pressure=8.0e5)


def simulated_clutch(seed: int) -> SimulatedClutch:
    """The clutch of the campaign with this seed >= 0: the truth that `simulate(seed)` measures."""
    return draw(_generator(seed, _CLUTCH))


def simulate(
    seed: int,
    *,
    clutch: SimulatedClutch | None = None,
    sensor: Sensor | None = None,
    programme: RigProgramme = QUICK,
    stop_fraction: float = 0.45,
    most_tests: int = 40,
) -> Iterator[SimulatedRun]:
    """The runs of one simulated campaign, in rig order, computed as they are consumed. The same seed gives the same bits.

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
    rig = _Rig(seed=seed, clutch=clutch, sensor=Sensor() if sensor is None else sensor, programme=programme)
    return rig.runs(stop_fraction, most_tests)


def planned(
    seed: int,
    tests: Iterable[PlannedTest],
    *,
    clutch: SimulatedClutch,
    sensor: Sensor,
    ageing: Ageing,
    cycles: int,
    wear: float,
    made: int = 0,
) -> Iterator[SimulatedRun]:
    """Simulated runs of a plan's tests on a clutch that a campaign has brought to `cycles` and `wear`, with the duty
    cycles up to each. `made` is the number of planned tests before, which distinguishes their noise and their names."""
    rig = _Rig(seed=seed, clutch=clutch, sensor=sensor, programme=RigProgramme(engagements=True, ageing=ageing))
    for test in tests:
        if test.cycles > cycles:
            block = rig.duty_run(cycles, test.cycles, wear)
            yield block
            cycles, wear = test.cycles, block.wear
        for _ in range(test.repeats):
            made += 1
            run = rig.planned_run(test, cycles, wear, made)
            yield run
            wear = run.wear


def end_of_life(course: Iterable[tuple[float, float]], clutch: SimulatedClutch, fraction: float = 0.5) -> float | None:
    """Duty cycles at which a simulated clutch truly came to `fraction` of its mean COF; None: not in this campaign.

    `course`: wear and cycles at the end of each of its runs, in their order; between two, wear goes with the cycles.
    """
    wear, cycles = np.array([(0.0, 0.0), *course]).T
    worn = clutch.end_of_life(fraction)
    return None if worn is None or worn > wear[-1] else float(np.interp(worn, wear, cycles))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rig:
    """One clutch on the simulated rig, with its seed, sensor and programme."""

    seed: int
    clutch: SimulatedClutch
    sensor: Sensor
    programme: RigProgramme

    def runs(self, stop_fraction: float, most_tests: int) -> Iterator[SimulatedRun]:
        """The runs of a campaign in the order of fig. 2."""
        duty, record = self._engaged(RUN_IN, 0, 0.0)
        run_id = f"sim-{self.seed}-run-in-00000"
        yield SimulatedRun(run_id=run_id, kind=RunKind.RUN_IN, cycles=0, duty=duty, record=record)
        stop = stop_fraction * self.clutch.mean_cof(0.0)
        before, wear = 0, 0.0
        for cycles in itertools.islice(cycles_of_tests(), most_tests):
            if cycles > before:
                block = self.duty_run(before, cycles, wear)
                yield block
                wear = block.wear
            failed = self.clutch.mean_cof(wear) < stop
            for test in self._tests(cycles, wear):
                yield test
                wear = test.wear
            if failed:
                return
            before = cycles

    def duty_run(self, before: int, cycles: int, wear: float) -> SimulatedRun:
        """The block of engagements from `before` to `cycles`."""
        duty, record = self._engaged(replace(_LIFE_TEST, cycles=cycles - before), cycles, wear)
        run_id = f"sim-{self.seed}-duty-{cycles:05d}"
        run = SimulatedRun(run_id=run_id, kind=RunKind.DUTY_CYCLES, cycles=cycles, duty=duty, record=record)
        if self.programme.ageing is Ageing.CYCLES:
            return replace(run, wear=wear + duty.cycles)
        return self._aged(run, wear)

    def _engaged(self, block: DutyBlock, cycles: int, wear: float) -> tuple[DutyBlock, Record | None]:
        """The block with the energy of one simulated engagement of the clutch at the block's start, and the record of
        that engagement."""
        if not self.programme.engagements:
            return block, None
        drive = Drive(speed=block.initial_speed)
        trace = engage(self.clutch.capacity(wear), self.clutch.geometry.mean_radius, drive=drive)
        record = engagement_record(trace, _generator(self.seed, _ENGAGEMENT, cycles), self.sensor)
        return replace(block, energy_per_cycle=trace.energy), record

    def _tests(self, cycles: int, wear: float) -> Iterator[SimulatedRun]:
        """The stationary test, and the dynamic one where there is one."""
        rng, raw = _generator(self.seed, _TEST, cycles), self.programme.raw
        pressures = np.array(self.programme.pressures)
        test = SimulatedRun(
            run_id=f"sim-{self.seed}-stationary-{cycles:05d}",
            kind=RunKind.STATIONARY_STRIBECK,
            cycles=cycles,
            plateaus=None if raw else stationary_test(self.clutch, wear, rng, self.sensor, pressures),
            record=sampled_test(self.clutch, wear, raw, rng, self.sensor) if raw else None,
        )
        test = self._aged(test, wear)
        yield test
        wear = test.wear
        first = () if self.programme.dynamic is None else (self.programme.dynamic,)
        for number, dynamic in enumerate((*first, *self.programme.further)):
            loops = self._dynamic_run(cycles, wear, dynamic, number)
            yield loops
            wear = loops.wear

    def _dynamic_run(self, cycles: int, wear: float, test: DynamicTest, number: int) -> SimulatedRun:
        """The dynamic test of that number at a state; tests after the first have noise and a name of their own."""
        rng = _generator(self.seed, _DYNAMIC, cycles, *([number] if number else []))
        run = SimulatedRun(
            run_id=f"sim-{self.seed}-dynamic-{cycles:05d}" + (f"-{test.frequency:g}hz" if number else ""),
            kind=RunKind.DYNAMIC_STRIBECK,
            cycles=cycles,
            record=sampled_test(self.clutch, wear, test, rng, self.sensor),
        )
        return self._aged(run, wear)

    def planned_run(self, test: PlannedTest, cycles: int, wear: float, number: int) -> SimulatedRun:
        """A plan's test of that number, made at `cycles` at least: a clutch does not grow younger."""
        rng = _generator(self.seed, _PLANNED, number)
        name = f"sim-{self.seed}-planned-{number}-{cycles:05d}"
        if test.frequency is not None:
            record = sampled_test(self.clutch, wear, test.dynamic(), rng, self.sensor, test.oil)
            run = SimulatedRun(run_id=name, kind=RunKind.DYNAMIC_STRIBECK, cycles=cycles, record=record)
        else:
            pressures, speeds = np.array(test.pressures), np.array(test.speeds)
            plateaus = stationary_test(self.clutch, wear, rng, self.sensor, pressures, speeds, test.oil)
            run = SimulatedRun(run_id=name, kind=RunKind.STATIONARY_STRIBECK, cycles=cycles, plateaus=plateaus)
        return self._aged(run, wear)

    def _aged(self, run: SimulatedRun, wear: float) -> SimulatedRun:
        """The run with its wear at its end; where cycles age the clutch a test does not."""
        by_energy = self.programme.ageing is Ageing.ENERGY
        return replace(run, wear=wear + run.dissipated() / CYCLE_ENERGY if by_energy else wear)


def cycles_of_tests() -> Iterator[int]:
    """Duty cycles at which the rig makes its tests: 0, 500, 1000, 2000, 3000 and so on."""
    return itertools.chain((0, 500), itertools.count(1000, 1000))


def _generator(seed: int, *stream: int) -> np.random.Generator:
    """The random generator of one stream of a seed, independent of the seed's other streams."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=stream))
