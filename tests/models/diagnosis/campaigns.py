"""Small simulated campaigns for the diagnosis, with something planted where a test asks for it.

The clutch is the simulated rig's; loops follow the attractor law in time, from rest, so that neither the periodic solution
nor the phase bins of the diagnosis are used to make what it is tested on.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DynamicRun, StationaryRun
from models.friction.stribeck import StribeckParameters, torque
from models.loops.attractor import attractor_torque
from models.records.runs import Plateaus, Record
from models.rig.truth import SimulatedClutch, draw

RPM = 2 * np.pi / 60
PRESSURES = np.linspace(4e5, 7e5, 5)
SPEEDS = np.linspace(20.0, 1970.0, 24) * RPM
CYCLES = (0.0, 1000.0, 3000.0, 6000.0, 10000.0, 15000.0)


@dataclass(frozen=True)
class Where:
    """Rows of a test, as a planted effect sees them: velocity [m/s], pressure [Pa], cycles, oil temperature [K], clock
    [s], acceleration [m/s²] (0 on plateaus), and the parameters there."""

    velocity: FloatArray
    pressure: FloatArray
    cycles: float
    temperature: FloatArray
    clock: FloatArray
    acceleration: FloatArray
    parameters: StribeckParameters
    dynamic: bool


Planted = Callable[[Where], FloatArray]


def campaign(
    seed: int,
    planted: Planted | None = None,
    *,
    cycles: tuple[float, ...] = CYCLES,
    loops: bool = True,
    temperature: bool = True,
    noise: float = 0.01,
    gain: float = 0.002,
) -> Campaign:
    """A campaign with `planted` added to its torque; noise and gain 0: the bare truth."""
    rng = np.random.default_rng(seed)
    clutch = draw(rng)
    stationary, dynamic = [], []
    for number, state in enumerate(cycles):
        stationary.append(_stationary(number, state, clutch, rng, planted, temperature, noise, gain))
        if loops:
            dynamic.append(_dynamic(number, state, clutch, rng, planted, temperature, noise, gain))
    return Campaign(stationary=tuple(stationary), dynamic=tuple(dynamic))


def _stationary(
    number: int,
    state: float,
    clutch: SimulatedClutch,
    rng: np.random.Generator,
    planted: Planted | None,
    temperature: bool,
    noise: float,
    gain: float,
) -> StationaryRun:
    pressure, speed = np.repeat(PRESSURES, SPEEDS.size), np.tile(SPEEDS, PRESSURES.size)
    clock = 5.0 * np.arange(speed.size) + 2.5
    swing = rng.uniform(2.0, 4.0) * np.sin(2 * np.pi * clock / rng.uniform(400.0, 900.0) + rng.uniform(0.0, 6.0))
    oil = 358.15 + swing
    parameters = clutch.parameters(pressure, state)
    velocity = clutch.geometry.sliding_velocity(speed)
    true = torque(velocity, parameters)
    if planted is not None:
        at = Where(velocity, pressure, state, oil, clock, np.zeros_like(velocity), parameters, dynamic=False)
        true = true + planted(at)
    measured = true * (1 + gain * rng.standard_normal()) * (1 + noise * rng.standard_normal(true.size))
    return StationaryRun(
        run_id=f"stationary-{number}",
        cycles=state,
        moment=1e9 + 86400.0 * number,
        plateaus=Plateaus(
            pressure=pressure, speed=speed, torque=measured, oil_temperature=oil if temperature else None
        ),
    )


def _dynamic(
    number: int,
    state: float,
    clutch: SimulatedClutch,
    rng: np.random.Generator,
    planted: Planted | None,
    temperature: bool,
    noise: float,
    gain: float,
) -> DynamicRun:
    time = np.arange(0.0, 15.0, 0.02)
    speed = 1000 * RPM * (1 - np.cos(2 * np.pi * 0.1 * time))
    velocity = clutch.geometry.sliding_velocity(speed)
    acceleration = clutch.geometry.sliding_velocity(1000 * RPM * 2 * np.pi * 0.1 * np.sin(2 * np.pi * 0.1 * time))
    factor = 1 + gain * rng.standard_normal()
    parts = []
    for level, pressure in enumerate(PRESSURES):
        full = np.full_like(time, pressure)
        one = StribeckParameters.from_array(clutch.parameters(float(pressure), state).as_array())
        true = attractor_torque(time, np.maximum(velocity, 1e-4), one, 250.0)
        oil = np.full_like(time, 358.15)
        if planted is not None:
            at = Where(velocity, full, state, oil, time + 15 * level, acceleration, one, dynamic=True)
            true = true + planted(at)
        parts.append(
            (time + 15 * level, full, speed, true * factor * (1 + noise * rng.standard_normal(time.size)), oil)
        )
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    record = Record(
        time=columns[0],
        pressure=columns[1],
        speed=columns[2],
        torque=columns[3],
        oil_temperature=columns[4] if temperature else None,
    )
    return DynamicRun(run_id=f"dynamic-{number}", cycles=state, moment=1e9 + 86400.0 * number + 2000.0, record=record)
