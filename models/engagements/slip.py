"""Where an engagement slips: the contact, the start and the end of slip, and what the sensors read at zero.

    t_contact   where the line through the rising torque comes from zero
    t_start     where torque passes 10 % of its highest value
    t_end       where speed comes to rest

Speed counts from b, which it keeps at standstill; torque from its level before contact, which is the sensor's zero and the
open clutch's drag. Signs are those of a slip that dissipates: both channels are turned where they read the other way.

A moment at which a rising torque passes a level is the one that leaves the fewest samples on the wrong side; where samples
show the rise a line through them refines it. Source: this project's definitions; those of SAE J1646 and J2490 were not
read.

The value of a noisy channel at a moment is that of a line or a parabola through the samples around it.

    y(t) = c_0 + c_1 (t - t_0) + c_2 (t - t_0)²,      value = c_0,      Var = s² f (XᵀX)⁻¹_00

The parabola's c_2 is kept where it is significant. s² is the residuals' variance and f = (1 + ρ)/(1 - ρ) the
factor by which first-order autoregressive noise makes a mean more uncertain, ρ the correlation of neighbouring samples.

The shaft comes to rest as ω(t) = b + Σ a_k g^k, g = max(0, t_end - t), fitted from half the speed on. b is what the sensor
reads at standstill. The powers k go up to 2, or to 4 where the shaft creeps to rest.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.engagements import criteria
from models.engagements.criteria import FEWEST_LOCAL
from models.records.criteria import UNLOADED
from models.records.outliers import running_median
from models.records.runs import Record


class SlipStatus(StrEnum):
    """Whether a record holds an engagement, and if not, the reason."""

    DETERMINED = "determined"
    TOO_FEW_SAMPLES = "too_few_samples"
    TIME_NOT_INCREASING = "time_not_increasing"
    SAMPLED_TOO_SLOWLY = "sampled_too_slowly"
    NO_PRESSURE = "no_pressure"
    NO_SLIP = "no_slip"
    SLIP_NEVER_ENDS = "slip_never_ends"
    NO_TORQUE = "no_torque"
    STARTS_IN_CONTACT = "starts_in_contact"
    GAP = "gap"


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """The reason why a record holds no engagement, as a status and a sentence."""

    status: SlipStatus
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueWithError:
    """A value with its standard error, in the value's unit."""

    value: float
    sd: float

    def over(self, other: "ValueWithError") -> "ValueWithError | None":
        """The ratio to another value, errors independent; None where that is not positive."""
        if other.value <= 0:
            return None
        ratio = self.value / other.value
        return ValueWithError(value=ratio, sd=math.hypot(self.sd, ratio * other.sd) / other.value)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorChannel:
    """A channel: time [n] s ascending, values [n]; `inflation` f >= 1 of its noise."""

    time: FloatArray
    values: FloatArray
    inflation: float

    def at(self, moment: float, half_width: float) -> ValueWithError | None:
        """The value at a moment [s] within the channel, by the samples within `half_width` [s] or, at an end, within twice
        that. None where too few lie near."""
        first, last = self.time[[0, -1]].tolist()
        distance = np.abs(self.time - min(max(moment, first + half_width), last - half_width))
        if distance.size < FEWEST_LOCAL:
            return None
        width = max(half_width, float(np.partition(distance, FEWEST_LOCAL - 1)[FEWEST_LOCAL - 1]))
        if width > max(half_width, 0.25 * (last - first)):
            return None
        rows = distance <= width * (1 + 1e-9)
        return _fitted((self.time[rows] - moment) / width, self.values[rows], self.inflation)


