"""One engagement on the rig: the pressure profile of fig. 3, and the shaft that the closing clutch brings to a stop.

    J dω/dt = T_motor(ω) - T_clutch(p, ω),      T_motor = clip(k (ω_set - ω), 0, T_max)

The motor holds its speed until the clutch takes more than the motor's limit of 20 Nm; from then on the shaft slows down
until it stops. Before the discs touch (the filling phase) only drag is transferred. What the closed clutch transfers is its
`Capacity`.

Once the shaft has stopped the clutch carries the motor's torque. Inertia, gain and the times of the profile are assumed:
the reference prints none.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, section 2.3.1, 2.3.2 and fig. 3.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from models.arrays import FloatArray
from models.friction.criteria import FEWEST_PRESSURES
from models.friction.pressure_laws import laws_of
from models.friction.stribeck import StribeckParameters, torque

#: Torque [Nm] of the closed clutch at line pressure [Pa] and sliding velocity [m/s] >= 0.
Capacity: TypeAlias = Callable[[float, float], float]


def capacity_of(parameters: Mapping[float, StribeckParameters]) -> Capacity:
    """Eq. 3 over pressure and velocity, from the parameters by pressure [Pa], one pressure or more.

    From FEWEST_PRESSURES on the pressure laws of fig. 9 go through them; with fewer, torque goes with pressure from the
    nearest one. Below the lowest pressure torque goes with pressure.
    """
    levels = np.array(sorted(parameters))
    columns = np.stack([parameters[level].as_array() for level in levels.tolist()])
    laws = laws_of(levels, columns) if levels.size >= FEWEST_PRESSURES else None

    def capacity(pressure: float, velocity: float) -> float:
        """Torque [Nm] that the clutch can carry at a pressure [Pa] and sliding velocity [m/s]: by the pressure laws, or
        by the curve of the nearest level."""
        curve_pressure = max(pressure, float(levels[0]))
        if laws is None:
            curve_pressure = float(levels[np.argmin(np.abs(levels - pressure))])
            curve = parameters[curve_pressure]
        else:
            curve = laws.parameters(np.array(curve_pressure))
        return float(torque(np.array(velocity), curve)) * pressure / curve_pressure

    return capacity


class LinePressure(Protocol):
    """A course of line pressure over an engagement."""

    @property
    def contact(self) -> float:
        """Time [s] at which the discs touch."""

    @property
    def plateau(self) -> float:
        """Line pressure [Pa] at contact."""

    @property
    def maximum(self) -> float:
        """Highest line pressure [Pa]."""

    def __call__(self, time: FloatArray) -> FloatArray:
        """Line pressure [n] Pa at time [n] s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureProfile:
    """Fig. 3: no pressure, a filling pulse p2, a plateau p3 on which the piston comes to rest, a ramp to the maximum p4.

    Pressures in Pa, times in s from the start: the pulse from `fill` to `settle`, the ramp from `contact` to `full`.
    Raises ValueError unless the times increase and 0 < plateau < pulse < maximum.
    """

    pulse: float = 2.5e5
    plateau: float = 1.0e5
    maximum: float = 8.0e5
    fill: float = 0.1
    settle: float = 0.25
    contact: float = 0.4
    full: float = 1.4

    def __post_init__(self) -> None:
        if not 0 < self.fill < self.settle < self.contact < self.full:
            raise ValueError("the profile's times must increase: 0 < fill < settle < contact < full")
        if not 0 < self.plateau < self.pulse < self.maximum:
            raise ValueError(
                f"pressures must satisfy 0 < plateau < pulse < maximum, got {self.plateau}, {self.pulse}, {self.maximum}"
            )

    def __call__(self, time: FloatArray) -> FloatArray:
        """Line pressure [n] Pa at time [n] s."""
        ramp = (time - self.contact) / (self.full - self.contact)
        pressure = self.plateau + (self.maximum - self.plateau) * np.clip(ramp, 0.0, 1.0)
        pressure = np.where(time < self.settle, self.pulse, pressure)
        return np.where(time < self.fill, 0.0, pressure)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """The motor and its shaft: speed [rad/s] > 0, torque limit [Nm] > 0, inertia [kg m²] > 0, gain k [Nm s/rad] > 0.

    `drag` [Nm s/rad] is what the open clutch transfers. Defaults are the life test's 2000 rpm and 20 Nm.
    """

    speed: float = 2000 * 2 * math.pi / 60
    limit: float = 20.0
    inertia: float = 0.05
    gain: float = 5.0
    drag: float = 0.002

    def torque(self, speed: float) -> float:
        """The speed controller's torque [Nm] at a shaft speed [rad/s], within 0 and the limit."""
        return min(self.limit, max(0.0, self.gain * (self.speed - speed)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Engagement:
    """A trace: time [n] s, pressure [n] Pa, speed [n] rad/s, torque [n] Nm of the clutch, motor_torque [n] Nm.

    `duration` [s] from contact until the shaft stops, None where it still turns at the end; `energy` [J] that the clutch
    dissipated.
    """

    time: FloatArray
    pressure: FloatArray
    speed: FloatArray
    torque: FloatArray
    motor_torque: FloatArray
    duration: float | None
    energy: float


def engage(
    capacity: Capacity,
    mean_radius: float,
    *,
    profile: LinePressure | None = None,
    drive: Drive | None = None,
    longest: float = 4.0,
    rate: float = 200.0,
) -> Engagement:
    """Close the clutch on the turning shaft; `longest` [s] bounds the simulation, `rate` [Hz] is the trace's."""
    from scipy.integrate import solve_ivp  # start-up time: of all answers only a simulated engagement needs it

    profile = PressureProfile() if profile is None else profile
    drive = Drive() if drive is None else drive
    if longest <= profile.contact:
        raise ValueError(f"longest must exceed the time of contact {profile.contact} s, got {longest}")

    def clutch_torque(time: float, speed: float) -> float:
        dragged = drive.drag * speed
        if time < profile.contact:
            return dragged
        # the ramp starts at the plateau, where the discs only just touch
        share = (float(profile(np.array([time]))[0]) - profile.plateau) / (profile.maximum - profile.plateau)
        return dragged + capacity(share * profile.maximum, speed * mean_radius)

    def slowing(time: float, state: FloatArray) -> list[float]:
        speed = max(float(state[0]), 0.0)
        carried = clutch_torque(time, speed)
        return [(drive.torque(speed) - carried) / drive.inertia, carried * speed]

    def stopped(_time: float, state: FloatArray) -> float:
        return float(state[0]) - 1e-3 * drive.speed  # slower it stands

    stopped.terminal = True  # type: ignore[attr-defined]
    start = [drive.speed - drive.drag * drive.speed / drive.gain, 0.0]
    solution = solve_ivp(
        slowing, (0.0, longest), start, events=stopped, dense_output=True, max_step=0.02, rtol=1e-6, atol=1e-6
    )
    stops = bool(solution.t_events[0].size)
    end = float(solution.t[-1])
    after = min(0.5, longest - end) if stops else 0.0
    time = np.arange(0.0, end + after, 1.0 / rate)
    speed = np.where(time < end, np.maximum(solution.sol(np.minimum(time, end))[0], 0.0), 0.0)
    motor = np.array([drive.torque(w) for w in speed.tolist()])
    turning = np.array([clutch_torque(t, w) for t, w in zip(time.tolist(), speed.tolist(), strict=True)])
    return Engagement(
        time=time,
        pressure=profile(time),
        speed=speed,
        torque=np.where(time < end, turning, motor),
        motor_torque=motor,
        duration=end - profile.contact if stops else None,
        energy=float(solution.y[1, -1]),
    )
