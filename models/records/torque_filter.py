"""The torque channel's own low-pass, where the rig declares it: the channels beside it are filtered alike.

An amplifier or a recorder that smooths torque by a first-order low-pass of time constant τ_f gives y for the torque M,

    dy/dt = (M - y)/τ_f

and y belongs to the speed of some τ_f earlier: in a dynamic test that looks like friction that lags. Two ways lead back. To
deconvolve torque, M = y + τ_f dy/dt, differentiates its noise: a sample's deviation grows by some √2 τ_f/Δt, 28 times at
20 ms and 1 kHz. Here pressure and speed, which are smoother than torque, are passed through the same filter instead: no
noise grows, and a lag that both sides of a loop share drops out of it. What comes out is late by τ_f as a whole and not
deconvolved. Friction is a curved law of speed and does not commute with a filter, so that an error of second order is left:
(h ω τ_f)² for the h-th harmonic of a swing of ω rad/s, 0.02 % of a loop's area at 0.1 Hz and 20 ms, 1.6 % at 1 Hz.

Valid while the filter is fast against what is tested, ω τ_f << 1. Source: this project's; the filter is a textbook's RC
low-pass.
"""

from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.records.cleaning import clean
from models.records.runs import Record
from models.relaxation import relax


def filtered(time: FloatArray, channel: FloatArray, time_constant: float) -> FloatArray:
    """A channel [n] behind a first-order low-pass of `time_constant` > 0 s, exact where it is linear between its samples at
    time [n] s (any order, any steps). The filter is settled on the first sample.

    >>> filtered(np.array([0.0, 0.1, 0.2]), np.array([0.0, 1.0, 1.0]), 0.1).round(4).tolist()
    [0.0, 0.3679, 0.7675]
    """
    order = np.argsort(time, kind="stable")
    rate = np.full(time.size, 1.0 / time_constant)
    out = np.empty(channel.size)
    out[order] = relax(time[order], rate, channel[order], float(channel[order[0]]))
    return out


def filtered_as_torque(record: Record, time_constant: float) -> Record:
    """The record with pressure and speed behind the torque channel's filter of `time_constant` >= 0 s; 0: as it is.

    Spikes are removed before: behind the filter they would be tails that nothing tells from the channel. Temperatures are
    slower than any such filter and stay. Raises ValueError as `cleaning.clean` does.
    """
    if time_constant == 0.0:
        return record
    record, _, _ = clean(record)
    return replace(
        record,
        pressure=filtered(record.time, record.pressure, time_constant),
        speed=filtered(record.time, record.speed, time_constant),
    )
