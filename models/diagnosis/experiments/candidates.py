"""Tests that a rig could make next, and the runs that they would add to a campaign.

A trial is made after the last state unless it goes on to later ones. Its torques are not known beforehand and not needed:
what it would show depends on where it measures.

As a protocol that a rig can run a trial is its steps in order, with what is to be set and how long each takes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.constants import zero_Celsius

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun, EventKind, MaintenanceEvent, StationaryRun, TestRun
from models.records.criteria import UNLOADED
from models.records.pressure_levels import levels_of
from models.records.runs import Plateaus, Record

#: Frequency [Hz] of a dynamic test, and its samples a period.
_FREQUENCY, _SAMPLES = 0.3, 200
#: Light pressures of loops, as multiples: far enough apart to be distinguished.
LIGHT = (1.0, 1.5, 2.0)
#: Sweeps over the speeds in a run with the clutch open: there is one pressure only, none.
PASSES = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """A test that the rig could make next: its settings and its description for the engineer."""

    text: str  # for the engineer, empty where it is only made as a part of others
    brief: str = ""  # the same in few words, where it has more than fit into a sentence
    loops: bool = False  # a dynamic test, else a stationary one
    temperature: float | None = None  # of the oil [K], None: as usual
    falling: bool = False  # the speeds of a stationary test
    # times the usual pressures [-] (of loops at LIGHT times that of the lowest one, where it is not 1; 0: the clutch is
    # open, one sweep of the speeds PASSES times over, or ten periods, as one run)
    pressure: float = 1.0
    times: int = 1  # each as the first
    later: int = 0  # how many usual distances between states it lies ahead
    energy: float = 1.0  # times the usual energy of an engagement up to there [-]
    rest: float = 0.0  # a pause before the first test and every second one after it [s]
    parts: tuple[str, ...] = ()  # keys of the trials that it consists of, and nothing else


_LOOPS = "dynamic test at 0.3 Hz, ten periods a pressure, 60 samples a second, at the usual speeds"
_LIGHT_SWEEP = "stationary test at a quarter of the usual pressures"
_LIGHT = "at a quarter, three eighths and a half of the lowest usual pressure"
_LIGHT_TESTS = f"{_LIGHT_SWEEP}, and {_LOOPS}, {_LIGHT}"
_ALL_LOADS = f"{_LIGHT_SWEEP}, and {_LOOPS}, at the usual pressures and then {_LIGHT}"
_OPEN_SWEEP = "stationary test with the clutch open (no pressure), at the usual speeds, five times over"
_OPEN_TESTS = f"{_OPEN_SWEEP}, and dynamic test at 0.3 Hz with the clutch open, ten periods"
#: The same in few words.
_LIGHT_BRIEF = "stationary and dynamic tests at low pressures"
_ALL_BRIEF = "stationary and dynamic tests at usual and low pressures"
_SIXTY, _HUNDRED = zero_Celsius + 60.0, zero_Celsius + 100.0

TRIALS: dict[str, Trial] = {
    "loops_0.3hz": Trial(
        text=f"{_LOOPS}, at the usual pressures", brief="dynamic test at 0.3 Hz at the usual pressures", loops=True
    ),
    "light_loops": Trial(text="", loops=True, pressure=0.25),
    "light_loops_60c": Trial(text="", loops=True, pressure=0.25, temperature=_SIXTY),
    "light_tests": Trial(text=_LIGHT_TESTS, brief=_LIGHT_BRIEF, parts=("light_sweep", "light_loops")),
    "light_tests_60c": Trial(
        text=f"{_LIGHT_TESTS}, with the oil at 60 °C",
        brief=f"{_LIGHT_BRIEF}, the dynamic ones with the oil at 60 °C",
        parts=("light_sweep", "light_loops_60c"),
    ),
    "warm_and_cool": Trial(
        text=f"{_LIGHT_TESTS}, first with the oil as usual, then at 60 °C",
        brief=f"{_LIGHT_BRIEF}, the dynamic ones also with the oil at 60 °C",
        parts=("light_sweep", "light_loops", "light_loops_60c"),
    ),
    "all_loads": Trial(text=_ALL_LOADS, brief=_ALL_BRIEF, parts=("light_sweep", "loops_0.3hz", "light_loops")),
    "all_loads_and_60c": Trial(
        text=f"{_LIGHT_SWEEP}, and {_LOOPS}: at the usual pressures, then {_LIGHT}, then there once more with the oil "
        "at 60 °C",
        brief=f"{_ALL_BRIEF}, some with the oil at 60 °C",
        parts=("light_sweep", "loops_0.3hz", "light_loops", "light_loops_60c"),
    ),
    "open_sweep": Trial(text=_OPEN_SWEEP, pressure=0.0),
    "open_loops": Trial(text="", loops=True, pressure=0.0),
    "open_clutch": Trial(
        text=_OPEN_TESTS,
        brief="stationary and dynamic tests with the clutch open",
        parts=("open_sweep", "open_loops"),
    ),
    "open_clutch_and_light": Trial(
        text=f"{_OPEN_TESTS}; then {_LIGHT_TESTS}",
        brief="stationary and dynamic tests with the clutch open and at low pressures",
        parts=("open_sweep", "open_loops", "light_sweep", "light_loops"),
    ),
    "all_loads_and_open": Trial(
        text=f"{_ALL_LOADS}; then {_OPEN_TESTS}",
        brief=f"{_ALL_BRIEF}, and with the clutch open",
        parts=("light_sweep", "loops_0.3hz", "light_loops", "open_sweep", "open_loops"),
    ),
    "sweep_60c": Trial(text="stationary test with the oil at 60 °C", temperature=_SIXTY),
    "sweeps_60c": Trial(text="stationary test with the oil at 60 °C, three times", temperature=_SIXTY, times=3),
    "sweep_100c": Trial(text="stationary test with the oil at 100 °C", temperature=_HUNDRED),
    "falling_speeds": Trial(
        text="stationary test with the speeds falling instead of rising, three times", falling=True, times=3
    ),
    "light_sweep": Trial(text=_LIGHT_SWEEP, pressure=0.25),
    "light_sweeps": Trial(text=f"{_LIGHT_SWEEP}, five times", pressure=0.25, times=5),
    "repeats": Trial(text="the stationary test again at once, five times", times=5),
    "more_states": Trial(text="three more stationary tests, each after the usual cycles", later=3),
    "rests": Trial(
        text="three more stationary tests, each after the usual cycles; rest two days before the first and third",
        later=3,
        rest=48 * 3600.0,
    ),
    **{
        f"{name}_energy": Trial(
            text=f"two more stationary tests, each after the usual cycles at {name} the energy per engagement",
            later=2,
            energy=energy,
        )
        for name, energy in (("half", 0.5), ("twice", 2.0))
    },
}


def runs_of(key: str) -> float:
    """The work of a trial, in equivalent runs: pressures that were not tried before are as much as two more (none at
    all is not), another oil temperature (hours of settling, and all changes that oil changes) as ten, a state of use as
    three, unusual engagements as four, a pause as one."""
    trial = TRIALS[key]
    if trial.parts:
        return sum(runs_of(part) for part in trial.parts)
    run_cost = 3.0 * trial.later if trial.later else float(trial.times)
    run_cost += 2.0 * (trial.pressure not in {0.0, 1.0}) + 4.0 * (trial.energy != 1.0) + 1.0 * (trial.rest > 0)
    return run_cost + 10.0 * (trial.temperature is not None)


def with_trial(campaign: Campaign, key: str) -> Campaign | None:
    """The campaign with the trial's runs appended (torques 0), one of each group of equal repeats; None where the
    campaign has no run to pattern the trial on."""
    trial = TRIALS[key]
    if trial.parts:
        extended: Campaign | None = campaign
        for part in trial.parts:
            extended = None if extended is None else with_trial(extended, part)
        return extended
    states = np.unique([run.cycles for run in campaign.tests])
    if states.size == 0 or (trial.later and states.size < 2):
        return None
    last = float(states[-1])
    if trial.loops:
        swung = _usual([(run, run.record) for run in campaign.dynamic], trial)
        return None if swung is None else replace(campaign, dynamic=(*campaign.dynamic, _loops(swung, trial, last)))
    pattern = _usual([(run, run.plateaus) for run in campaign.stationary], trial)
    if pattern is None:
        return None
    # the usual distance of two states late in life
    step = float(np.median(np.diff(states[min(states.size // 2, states.size - 2) :]))) if trial.later else 0.0
    ahead = [last + step * (k + 1) for k in range(trial.later)] or [last]
    rested = [trial.rest * float(k % 2 == 0) for k in range(len(ahead))]
    tests = tuple(
        _sweep(pattern, trial, cycles, k, sum(rested[: k + 1]))  # in the order in which they are made
        for k, cycles in enumerate(ahead)
    )
    added = replace(campaign, stationary=(*campaign.stationary, *tests))
    if trial.later:
        energies = [run.energy for run in campaign.duty if run.energy is not None]
        energy = trial.energy * float(np.median(energies)) if energies else None
        duty = (DutyRun(cycles=cycles, engagements=step, energy=energy) for cycles in ahead)
        added = replace(added, duty=(*campaign.duty, *duty))
    rests = tuple(
        MaintenanceEvent(
            cycles=test.cycles, event=EventKind.REST, moment=None if test.moment is None else test.moment - pause
        )
        for test, pause in zip(tests, rested, strict=True)
        if pause
    )
    return replace(added, maintenance=(*campaign.maintenance, *rests))


def _usual(runs: Sequence[tuple[TestRun, Plateaus | Record]], trial: Trial) -> TestRun | None:
    """The last run under the usual pressures, excluding runs that a trial at light pressures or none has added; None
    where the trial's share of its lowest pressure would leave the clutch open."""
    highest = max((float(table.pressure.max()) for _, table in runs), default=0.0)
    usual = [pattern for pattern in runs if max(0.75 * highest, UNLOADED) <= float(pattern[1].pressure.max())]
    if not usual:
        return None
    run, table = usual[-1]
    lowest = trial.pressure * float(table.pressure[table.pressure >= UNLOADED].min())
    return run if trial.pressure == 0.0 or lowest >= UNLOADED else None