def channel_of(time: FloatArray, values: FloatArray, parts: int = 8, most: float = 0.9) -> SensorChannel:
    """A channel with the autocorrelation of its noise estimated from residuals of parabolas through equal parts of it.
    The correlation is limited to `most`: with a variance factor of more than 19 no window holds samples enough."""
    before, after = [np.zeros(0)], [np.zeros(0)]
    for at, part in zip(np.array_split(time, parts), np.array_split(values, parts), strict=True):
        if at.size >= FEWEST_LOCAL:
            residual = part - np.polynomial.Polynomial.fit(at, part, 2)(at)
            before.append(residual[:-1])
            after.append(residual[1:])
    first, second = np.concatenate(before), np.concatenate(after)
    power = float(first @ first)
    correlation = min(max(float(first @ second) / power, 0.0), most) if power > 0 else 0.0
    return SensorChannel(time=time, values=values, inflation=(1 + correlation) / (1 - correlation))


def _fitted(moment: FloatArray, values: FloatArray, inflation: float) -> ValueWithError:
    """The value at 0 of a parabola through the samples at `moment` [n], or of a line where its curvature is not
    significant."""
    design = np.stack([np.ones_like(moment), moment, moment**2], axis=1)
    estimate, curvature = _least_squares(design, values, inflation)
    if abs(curvature.value) > 2.0 * curvature.sd:
        return estimate
    return _least_squares(design[:, :2], values, inflation)[0]


def _least_squares(design: FloatArray, values: FloatArray, inflation: float) -> tuple[ValueWithError, ValueWithError]:
    """First and last coefficient of the least-squares fit of values [n] by a design [n, k], with standard errors; the
    noise's variance counts `inflation` times, because it is autocorrelated."""
    inverse = np.linalg.pinv(design.T @ design)
    coefficients = inverse @ (design.T @ values)
    residual = values - design @ coefficients
    variance = float(residual @ residual) / (values.size - design.shape[1]) * inflation
    first, last = (
        ValueWithError(value=float(coefficients[i]), sd=math.sqrt(max(variance * float(inverse[i, i]), 0.0)))
        for i in (0, -1)
    )
    return first, last


@dataclass(frozen=True, slots=True, kw_only=True)
class Standstill:
    """The shaft's way to rest: the first fast row, the last one, and the first at which it stands; the end of slip, the
    speed that is read at standstill [rad/s], and when the shaft turns again [s]."""

    fast: int
    slowing: int
    rest: int
    end: ValueWithError
    zero: float
    again: float | None


def standstill_of(time: FloatArray, speed: FloatArray) -> Standstill | Refusal:
    """The shaft's way to its first rest, from time [n] s and speed [n] rad/s; or the reason why it does not come to
    rest."""
    smooth = running_median(speed, 5)
    highest = float(smooth.max())
    if highest < criteria.LEAST_SPEED:
        rule = f"the shaft must turn at {_rpm(criteria.LEAST_SPEED)} or more, got at most {_rpm(highest)}"
        return Refusal(status=SlipStatus.NO_SLIP, message=rule)
    fast, slow = smooth >= 0.5 * highest, smooth <= criteria.SLOW * highest
    first = int(np.argmax(fast))
    standstill = first + int(np.argmax(slow[first:]))
    if not slow[standstill]:
        least = 100 * float(smooth[first:].min()) / highest
        limit = f"and must fall to {100 * criteria.SLOW:g} % or less"
        return _never_ends(f"the lowest speed is {least:.3g} % of the highest, {limit}")
    slowing = int(np.flatnonzero(fast[:standstill])[-1])
    turning = np.flatnonzero(smooth[standstill:] > 2 * criteria.SLOW * highest)
    leaves = standstill + int(turning[0]) if turning.size else time.size
    window = slice(slowing, min(leaves, standstill + 2 * (standstill - slowing) + 5))
    latest = min(2 * standstill - slowing + 2, leaves - 1)
    end, zero = _rest(time[window], speed[window], float(time[slowing]), float(time[latest]))
    if abs(zero) > criteria.LARGEST_ZERO * highest:
        limit = f"and must come within {100 * criteria.LARGEST_ZERO:g} % of zero"
        return _never_ends(f"the speed stays at {100 * zero / highest:.3g} % of the highest, {limit}")
    slips_again = None
    if turning.size:
        still = np.flatnonzero(speed[standstill:leaves] - zero <= criteria.LARGEST_ZERO * highest)
        slips_again = float(time[standstill + (int(still[-1]) if still.size else 0)])
    return Standstill(fast=first, slowing=slowing, rest=standstill, end=end, zero=zero, again=slips_again)


