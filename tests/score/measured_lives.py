"""Lives of the simulated rig as the service has them: fitted curves and receipts of loops by run, beside the truth."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.loops.lag_fit import StationaryCurve
from models.loops.loops import evaluate_loops
from models.rig.sampled import DynamicTest, sampled_test
from models.rig.stationary import Sensor, stationary_test
from models.rig.truth import SimulatedClutch
from service.lives.assumptions import Assumptions
from service.lives.history import DYNAMIC, STATIONARY, Event, Life, reference_velocities
from service.lives.payloads import loop_items
from service.lives.quantities.measured import MeasuredLife
from service.lives.run_analysis import levels_of, mean_cofs

#: The pressure level that is scored [bar], and its place among the protocol's.
LEVEL, PLACE = 5.0, 2


def measured_life(
    clutch: SimulatedClutch, cycles: Sequence[float], rng: np.random.Generator, dynamic: DynamicTest | None = None
) -> MeasuredLife:
    """A life with a stationary test, and a dynamic one where it is given, at each of `cycles`."""
    events: list[Event] = []
    levels, receipts = {}, {}
    for index, at in enumerate(cycles):
        plateaus = stationary_test(clutch, at, rng)
        fitted = levels_of(plateaus, clutch.geometry)
        speeds = float(plateaus.speed.min()), float(plateaus.speed.max())
        cofs = mean_cofs(fitted, reference_velocities(speeds, clutch.geometry), clutch.geometry)
        name = f"test-{index}"
        levels[name] = list(fitted)
        events.append(Event(run_id=name, kind=STATIONARY, cycles=at, moment=2.0 * index, speed_range=speeds, cofs=cofs))
        if dynamic is not None:
            record = sampled_test(clutch, at, dynamic, rng, Sensor())
            fit = fitted[PLACE].fit
            loops = evaluate_loops(record, clutch.geometry, {fit.pressure: StationaryCurve.of(fit)})
            receipts[f"loops-{index}"] = {"loops": loop_items(loops)}
            events.append(Event(run_id=f"loops-{index}", kind=DYNAMIC, cycles=at, moment=2.0 * index + 1.0))
    return MeasuredLife(
        clutch_id="scored",
        life=Life(origin=0.0, events=tuple(events)),
        assumptions=Assumptions(),
        geometry=clutch.geometry,
        fraction=0.5,
        levels=levels,
        receipts=receipts,
    )


def until(measured: MeasuredLife, cycles: float) -> MeasuredLife:
    """The life as it was at so many cycles."""
    events = tuple(event for event in measured.life.events if event.cycles <= cycles)
    return replace(measured, life=replace(measured.life, events=events))