def _sweep(pattern: StationaryRun, trial: Trial, cycles: float, number: int, rested: float) -> StationaryRun:
    """The trial's stationary test of that number, patterned on a run, after so many seconds of pauses."""
    table = pattern.plateaus
    levels = levels_of(table.pressure)
    rows = np.arange(table.torque.size)
    if trial.falling:
        rows = np.lexsort((-table.speed, levels))
    if trial.pressure == 0.0:
        closed = np.unique(levels[levels >= UNLOADED])
        rows = np.tile(rows[levels == closed[closed.size // 2]], PASSES)
    oil = table.oil_temperature
    if trial.temperature is not None:
        oil = np.full(rows.size, trial.temperature)
    duration = criteria.PLATEAU_DURATION * rows.size * (number + 1) + rested
    moment = None if pattern.moment is None else pattern.moment + duration
    return StationaryRun(
        run_id=f"trial-{number}",
        cycles=cycles,
        plateaus=Plateaus(
            pressure=trial.pressure * table.pressure[rows],
            speed=table.speed[rows],
            torque=np.zeros(rows.size),
            oil_temperature=oil if oil is None or trial.temperature is not None else oil[rows],
        ),
        moment=moment,
    )


def _loops(pattern: DynamicRun, trial: Trial, cycles: float) -> DynamicRun:
    """The trial's dynamic test: a run's speeds and its pressures, or a share of them, at the trial's frequency."""
    record = pattern.record
    levels = np.unique(levels_of(record.pressure[:: max(1, record.pressure.size // 5000)]))
    levels = levels[levels >= UNLOADED]
    if trial.pressure != 1.0:
        levels = trial.pressure * float(levels[0]) * np.array(LIGHT if trial.pressure > 0.0 else LIGHT[:1])
    count = _SAMPLES * 10 + 1
    step = 1.0 / (_FREQUENCY * _SAMPLES)
    phase = 2 * np.pi * np.arange(count) / _SAMPLES
    slowest, fastest = np.quantile(record.speed, (0.01, 0.99))  # spikes are no speeds
    speed = np.tile(slowest + (fastest - slowest) * (1 - np.cos(phase)) / 2, levels.size)
    pressure = np.repeat(levels, count)
    temperature = None
    if record.oil_temperature is not None:
        usual = float(np.median(record.oil_temperature))
        temperature = np.full(speed.size, usual if trial.temperature is None else trial.temperature)
    time = np.arange(speed.size, dtype=np.float64) * step
    torque = speed * 1e-3  # a record must swing to be cut into loops
    return DynamicRun(
        run_id="trial-loops",
        cycles=cycles,
        record=Record(time=time, pressure=pressure, speed=speed, torque=torque, oil_temperature=temperature),
    )


#: Minutes that a rig needs for another oil temperature (chosen: as long as the reference's warming up), and seconds of a
#: duty cycle where the campaign does not say how fast it was run (the reference's cycle, section 2.3.1).
OIL_SETTLING, DUTY_CYCLE = 60.0, 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One test of a protocol."""

    kind: str
    pressures: tuple[float, ...]  # [Pa] in the order in which they are set
    speeds: tuple[float, ...]  # [rad/s] likewise; of a dynamic test the lowest and the highest
    frequency: float | None = None  # [Hz] of a dynamic test
    periods: int | None = None
    temperature: float | None  # of the oil [K], None: as usual
    repeats: int = 1
    cycles: float  # at which it is made
    pause: float = 0.0  # before it [s]
    minutes: float  # on the rig, those of the duty cycles up to it included


def steps_of(campaign: Campaign, key: str) -> tuple[Step, ...]:
    """The steps of a trial; none where the campaign has no pattern for it."""
    trial = TRIALS[key]
    if trial.parts:
        return tuple(step for part in trial.parts for step in steps_of(campaign, part))
    then = with_trial(campaign, key)
    if then is None:
        return ()
    settling = 0.0 if trial.temperature is None else OIL_SETTLING
    steps = list[Step]()
    before = max((run.cycles for run in campaign.tests), default=0.0)
    timed = sorted({(run.cycles, run.moment) for run in campaign.stationary if run.moment is not None})
    paces = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(timed) if b[0] > a[0]]
    pace = float(np.median(paces)) if paces else DUTY_CYCLE  # seconds of a duty cycle, between tests of known moments
    for number, run in enumerate(then.stationary[len(campaign.stationary) :]):
        table, pause = run.plateaus, trial.rest * float(number % 2 == 0)
        minutes = criteria.PLATEAU_DURATION * table.torque.size / 60.0 * trial.times + settling + pause / 60.0
        minutes += pace * (run.cycles - before) / 60.0
        before = run.cycles
        steps.append(
            Step(
                kind="stationary_stribeck",
                pressures=_in_order(levels_of(table.pressure)),
                speeds=_in_order(np.round(table.speed, 3)),
                temperature=trial.temperature,
                repeats=trial.times,
                cycles=run.cycles,
                pause=pause,
                minutes=minutes,
            )
        )
    for swing in then.dynamic[len(campaign.dynamic) :]:
        record, pressures = swing.record, _in_order(swing.record.pressure)
        seconds = float(record.time[-1] - record.time[0])
        steps.append(
            Step(
                kind="dynamic_stribeck",
                pressures=pressures,
                speeds=(float(record.speed.min()), float(record.speed.max())),
                frequency=_FREQUENCY,
                periods=round(seconds * _FREQUENCY / len(pressures)),
                temperature=trial.temperature,
                cycles=swing.cycles,
                minutes=seconds / 60.0 + settling,
            )
        )
    return tuple(steps)


def _in_order(values: FloatArray) -> tuple[float, ...]:
    """The distinct values in the order of their first occurrence."""
    _, first = np.unique(values, return_index=True)
    return tuple(float(value) for value in values[np.sort(first)])