def _rpm(speed: float) -> str:
    """A speed [rad/s] as text."""
    return f"{30.0 * speed / math.pi:.3g} rpm"


def _never_ends(reason: str) -> Refusal:
    rule = f"slip must end within the record: {reason}. Record longer"
    return Refusal(status=SlipStatus.SLIP_NEVER_ENDS, message=rule)


def _rest(time: FloatArray, speed: FloatArray, earliest: float, latest: float) -> tuple[ValueWithError, float]:
    """The end of slip and the speed at standstill; 0 where the record holds no standstill to show it.

    The power of g rises from 2 for as long as that explains more than chance would.
    """
    standstill = _rest_of(2, time, speed, earliest, latest)
    # a shaft that its drive almost keeps turning creeps to rest, and a parabola places that 3 % too early
    for power in (3, 4):
        better = _rest_of(power, time, speed, earliest, latest)
        few = better.freedom < criteria.FEWEST_SLIPPING
        if few or standstill.misfit - better.misfit < 3.0**2 * better.misfit / better.freedom:
            break
        standstill = better
    return standstill.end, standstill.zero


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rest:
    """A fit of the shaft's way to rest: its sum of squares and degrees of freedom."""

    end: ValueWithError
    zero: float
    misfit: float
    freedom: int


def _rest_of(power: int, time: FloatArray, speed: FloatArray, earliest: float, latest: float) -> _Rest:
    """The end of slip by least squares: speed is a polynomial of `power` up to the end, and constant after it."""
    from scipy.optimize import minimize_scalar  # start-up time: only a raw record of an engagement has an end of slip

    span = latest - earliest

    def design(end: float) -> FloatArray:
        left = np.maximum(end - time, 0.0) / span
        columns = [left**exponent for exponent in range(1, power + 1)]
        return np.stack([np.ones_like(time), *columns] if np.count_nonzero(time > end) > 2 else columns, axis=1)

    def misfit(end: float) -> float:
        rows = design(end)
        return float(np.sum((speed - rows @ np.linalg.lstsq(rows, speed)[0]) ** 2))

    trials = np.linspace(earliest, latest, 42)[1:]
    best = int(np.argmin([misfit(end) for end in trials.tolist()]))
    low, high = trials[max(best - 1, 0)], trials[min(best + 1, trials.size - 1)]
    end = float(minimize_scalar(misfit, bounds=(low, high), method="bounded", options={"xatol": 1e-7}).x)
    rows = design(end)
    coefficients = np.linalg.lstsq(rows, speed)[0]
    polynomial = np.polynomial.Polynomial([0.0, *coefficients[-power:].tolist()]).deriv()
    slope = np.where(time < end, polynomial((end - time) / span) / span, 0.0)
    jacobian = np.column_stack([rows, slope])
    freedom = max(time.size - jacobian.shape[1], 1)
    variance = misfit(end) / freedom * float(np.linalg.pinv(jacobian.T @ jacobian)[-1, -1])
    return _Rest(
        end=ValueWithError(value=end, sd=math.sqrt(max(variance, 0.0))),
        zero=float(coefficients[0]) if rows.shape[1] > power else 0.0,
        misfit=misfit(end),
        freedom=freedom,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipRecord:
    """An engagement's record freed of its sensors' zeros: time [n] s, pressure [n] Pa, speed [n] rad/s, torque [n] Nm, and
    where it slips: contact [s], start and end [s], and the zero of torque [Nm].

    `again` [s] is when slip begins again after the standstill; None where it does not.
    """

    time: FloatArray
    pressure: FloatArray
    speed: FloatArray
    torque: FloatArray
    contact: float
    start: ValueWithError
    end: ValueWithError
    open_torque: ValueWithError
    again: float | None

    @property
    def duration(self) -> ValueWithError:
        """Duration from start to end of slip [s]."""
        return ValueWithError(value=self.end.value - self.start.value, sd=math.hypot(self.start.sd, self.end.sd))

    def between(self, low: float, high: float) -> NDArray[np.bool_]:
        """Mask [n] of the samples from `low` to `high` [s], both included."""
        return (self.time >= low) & (self.time <= high)


def slip_of(record: Record) -> SlipRecord | Refusal:
    """The slip of a record of one engagement, the first where it holds several."""
    refusal = _unusable(record)
    if refusal is not None:
        return refusal
    speed = record.speed * _sign(record.speed)
    stop = standstill_of(record.time, speed)
    if isinstance(stop, Refusal):
        return stop
    torque = record.torque * _sign((record.torque * speed)[stop.fast : stop.rest])
    before = slice(0, int(np.searchsorted(record.time, stop.end.value - 2 * stop.end.sd)))
    contact = _contact_of(record.time[before], torque[before], stop.slowing)
    if isinstance(contact, Refusal):
        return contact
    slipping = record.time[(record.time >= contact.contact) & (record.time <= stop.end.value)]
    duration = stop.end.value - contact.contact
    if slipping.size < criteria.FEWEST_SLIPPING:
        rule = (
            f"at least {criteria.FEWEST_SLIPPING} samples must lie between contact and standstill, got {slipping.size}"
        )
        return Refusal(status=SlipStatus.TOO_FEW_SAMPLES, message=rule)
    gap = float(np.diff(slipping).max())
    if gap > criteria.LONGEST_GAP * duration:
        most = 100 * criteria.LONGEST_GAP
        rule = f"samples are missing for {gap:.3g} s of a slip of {duration:.3g} s: record it without gaps above {most:g} %"
        return Refusal(status=SlipStatus.GAP, message=rule)
    return SlipRecord(
        time=record.time,
        pressure=record.pressure,
        speed=speed - stop.zero,
        torque=torque - contact.zero.value,
        contact=contact.contact,
        start=contact.start,
        end=stop.end,
        open_torque=contact.zero,
        again=stop.again,
    )


def _unusable(record: Record) -> Refusal | None:
    """Why no slip can be found in a record; None if there is no reason."""
    size = record.time.size
    if size < criteria.FEWEST_SAMPLES:
        rule = f"a record must have at least {criteria.FEWEST_SAMPLES} samples, got {size}"
        return Refusal(status=SlipStatus.TOO_FEW_SAMPLES, message=rule)
    steps = np.diff(record.time)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 1
        rule = (
            f"time must increase, got {record.time[row]:.9g} s after {record.time[row - 1]:.9g} s in sample {row + 1}"
        )
        return Refusal(status=SlipStatus.TIME_NOT_INCREASING, message=rule)
    rate = 1.0 / float(np.median(steps))
    if rate < criteria.SLOWEST_RATE * (1 - 0.05):  # a recorder's clock may be slow
        rule = f"an engagement must be sampled at {criteria.SLOWEST_RATE:g} Hz or faster, got {rate:.3g} Hz"
        return Refusal(status=SlipStatus.SAMPLED_TOO_SLOWLY, message=rule)
    if float(record.pressure.max()) < UNLOADED:
        highest = float(record.pressure.max()) / 1e5
        rule = f"the clutch must be under pressure, but the highest pressure is {highest:.3g} bar"
        return Refusal(status=SlipStatus.NO_PRESSURE, message=rule)
    if float(np.ptp(record.torque)) == 0.0:
        rule = f"torque must rise, but is {record.torque[0]:g} Nm in all samples"
        return Refusal(status=SlipStatus.NO_TORQUE, message=rule)
    return None


def _sign(values: FloatArray) -> float:
    """-1 where the values are negative by and large."""
    return -1.0 if float(values.sum()) < 0 else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Contact:
    """Contact and start of slip [s], and the torque [Nm] before contact."""

    contact: float
    start: ValueWithError
    zero: ValueWithError


def _contact_of(time: FloatArray, torque: FloatArray, slowing: int) -> _Contact | Refusal:
    """The contact, fitted to the rows before the end of slip, or a refusal; the shaft is fast up to row `slowing`."""
    from scipy.ndimage import uniform_filter1d  # start-up time: what answers cuts no record

    smooth = uniform_filter1d(torque, max(3, (time.size - slowing) // 100), mode="nearest")
    highest_row = int(np.argmax(smooth))
    highest = float(smooth[highest_row])
    low = float(smooth[: max(highest_row, 1)].min())
    noise = float(np.median(np.abs(np.diff(torque, 2)))) / (0.6745 * math.sqrt(6))  # 0.6745: a normal's upper quartile
    never_open = abs(low) > 0.2 * (highest - low)  # above a sensor's zero and an open clutch's drag together
    if highest - low <= criteria.LEAST_RISE * noise and not (never_open and highest > criteria.LEAST_RISE * noise):
        rule = f"torque must rise above its noise of {noise:.3g} Nm, but rises by only {highest - low:.3g} Nm"
        return Refusal(status=SlipStatus.NO_TORQUE, message=rule)
    rising = slice(0, highest_row + 1)
    if not never_open:
        crossings = _crossings(time[rising], torque[rising] - low, highest - low)
        open_rows = time < 2 * crossings[0] - crossings[1]
        if np.count_nonzero(open_rows) >= 3:
            quiet = torque[open_rows]
            zero = ValueWithError(value=float(quiet.mean()), sd=float(quiet.std(ddof=1)) / math.sqrt(quiet.size))
            return _start_of(time[rising], torque[rising] - zero.value, highest - zero.value, zero)
    rule = (
        "the record must begin before contact, with a torque near zero, "
        f"but the lowest torque is {low:.3g} Nm and the highest {highest:.3g} Nm"
    )
    return Refusal(status=SlipStatus.STARTS_IN_CONTACT, message=rule)


def _crossings(time: FloatArray, torque: FloatArray, highest: float) -> tuple[float, float, float]:
    """The times [s] at which torque rises through 5 %, through START and through 20 % of its highest value."""
    below, start, above = (
        crossing(time, torque > share * highest)
        for share in (0.05, criteria.START, 0.20)  # 5 and 20 % of a torque that rises over the whole slip
    )
    return below, start, above


def crossing(time: FloatArray, above: NDArray[np.bool_]) -> float:
    """Time [s] at which a level is crossed: the one with the fewest samples `above` [n] the level before it and below
    it after."""
    wrong = np.concatenate([[0], np.cumsum(above)]) + np.concatenate([np.cumsum(~above[::-1])[::-1], [0]])
    row = int(np.argmin(wrong))
    return float(time[max(row - 1, 0)] + time[min(row, time.size - 1)]) / 2


def _start_of(time: FloatArray, torque: FloatArray, highest: float, zero: ValueWithError) -> _Contact:
    """The start of torque: where a line through its rise passes a share of the highest torque, and where it meets zero."""
    below, start, above = _crossings(time, torque, highest)
    rows = (time >= below) & (time <= above)
    step = float(np.median(np.diff(time)))
    estimate, contact = ValueWithError(value=start, sd=step / math.sqrt(12)), below
    if np.count_nonzero(rows) >= 4:
        at, values = time[rows], torque[rows]
        middle = float(at.mean())
        square = float(np.sum((at - middle) ** 2))
        slope = float(np.sum((at - middle) * values)) / square
        if slope > 0:
            passed = middle + (criteria.START * highest - float(values.mean())) / slope
            variance = float(np.sum((values - values.mean() - slope * (at - middle)) ** 2)) / (at.size - 2)
            spread = 1 / at.size + (passed - middle) ** 2 / square
            estimate = ValueWithError(value=passed, sd=math.sqrt(variance * spread) / slope)
            contact = min(below, middle - float(values.mean()) / slope)
    return _Contact(contact=contact, start=estimate, zero=zero)
