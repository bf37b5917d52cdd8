"""The indicators of one measured engagement, each with its standard error.

    stop time        t_s = t_end - t_start                              (`slip`)
    energy           E = ∫ T ω dt from contact to the end of slip, by the trapezoid
    peak power       max T ω
    μ                μ = T / (faces · p · factor · A · r_m): initial, midpoint, endpoint at 90, 50, 10 % of the initial speed
    breakaway μ      the same where slip begins again after the standstill, under pressure
    ratios           initial, endpoint and breakaway μ over midpoint μ
    torque's rise    T(t_end)/T(midpoint) - 1

T, p and ω at a moment are those of a line or parabola through the samples around it (`slip`). What a record does not
determine is None. Valid from 10 Hz on; standard errors count the channels' noise and the open clutch's torque, no gain.

Source: this project's definitions, in the manner of the friction tests of SAE J1646 and J2490, which were not read: no
conformity is claimed.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.clutch import Geometry
from models.engagements import criteria
from models.engagements.comparison import COURSE_POINTS, SpeedCourse, bin_means
from models.engagements.slip import Refusal, SensorChannel, SlipRecord, ValueWithError, channel_of, crossing, slip_of
from models.records.criteria import UNLOADED
from models.records.runs import Record


@dataclass(frozen=True, slots=True, kw_only=True)
class EngagementIndicators:
    """Indicators of one engagement. Times in s of the record's clock, stop_time s, energy J, peak_power W, speeds
    rad/s, pressures Pa, all others without a unit; None where the record does not determine it.

    `course` is the slip's speed over time, for comparison with other engagements.
    """

    slip: SlipRecord
    initial_speed: ValueWithError
    maximum_pressure: float
    stop_time: ValueWithError
    energy: ValueWithError
    peak_power: ValueWithError | None
    initial_cof: ValueWithError | None
    midpoint_cof: ValueWithError | None
    endpoint_cof: ValueWithError | None
    breakaway_cof: ValueWithError | None
    initial_ratio: ValueWithError | None
    endpoint_ratio: ValueWithError | None
    breakaway_ratio: ValueWithError | None
    torque_rise: ValueWithError | None
    course: SpeedCourse


def measured_engagement(record: Record, geometry: Geometry) -> EngagementIndicators | Refusal:
    """The indicators of a record of one engagement, or the reason why it has none."""
    slip = slip_of(record)
    if isinstance(slip, Refusal):
        return slip
    per_pascal = geometry.torque_per_cof(1.0)
    channels = _Channels(slip, per_pascal)
    speed = channels.initial_speed()
    initial, midpoint, endpoint = (
        channels.cof(channels.moment(share * speed.value))
        for share in (criteria.INITIAL, criteria.MIDPOINT, criteria.ENDPOINT)
    )
    breakaway = _breakaway(slip, channels, per_pascal)
    at_midpoint = channels.moment(criteria.MIDPOINT * speed.value)
    rise = _ratio(*(channels.torque.at(moment, channels.width) for moment in (slip.end.value, at_midpoint)))
    return EngagementIndicators(
        slip=slip,
        initial_speed=speed,
        maximum_pressure=float(np.quantile(channels.pressure.values, 0.98)),  # a spike is none
        stop_time=slip.duration,
        energy=_energy(slip, channels),
        peak_power=_peak_power(slip),
        initial_cof=initial,
        midpoint_cof=midpoint,
        endpoint_cof=endpoint,
        breakaway_cof=breakaway,
        initial_ratio=_ratio(initial, midpoint),
        endpoint_ratio=_ratio(endpoint, midpoint),
        breakaway_ratio=_ratio(breakaway, midpoint),
        torque_rise=None if rise is None else ValueWithError(value=rise.value - 1, sd=rise.sd),
        course=_course(slip, channels),
    )


def trace_times(slip: SlipRecord) -> FloatArray:
    """Equally spaced times [m] s at which a slip's trace is shown: from before contact to after the standstill."""
    duration = slip.end.value - slip.contact
    first = max(slip.contact - 0.2 * duration, float(slip.time[0]))
    return np.linspace(first, min(slip.end.value + 0.3 * duration, float(slip.time[-1])), 300)


