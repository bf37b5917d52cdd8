"""Tests that a rig could make next, and the runs that they would add to a campaign.

A trial is made after the last state unless it goes on to later ones. Its torques are not known beforehand and not needed:
what it would tell hangs on where it measures.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun, EventKind, MaintenanceEvent, StationaryRun
from models.diagnosis.design import PLATEAU_DURATION
from models.runs import Plateaus, Record, pressure_levels

#: The dynamic test of the reference (section 2.3.4): a swing of 1000 rpm about 1000 rpm, sampled at 100 a period.
SWING = 1000 * 2 * np.pi / 60
_SAMPLES, _PERIODS = 100, 4
_HOUR = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What a test would be. `text` is for the engineer; everything else is for machines.

    loops: a dynamic test at `frequency` [Hz]; else a stationary test, at `temperature` [K] of the oil (None: as usual),
    speeds `falling`, pressures times `pressure` [-]. `later`: how many usual distances between states it lies ahead, with
    `energy` [-] times the usual energy of an engagement up to there. `rest` [s]: after a pause of so long.
    """

    text: str
    loops: bool = False
    frequency: float = 0.1
    temperature: float | None = None
    falling: bool = False
    pressure: float = 1.0
    later: int = 0
    energy: float = 1.0
    rest: float = 0.0


TRIALS: dict[str, Trial] = {
    "loops_0.5hz": Trial(
        text="dynamic test at 0.5 Hz, 1000 ± 1000 rpm, all pressures, four periods each", loops=True, frequency=0.5
    ),
    "loops_1hz": Trial(
        text="dynamic test at 1 Hz, 1000 ± 1000 rpm, all pressures, four periods each", loops=True, frequency=1.0
    ),
    "sweep_60c": Trial(text="stationary test with the oil at 60 °C", temperature=333.15),
    "sweep_100c": Trial(text="stationary test with the oil at 100 °C", temperature=373.15),
    "falling_speeds": Trial(text="stationary test with the speeds falling instead of rising", falling=True),
    "light_sweep": Trial(text="stationary test at a quarter of the usual pressures", pressure=0.25),
    "repeat": Trial(text="the stationary test again at once"),
    "after_rest": Trial(text="the stationary test again after a night's rest", rest=12 * _HOUR),
    "more_states": Trial(text="three more states of use, at the usual distance, with a stationary test each", later=3),
    "half_energy": Trial(
        text="two more states of use with engagements of half the usual energy, with a stationary test each",
        later=2,
        energy=0.5,
    ),
    "twice_energy": Trial(
        text="two more states of use with engagements of twice the usual energy, with a stationary test each",
        later=2,
        energy=2.0,
    ),
}


def with_trial(campaign: Campaign, key: str) -> Campaign | None:
    """The campaign with the trial's runs added at its end (torques 0); None where the campaign has no pattern for it."""
    trial, pattern = TRIALS[key], campaign.stationary[-1] if campaign.stationary else None
    states = np.unique([*(run.cycles for run in campaign.stationary), *(run.cycles for run in campaign.dynamic)])
    if states.size == 0 or (trial.later and states.size < 2):
        return None
    last = float(states[-1])
    if trial.loops:
        run = _loops(campaign, trial, last) if campaign.dynamic else None
        return None if run is None else replace(campaign, dynamic=(*campaign.dynamic, run))
    if pattern is None:
        return None
    step = _distance(states) if trial.later else 0.0
    ahead = [last + step * (k + 1) for k in range(trial.later)] or [last]
    tests = tuple(_sweep(pattern, trial, cycles, f"trial-{k}") for k, cycles in enumerate(ahead))
    added = replace(campaign, stationary=(*campaign.stationary, *tests))
    if trial.later:
        added = replace(added, duty=(*campaign.duty, *_duty(campaign, trial, ahead, step)))
    if trial.rest:
        event = MaintenanceEvent(run_id="trial-rest", cycles=last, event=EventKind.REST, moment=tests[0].moment)
        added = replace(added, maintenance=(*campaign.maintenance, event))
    return added


def _distance(states: FloatArray) -> float:
    """The usual distance [cycles] of two states [s >= 2] late in life."""
    return float(np.median(np.diff(states[max(0, min(states.size // 2, states.size - 2)) :])))


def _sweep(pattern: StationaryRun, trial: Trial, cycles: float, run_id: str) -> StationaryRun:
    table = pattern.plateaus
    levels = pressure_levels(table.pressure)
    rows = np.arange(table.torque.size)
    if trial.falling:
        rows = np.lexsort((-table.speed, levels))
    oil = table.oil_temperature
    if trial.temperature is not None:
        oil = np.full(rows.size, trial.temperature)
    moment = None if pattern.moment is None else pattern.moment + PLATEAU_DURATION * rows.size + trial.rest
    return StationaryRun(
        run_id=run_id,
        cycles=cycles,
        plateaus=Plateaus(
            pressure=trial.pressure * table.pressure[rows],
            speed=table.speed[rows],
            torque=np.zeros(rows.size),
            oil_temperature=oil if oil is None or trial.temperature is not None else oil[rows],
        ),
        moment=moment,
    )


def _loops(campaign: Campaign, trial: Trial, cycles: float) -> DynamicRun:
    """The pressures of the last dynamic test, at another frequency."""
    record = campaign.dynamic[-1].record
    levels = np.unique(pressure_levels(record.pressure[:: max(1, record.pressure.size // 5000)]))
    count = _SAMPLES * _PERIODS + 1
    step = 1.0 / (trial.frequency * _SAMPLES)
    phase = 2 * np.pi * np.arange(count) / _SAMPLES
    speed = np.tile(SWING * (1 - np.cos(phase)), levels.size)
    pressure = np.repeat(levels, count)
    temperature = (
        None if record.oil_temperature is None else np.full(speed.size, float(np.median(record.oil_temperature)))
    )
    time = np.arange(speed.size, dtype=np.float64) * step
    torque = speed * 1e-3  # a record must swing to be cut into loops
    return DynamicRun(
        run_id="trial-loops",
        cycles=cycles,
        record=Record(time=time, pressure=pressure, speed=speed, torque=torque, oil_temperature=temperature),
    )


def _duty(campaign: Campaign, trial: Trial, ahead: list[float], step: float) -> list[DutyRun]:
    known = [run.energy for run in campaign.duty if run.energy is not None]
    usual = float(np.median(known)) if known else None
    return [
        DutyRun(
            run_id=f"trial-duty-{k}",
            cycles=cycles,
            engagements=step,
            energy=None if usual is None else usual * trial.energy,
        )
        for k, cycles in enumerate(ahead)
    ]
