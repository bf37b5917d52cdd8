"""Where an engagement slips: the contact, the start and the end of slip, and what the sensors read at zero.

    t_contact   where the line through the rising torque comes from zero
    t_start     where torque passes 10 % of its highest value
    t_end       where speed comes to rest (`standstill`)

Speed counts from b, which it keeps at standstill; torque from its level before contact, which is the sensor's zero and the
open clutch's drag. Signs are those of a slip that dissipates: both channels are turned where they read the other way.

A moment at which a rising torque passes a level is the one that leaves the fewest samples on the wrong side; where samples
show the rise a line through them refines it. Source: this project's definitions; those of SAE J1646 and J2490 were not read.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.engagements import criteria
from models.engagements.local_fit import Estimate
from models.engagements.refusal import Refusal, SlipStatus
from models.engagements.standstill import standstill_of
from models.records.criteria import UNLOADED
from models.records.runs import Record

#: Half of all normal deviates are smaller than this. Derived: Φ⁻¹(0.75).
_NORMAL_QUARTILE = 0.6745


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip:
    """An engagement's record freed of its sensors' zeros: time [n] s, pressure [n] Pa, speed [n] rad/s, torque [n] Nm, and
    where it slips: contact [s], start and end [s], the highest torque [Nm] and the zero of torque [Nm].

    `again` [s] is when slip begins again after the standstill; None where it does not.
    """

    time: FloatArray
    pressure: FloatArray
    speed: FloatArray
    torque: FloatArray
    contact: float
    start: Estimate
    end: Estimate
    highest_torque: float
    open_torque: Estimate
    again: float | None

    @property
    def duration(self) -> Estimate:
        """From start to end of slip [s]."""
        return Estimate(value=self.end.value - self.start.value, sd=math.hypot(self.start.sd, self.end.sd))

    def between(self, low: float, high: float) -> NDArray[np.bool_]:
        """Which samples [n] lie from `low` to `high` [s], both included."""
        return (self.time >= low) & (self.time <= high)


def slip_of(record: Record) -> Slip | Refusal:
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
        rule = f"samples are missing for {gap:.3g} s of a slip of {duration:.3g} s, more than {most:g} %"
        return Refusal(status=SlipStatus.GAP, message=rule)
    return Slip(
        time=record.time,
        pressure=record.pressure,
        speed=speed - stop.zero,
        torque=torque - contact.zero.value,
        contact=contact.contact,
        start=contact.start,
        end=stop.end,
        highest_torque=contact.highest,
        open_torque=contact.zero,
        again=stop.again,
    )


def _unusable(record: Record) -> Refusal | None:
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
        rule = f"the clutch must be loaded, the highest pressure is {highest:.3g} bar"
        return Refusal(status=SlipStatus.NO_PRESSURE, message=rule)
    if float(np.ptp(record.torque)) == 0.0:
        rule = f"torque must rise, it is {record.torque[0]:g} Nm throughout"
        return Refusal(status=SlipStatus.NO_TORQUE, message=rule)
    return None


def _sign(values: FloatArray) -> float:
    """-1 where the values are negative by and large."""
    return -1.0 if float(values.sum()) < 0 else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Contact:
    """Contact and start of slip [s], the highest torque [Nm] above that before contact, and that."""

    contact: float
    start: Estimate
    highest: float
    zero: Estimate


def _contact_of(time: FloatArray, torque: FloatArray, slowing: int) -> _Contact | Refusal:
    """From the rows before the end of slip; the shaft is fast up to row `slowing`."""
    from scipy.ndimage import uniform_filter1d  # start-up time: what answers cuts no record

    smooth = uniform_filter1d(torque, max(3, (time.size - slowing) // 100), mode="nearest")
    highest_row = int(np.argmax(smooth))
    highest = float(smooth[highest_row])
    low = float(smooth[: max(highest_row, 1)].min())
    noise = float(np.median(np.abs(np.diff(torque, 2)))) / (_NORMAL_QUARTILE * math.sqrt(6))
    never_open = abs(low) > 0.2 * (highest - low)  # above a sensor's zero and an open clutch's drag together
    if highest - low <= criteria.LEAST_RISE * noise and not (never_open and highest > criteria.LEAST_RISE * noise):
        rule = f"torque must rise above its noise of {noise:.3g} Nm, it rises by {highest - low:.3g} Nm"
        return Refusal(status=SlipStatus.NO_TORQUE, message=rule)
    rising = slice(0, highest_row + 1)
    if not never_open:
        crossings = _crossings(time[rising], torque[rising] - low, highest - low)
        open_rows = time < 2 * crossings[0] - crossings[1]
        if np.count_nonzero(open_rows) >= 3:
            quiet = torque[open_rows]
            zero = Estimate(value=float(quiet.mean()), sd=float(quiet.std(ddof=1)) / math.sqrt(quiet.size))
            return _start_of(time[rising], torque[rising] - zero.value, highest - zero.value, zero)
    rule = (
        "the record must begin before contact: torque is never near zero before it rises, "
        f"the lowest is {low:.3g} Nm and the highest {highest:.3g} Nm"
    )
    return Refusal(status=SlipStatus.STARTS_IN_CONTACT, message=rule)


def _crossings(time: FloatArray, torque: FloatArray, highest: float) -> tuple[float, float, float]:
    below, start, above = (
        crossing(time, torque > share * highest)
        for share in (0.05, criteria.START, 0.20)  # 5 and 20 % of a torque that rises over the whole slip
    )
    return below, start, above


def crossing(time: FloatArray, above: NDArray[np.bool_]) -> float:
    """The moment that leaves the fewest samples [n] above a level before it and below it after."""
    wrong = np.concatenate([[0], np.cumsum(above)]) + np.concatenate([np.cumsum(~above[::-1])[::-1], [0]])
    row = int(np.argmin(wrong))
    return float(time[max(row - 1, 0)] + time[min(row, time.size - 1)]) / 2


def _start_of(time: FloatArray, torque: FloatArray, highest: float, zero: Estimate) -> _Contact:
    below, start, above = _crossings(time, torque, highest)
    rows = (time >= below) & (time <= above)
    step = float(np.median(np.diff(time)))
    estimate, contact = Estimate(value=start, sd=step / math.sqrt(12)), below
    if np.count_nonzero(rows) >= 4:
        at, values = time[rows], torque[rows]
        middle = float(at.mean())
        square = float(np.sum((at - middle) ** 2))
        slope = float(np.sum((at - middle) * values)) / square
        if slope > 0:
            passed = middle + (criteria.START * highest - float(values.mean())) / slope
            variance = float(np.sum((values - values.mean() - slope * (at - middle)) ** 2)) / (at.size - 2)
            spread = 1 / at.size + (passed - middle) ** 2 / square
            estimate = Estimate(value=passed, sd=math.sqrt(variance * spread) / slope)
            contact = min(below, middle - float(values.mean()) / slope)
    return _Contact(contact=contact, start=estimate, highest=highest, zero=zero)