class _Channels:
    """The channels of a slip, from contact to a time before its end with certainty."""

    def __init__(self, slip: SlipRecord, per_pascal: float) -> None:
        rows = slip.between(slip.contact, slip.end.value - 2 * slip.end.sd)
        time = slip.time[rows]
        self.slip = slip
        # with wider windows a torque that saturates in a fifth of the slip is biased by 0.2 %
        self.width = 0.08 * (slip.end.value - slip.contact)
        self.torque, self.pressure, self.speed = (
            channel_of(time, column[rows]) for column in (slip.torque, slip.pressure, slip.speed)
        )
        self.friction = _friction(slip, per_pascal, rows)

    def initial_speed(self) -> ValueWithError:
        """The speed at contact: the mean over the quarter of the slip's duration before contact; where fewer than 3 samples
        lie there, the speed when the slip begins; where that cannot be fitted, the highest speed."""
        slip = self.slip
        before = slip.speed[slip.between(slip.contact - 0.25 * (slip.end.value - slip.contact), slip.contact)]
        if before.size >= 3:
            return ValueWithError(value=float(before.mean()), sd=float(before.std(ddof=1)) / math.sqrt(before.size))
        first = self.speed.at(float(self.speed.time[0]), self.width)
        return (
            ValueWithError(value=float(self.speed.values.max()), sd=self.noise(self.speed)) if first is None else first
        )

    def moment(self, speed: float) -> float:
        """Time [s] at which the shaft passes a speed [rad/s], with the fewest samples on the wrong side."""
        return crossing(self.speed.time, self.speed.values <= speed)

    def cof(self, moment: float) -> ValueWithError | None:
        """Coefficient of friction μ at a moment of the slip [s]."""
        return None if self.friction is None else self.friction.at(moment, self.width)

    def noise(self, channel: SensorChannel) -> float:
        """Standard deviation of a sample, from second differences."""
        second = np.diff(channel.values, 2)
        return float(np.sqrt(np.mean(second**2) / 6))


def _friction(slip: SlipRecord, per_pascal: float, rows: NDArray[np.bool_]) -> SensorChannel | None:
    """Coefficient of friction μ of every sample under load; `per_pascal` [Nm/Pa] is the torque of a unit μ."""
    loaded = rows & (slip.pressure >= UNLOADED)
    if not loaded.any():
        return None
    return channel_of(slip.time[loaded], slip.torque[loaded] / (per_pascal * slip.pressure[loaded]))


def _ratio(value: ValueWithError | None, reference: ValueWithError | None) -> ValueWithError | None:
    """The ratio of two values with its error; None if either is missing."""
    return None if value is None or reference is None else value.over(reference)


def _energy(slip: SlipRecord, channels: _Channels) -> ValueWithError:
    """Dissipated energy [J] by the trapezoidal rule; from contact to the first sample power is that sample's, at the
    end of slip it is zero."""
    rows = slip.between(slip.contact, slip.end.value)
    torque, speed = slip.torque[rows], slip.speed[rows]
    steps = np.diff(np.concatenate([[slip.contact], slip.time[rows], [slip.end.value]]))
    weight = (steps[:-1] + steps[1:]) / 2
    weight[0] += steps[0] / 2
    variance = (speed * channels.noise(channels.torque)) ** 2 + (torque * channels.noise(channels.speed)) ** 2
    factor = max(channels.torque.inflation, channels.speed.inflation)
    deviations = (
        math.sqrt(factor * float(np.sum(weight**2 * variance))),
        slip.open_torque.sd * float(weight @ speed),
        slip.start.sd * float(torque[0] * speed[0]),
    )
    return ValueWithError(value=float(weight @ (torque * speed)), sd=math.hypot(*deviations))


def _peak_power(slip: SlipRecord) -> ValueWithError | None:
    """The highest friction power [W] between contact and the end of slip, smoothed; None if samples are too few."""
    rows = slip.between(slip.contact, slip.end.value)
    power = channel_of(slip.time[rows], (slip.torque * slip.speed)[rows])
    first, last = power.time[[0, -1]].tolist()
    values = [power.at(moment, 0.12 * (last - first)) for moment in np.linspace(first, last, 61).tolist()]
    return max((value for value in values if value is not None), key=lambda value: value.value, default=None)


def _breakaway(slip: SlipRecord, channels: _Channels, per_pascal: float) -> ValueWithError | None:
    """Coefficient of friction μ at which slip begins again, from the samples between the standstill and that moment."""
    if slip.again is None:
        return None
    sticking = slip.between(slip.end.value, slip.again)
    friction = _friction(slip, per_pascal, sticking)
    pressure_held = np.median(slip.pressure[sticking][-criteria.FEWEST_LOCAL :]) if sticking.any() else 0.0
    if friction is None or pressure_held < 0.5 * channels.pressure.values[-1]:  # else the clutch was opened
        return None
    return friction.at(slip.again, channels.width)


def _course(slip: SlipRecord, channels: _Channels) -> SpeedCourse:
    """Speed course at equal steps from contact to the end of slip, each speed the mean over one step about it."""
    duration = slip.end.value - slip.contact
    at_once = max(channels.speed.values.size / COURSE_POINTS, 1.0)
    return SpeedCourse(
        duration=ValueWithError(value=duration, sd=slip.duration.sd),
        speed=bin_means(slip.time, slip.speed, np.linspace(slip.contact, slip.end.value, COURSE_POINTS)),
        noise=channels.noise(channels.speed) * math.sqrt(channels.speed.inflation / at_once),
    )
