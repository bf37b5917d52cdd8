"""The life that `clutchlife demo` simulates: the rig's campaign, with an effect of the oil's temperature in its torque.

Dynamic tests are made at few states and pressures, at a quarter of the usual rate, with the plateaus' noise of 1 %: the
dashboard shows friction loops over the life, and the demo stays short, because the lag of a loop takes the service longest.
Friction lags speed as in the service's own model, so that only one effect is hidden.

Some blocks of duty carry the record of their last engagement: a flywheel of the energy per cycle that the clutch stops
under the pressure of fig. 3. (The motor of the life test would keep a worn clutch slipping, and there would be no stop.)
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.interpolate import RectBivariateSpline

from models.engagements.simulation import Capacity, Drive, PressureProfile, engage
from models.friction.stribeck import torque
from models.records.runs import Record
from models.rig import campaign
from models.rig.hysteresis import FrictionLag
from models.rig.sampled import DynamicTest, Recorder, sampled_test
from models.rig.simulated_runs import DutyBlock, RunKind, SimulatedRun
from models.rig.stationary import Sensor
from models.rig.temperatures import warmed
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch, Surface, surface

#: The demo ends at this share of the mean COF when new. Chosen: a little after the end of life at 0.5.
_STOP = 0.49
#: Duty cycles at which a dynamic test is made; the pressures [Pa] that are recorded, and how near [Pa] a sample must be; the
#: test; the lag of its torque.
_LOOPS_AT = (0, 3000, 11_000)
_RECORDED, _NEAR = (4.0e5, 5.5e5, 7.0e5), 0.03e5
_TEST = DynamicTest(rate=25.0, recorder=Recorder(torque_noise=0.25, memory=0.02))
_LAG = FrictionLag(film_time=0.0, attractor=150.0)
#: The stream of the dynamic tests' noise.
_STREAM = 0xD7
#: Duty cycles of the blocks that carry an engagement. Chosen: three for the reference, then as friction changes.
_ENGAGED_AT = (500, 1000, 2000, 4000, 7000, 11_000)
#: The engagement's recorder and its rate [Hz], and the longest stop that it waits for [s]. Chosen: 1 % of 50 Nm.
_RECORDER, _RATE, _LONGEST_STOP = Recorder(torque_noise=0.5, memory=0.0), 100.0, 20.0
_ENGAGEMENT_STREAM = 0xE6


def runs(seed: int) -> Iterator[SimulatedRun]:
    """All runs in the order of the rig, with torque at the oil's simulated temperature.

    Runs are made one by one. The same seed >= 0 gives the same bits. Raises ValueError on a negative seed.
    """
    truth, looped = campaign.simulated_clutch(seed), replace(campaign.simulated_clutch(seed), lag=_LAG)
    for run in campaign.simulate(seed, clutch=truth, stop_fraction=_STOP):
        if run.duty is not None and run.cycles in _ENGAGED_AT:
            yield replace(run, record=_engagement(seed, truth, run.duty, run.cycles))
        else:
            yield run if run.plateaus is None else replace(run, plateaus=warmed(run.plateaus, truth, run.wear))
        if run.plateaus is not None and run.cycles in _LOOPS_AT:
            yield _looped(seed, looped, run.cycles)


def _looped(seed: int, truth: SimulatedClutch, cycles: int) -> SimulatedRun:
    """The dynamic test after this many duty cycles; `runs` ages the clutch by cycles alone."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_STREAM, cycles)))
    record = sampled_test(truth, cycles, _TEST, rng, Sensor())
    recorded = np.any([np.abs(record.pressure - level) < _NEAR for level in _RECORDED], axis=0)
    return SimulatedRun(
        run_id=f"sim-{seed}-dynamic-{cycles:05d}",
        kind=RunKind.DYNAMIC_STRIBECK,
        cycles=cycles,
        record=warmed(record.take(recorded), truth, cycles),
        wear=cycles,
    )


def inspections(seed: int, last: float) -> Iterator[tuple[int, Surface]]:
    """The duty cycles up to `last` of inspections, with the friction surface then: at the life's dynamic tests and near
    its end."""
    truth = campaign.simulated_clutch(seed)
    for cycles in sorted({*_LOOPS_AT, int(last)}):
        if cycles <= last:
            yield cycles, surface(truth, cycles)


def _engagement(seed: int, truth: SimulatedClutch, block: DutyBlock, cycles: int) -> Record:
    """The record of a block's last engagement, at the oil's set temperature."""
    drive = Drive(
        speed=block.initial_speed, limit=0.0, inertia=2 * block.energy_per_cycle / block.initial_speed**2, drag=0.0
    )
    trace = engage(
        _capacity(truth, cycles, drive.speed),
        truth.geometry.mean_radius,
        drive=drive,
        longest=_LONGEST_STOP,
        rate=_RATE,
    )
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_ENGAGEMENT_STREAM, cycles)))
    return _RECORDER.record(trace.time, trace.pressure, trace.speed, trace.torque, rng, Sensor())


def _capacity(truth: SimulatedClutch, cycles: int, fastest: float) -> Capacity:
    """The torque that the clutch can transfer, interpolated in a table up to a speed [rad/s]: one engagement needs
    thousands of values.

    Below the protocol's lowest pressure torque goes with pressure, as for the clutch itself.
    """
    pressure = np.linspace(PROTOCOL_PRESSURES[0], PressureProfile().maximum, 9)
    velocity = np.linspace(0.0, truth.geometry.mean_radius * fastest, 400)
    values = torque(velocity, truth.parameters(pressure[:, np.newaxis], cycles))
    table = RectBivariateSpline(pressure, velocity, values, kx=1, ky=1)

    def transferred(line: float, sliding: float) -> float:
        level = max(line, float(pressure[0]))
        return float(table.ev(level, sliding)) * line / level

    return transferred
