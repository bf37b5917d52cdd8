"""A measured engagement beside the one that a model gives: the same pressure, the same initial speed, the same drive.

    J = ∫ (T - T_m) dt / (ω_1 - ω_2)     between 90 and 10 % of the initial speed

The drive's torque T_m is what the clutch carries once the shaft stands (none for a flywheel), the inertia J follows from
what slowed the shaft: so the simulated engagement starts from the measured energy. Pressure counts from that just before
contact, where the discs only touch. What is left between both is model discrepancy:

    of torque   √(Σ (T - T_model)² / Σ T²) at equal times since contact, while both slip
    of time     measured less simulated stop time
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.engagements.comparison import bin_means
from models.engagements.criteria import ENDPOINT, INITIAL
from models.engagements.measured import EngagementIndicators
from models.engagements.simulation import Capacity, Drive, Engagement, engage
from models.engagements.slip import Refusal, SlipRecord, ValueWithError, slip_of
from models.records.runs import Record


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedPressure:
    """A measured pressure as a profile: values [n] Pa at time [n] s; `contact` [s], `plateau` and `maximum` [Pa]."""

    time: FloatArray
    values: FloatArray
    contact: float
    plateau: float
    maximum: float

    def __call__(self, time: FloatArray) -> FloatArray:
        """Line pressure [m] Pa at time [m] s, not below the plateau."""
        return np.maximum(np.interp(time, self.time, self.values), self.plateau)


@dataclass(frozen=True, slots=True, kw_only=True)
class EngagementDiscrepancy:
    """The comparison of a measured engagement with a simulated one: `trace` is the simulated engagement on the record's
    clock, `torque_share` [-] the discrepancy of torque; `simulated_stop_time` [s] and `stop_time_difference` [s] are
    None where the simulated clutch slips on."""

    trace: Engagement
    drive: Drive
    torque_share: float
    simulated_stop_time: float | None
    stop_time_difference: ValueWithError | None


def discrepancy(
    engagement: EngagementIndicators, capacity: Capacity, mean_radius: float, moments: int = 100
) -> EngagementDiscrepancy | None:
    """The discrepancy of a measured engagement from a simulated one with this capacity, torques compared at `moments`
    times of the slip; None where the record shows no deceleration by the clutch."""
    slip = engagement.slip
    drive = _drive_of(slip, engagement.initial_speed.value)
    if drive is None:
        return None
    duration = slip.end.value - slip.contact
    # it begins a tenth of the slip before contact, and may last four times the measured one
    origin = slip.contact - 0.1 * duration
    profile = _profile_of(slip, engagement.maximum_pressure, origin, duration, moments)
    longest = profile.contact + 4.0 * duration
    trace = engage(capacity, mean_radius, profile=profile, drive=drive, longest=longest, rate=400 / duration)
    simulated = slip_of(Record(time=trace.time, pressure=profile(trace.time), speed=trace.speed, torque=trace.torque))
    stop = None if isinstance(simulated, Refusal) else simulated.duration.value
    both = duration if trace.duration is None else min(duration, trace.duration)
    since = np.linspace(0.0, both, moments)
    measured = bin_means(slip.time, slip.torque, slip.contact + since)
    modelled = np.interp(profile.contact + since, trace.time, trace.torque)
    inside = slice(1, -1)  # a bin at an end reaches beyond the slip
    error, values = measured[inside] - modelled[inside], measured[inside]
    of_stop = engagement.stop_time
    return EngagementDiscrepancy(
        trace=replace(trace, time=trace.time + origin),
        drive=drive,
        torque_share=math.sqrt(float(error @ error) / float(values @ values)),
        simulated_stop_time=stop,
        stop_time_difference=None if stop is None else ValueWithError(value=of_stop.value - stop, sd=of_stop.sd),
    )


def _drive_of(slip: SlipRecord, speed: float) -> Drive | None:
    """The drive of a record, with the inertia that its deceleration implies; None where the shaft was not slowed by the
    clutch's torque."""
    until = slip.time[-1] if slip.again is None else slip.again
    sticking_torque = slip.torque[slip.between(slip.end.value + 2 * slip.end.sd, float(until))]
    limit = max(float(np.median(sticking_torque)), 0.0) if sticking_torque.size >= 3 else 0.0
    rows = slip.between(slip.contact, slip.end.value)
    rows &= (slip.speed <= INITIAL * speed) & (slip.speed >= ENDPOINT * speed)
    if np.count_nonzero(rows) < 3:
        return None
    time, torque = slip.time[rows], slip.torque[rows]
    first, last = np.polynomial.Polynomial.fit(time, slip.speed[rows], 2)(time[[0, -1]]).tolist()
    slowed = first - last
    inertia = float(np.trapezoid(torque - limit, time)) / slowed if slowed > 0 else 0.0
    return Drive(speed=speed, limit=limit, inertia=inertia, drag=0.0) if inertia > 0 else None


def _profile_of(slip: SlipRecord, maximum: float, origin: float, duration: float, moments: int) -> RecordedPressure:
    """The recorded pressure from contact to the last sample, at `moments` points for each `duration` [s]."""
    before = slip.pressure[slip.between(origin, slip.contact)]
    plateau = float(np.median(before)) if before.size else 0.0
    last = float(slip.time[-1])
    at = np.linspace(slip.contact, last, max(3, math.ceil(moments * (last - slip.contact) / duration)))
    return RecordedPressure(
        time=at - origin,
        values=np.interp(at, slip.time, slip.pressure)
        if at.size > slip.time.size
        else bin_means(slip.time, slip.pressure, at),
        contact=slip.contact - origin,
        plateau=min(plateau, 0.9 * maximum),
        maximum=maximum,
    )
