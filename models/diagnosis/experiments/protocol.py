"""A trial as a protocol that a rig can run: its steps in order, with what is to be set and how long each takes."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DynamicRun, StationaryRun
from models.diagnosis.design.criteria import PLATEAU_DURATION
from models.diagnosis.experiments.candidates import TRIALS, with_trial
from models.records.pressure_levels import levels_of

#: Minutes that a rig needs for another oil temperature (chosen: as long as the reference's warming up), and seconds of a
#: duty cycle where the campaign does not say how fast it was run (the reference's cycle, section 2.3.1).
OIL_SETTLING, DUTY_CYCLE = 60.0, 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One test: its kind, pressures [Pa] and speeds [rad/s] in the order in which they are set (of a dynamic test the lowest
    and the highest), frequency [Hz] and periods of a dynamic test, oil temperature [K] (None: as usual), repeats; the cycles
    at which it is made, the pause before it [s], and minutes on the rig, those of the duty cycles up to it included."""

    kind: str
    pressures: tuple[float, ...]
    speeds: tuple[float, ...]
    frequency: float | None
    periods: int | None
    temperature: float | None
    repeats: int
    cycles: float
    pause: float
    minutes: float


def steps_of(campaign: Campaign, key: str) -> tuple[Step, ...]:
    """The steps of a trial (`experiments.candidates.TRIALS`); none where the campaign has no pattern for it."""
    trial = TRIALS[key]
    if trial.parts:
        return tuple(step for part in trial.parts for step in steps_of(campaign, part))
    then = with_trial(campaign, key)
    if then is None:
        return ()
    settling = 0.0 if trial.temperature is None else OIL_SETTLING
    made: list[Step] = []
    cycles = [*(run.cycles for run in campaign.stationary), *(run.cycles for run in campaign.dynamic)]
    before = max(cycles, default=0.0)
    for number, run in enumerate(then.stationary[len(campaign.stationary) :]):
        pause = trial.rest * float(number % 2 == 0)
        minutes = PLATEAU_DURATION * run.plateaus.torque.size / 60.0 * trial.times + settling + pause / 60.0
        minutes += _pace(campaign) * (run.cycles - before) / 60.0
        before = run.cycles
        made.append(_swept(run, trial.temperature, trial.times, pause, minutes))
    swings = then.dynamic[len(campaign.dynamic) :]
    return (*made, *(_swung(run, trial.frequency, trial.temperature, settling) for run in swings))


def _swept(run: StationaryRun, temperature: float | None, repeats: int, pause: float, minutes: float) -> Step:
    table = run.plateaus
    return Step(
        kind="stationary_stribeck",
        pressures=_in_order(levels_of(table.pressure)),
        speeds=_in_order(np.round(table.speed, 3)),
        frequency=None,
        periods=None,
        temperature=temperature,
        repeats=repeats,
        cycles=run.cycles,
        pause=pause,
        minutes=minutes,
    )


def _swung(run: DynamicRun, frequency: float, temperature: float | None, settling: float) -> Step:
    record = run.record
    pressures = _in_order(record.pressure)
    seconds = float(record.time[-1] - record.time[0])
    return Step(
        kind="dynamic_stribeck",
        pressures=pressures,
        speeds=(float(record.speed.min()), float(record.speed.max())),
        frequency=frequency,
        periods=round(seconds * frequency / len(pressures)),
        temperature=temperature,
        repeats=1,
        cycles=run.cycles,
        pause=0.0,
        minutes=seconds / 60.0 + settling,
    )


def _in_order(values: FloatArray) -> tuple[float, ...]:
    """The distinct values in the order in which they first come."""
    _, first = np.unique(values, return_index=True)
    return tuple(float(value) for value in values[np.sort(first)])


def _pace(campaign: Campaign) -> float:
    """Seconds of a duty cycle: the median between tests of known moments."""
    timed = sorted({(run.cycles, run.moment) for run in campaign.stationary if run.moment is not None})
    paces = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(timed) if b[0] > a[0]]
    return float(np.median(paces)) if paces else DUTY_CYCLE
