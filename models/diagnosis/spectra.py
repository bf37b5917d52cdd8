"""Raw torque cut into windows of steady speed, and the power of lines in them against the noise about them.

For a window x of n samples, Hann-weighted and padded, P(f) is its periodogram; z(f) = P(f)/noise(f), with noise(f) an
autoregression's spectrum of all windows together times the median of what is left about f, over ln 2. Under noise z is
exponential with mean 1; under a line of amplitude A it is non-central,

    z ~ ½ χ'²(2, 2λ),    λ = A² (Σ w)² / (4 noise),    log L(A)/L(0) = log I0(2 √(z λ)) - λ          (Rice)

whatever the line's phase, which no window knows of another.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.special import i0e

from models.arrays import FloatArray
from models.runs import Record

#: Periodograms are padded to so many times the window, and noise is judged over so many bins of the unpadded one.
PADDING, NEIGHBOURS = 4, 16
#: Bins next to a line that its own window spreads it over.
OWN = 2
#: Below this many bins of the unpadded periodogram slow noise and transients reign.
SLOWEST = 4
#: Order of the autoregression that takes the slope out of the spectrum.
MEMORY = 3
#: Revolutions of a window by angle, and the least speed in it as a share of the record's highest.
TURNS, FAST = 64.0, 0.15
#: Samples that may be missing in a row.
GAP = 5
#: Amplitudes tried, as multiples of the one that a window shows at λ = 1.
AMPLITUDES = np.geomspace(0.05, 20.0, 15)


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """Power over noise z [w, f] at frequency [f]: per second, or per revolution in windows by angle.

    `turns` [w] is the shaft's revolutions per that unit, `hertz` [w] what a frequency of 1 is in Hz. `gain` [w, f] is λ of
    a line of 1 Nm: (Σ w)²/(4 noise).
    """

    frequency: FloatArray
    z: FloatArray
    gain: FloatArray
    turns: FloatArray
    hertz: FloatArray


def evenly(time: FloatArray, value: FloatArray, step: float) -> FloatArray:
    """value [n] at time [n] on an even grid of `step`; gaps are bridged."""
    return np.asarray(np.interp(np.arange(time[0], time[-1] + 0.5 * step, step), time, value))


def _sampled(record: Record, step: float) -> FloatArray:
    """[n]: 0 on either side of a gap of more than GAP steps, else 1."""
    gap = np.diff(record.time) > GAP * step
    return np.where(np.append(gap, False) | np.append(False, gap), 0.0, 1.0)


def in_time(record: Record, spans: FloatArray, length: float) -> Windows | None:
    """Windows of `length` s that lie within spans [s, 2] s; None where there are none, or of too few samples."""
    step = float(np.median(np.diff(record.time)))
    count = round(length / step)
    if count < 8 * SLOWEST:
        return None
    sampled = _sampled(record, step)
    rows: list[FloatArray] = []
    speeds: list[float] = []
    for start, stop in spans:
        low, high = np.searchsorted(record.time, (start, stop))
        if high - low < 0.8 * count:
            continue
        torque = evenly(record.time[low:high], record.torque[low:high], step)
        speed = evenly(record.time[low:high], record.speed[low:high], step)
        whole = evenly(record.time[low:high], sampled[low:high], step)
        for first in range(0, torque.size - count + 1, count):
            if whole[first : first + count].min() > 0:
                rows.append(torque[first : first + count])
                speeds.append(float(np.abs(speed[first : first + count]).mean()))
    if not rows:
        return None
    turns = np.array(speeds) / (2 * np.pi)
    return _spectra(np.array(rows), step, turns, np.ones(turns.size))


def in_angle(record: Record) -> Windows | None:
    """Windows of TURNS revolutions of a record whose speed swings, where the shaft is not slow, if there are any."""
    step = float(np.median(np.diff(record.time)))
    speed = np.abs(record.speed) / (2 * np.pi)
    highest = float(speed.max())
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(record.time))])
    pitch = highest * step
    count = round(TURNS / pitch) if pitch > 0 else 0
    if count < 8 * SLOWEST:
        return None
    rows: list[FloatArray] = []
    rates: list[float] = []
    places = np.arange(0.0, angle[-1], pitch)
    torque, rate = np.interp(places, angle, record.torque), np.interp(places, angle, speed)
    rate *= np.interp(places, angle, _sampled(record, step)) > 0
    for first in range(0, places.size - count + 1, count):
        if rate[first : first + count].min() > FAST * highest:
            rows.append(torque[first : first + count])
            rates.append(float(rate[first : first + count].mean()))
    return _spectra(np.array(rows), pitch, np.ones(len(rows)), np.array(rates)) if rows else None


def _spectra(torque: FloatArray, step: float, turns: FloatArray, hertz: FloatArray) -> Windows | None:
    """z of windows torque [w, n], free of a parabola each; frequencies from SLOWEST bins to 0.45 of the rate, if any."""
    size = torque.shape[1]
    place = np.linspace(-1.0, 1.0, size)
    smooth = np.linalg.qr(np.stack([np.ones(size), place, place**2], axis=1))[0]
    rest = torque - (torque @ smooth) @ smooth.T
    weight = np.hanning(size)
    power = np.abs(np.fft.rfft(rest * weight, PADDING * size, axis=1)) ** 2
    frequency = np.fft.rfftfreq(PADDING * size, step)
    least = 1e-12 * float(power.max())
    if not least > 1e-100:
        return None
    inside = (frequency >= SLOWEST / (size * step)) & (frequency <= 0.45 / step)
    slope = np.maximum(_autoregression(np.median(power, axis=0)), least)[inside]
    flat, frequency = np.maximum(power[:, inside], least) / slope, frequency[inside]
    noise = _local(flat)
    return Windows(
        frequency=frequency,
        z=flat / noise,
        gain=float(weight.sum()) ** 2 / (4.0 * noise * slope),
        turns=turns,
        hertz=hertz,
    )


def _autoregression(power: FloatArray) -> FloatArray:
    """The spectrum [f] of the autoregression (Yule-Walker) whose autocovariance is that of a spectrum [f]."""
    covariance = np.fft.irfft(power)[: MEMORY + 1]
    if not covariance[0] > 0:
        return power
    past = solve_toeplitz(covariance[:-1] + np.array([1e-9, 0.0, 0.0]) * covariance[0], covariance[1:])
    turn = np.exp(-1j * np.pi * np.linspace(0.0, 1.0, power.size)[:, np.newaxis] * np.arange(1, MEMORY + 1))
    return np.asarray(1.0 / np.abs(1.0 - turn @ past) ** 2 * float(covariance[0] - past @ covariance[1:]))


def _local(power: FloatArray) -> FloatArray:
    """[w, f] over ln 2: the median of power [w, f] in blocks of NEIGHBOURS bins, drawn through their middles in the log."""
    size = power.shape[1]
    blocks = max(1, size // (NEIGHBOURS * PADDING))
    edges = np.linspace(0, size, blocks + 1).astype(int)
    medians = np.stack([np.median(power[:, a:b], axis=1) for a, b in itertools.pairwise(edges)], axis=1)
    if blocks == 1:
        return np.repeat(medians / np.log(2.0), size, axis=1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    low = np.clip(np.searchsorted(middle, np.arange(size)) - 1, 0, blocks - 2)
    share = (np.arange(size) - middle[low]) / (middle[low + 1] - middle[low])  # beyond the outermost middles it goes on
    logs = np.log(np.maximum(medians, 1e-300))
    return np.asarray(np.exp((1 - share) * logs[:, low] + share * logs[:, low + 1]) / np.log(2.0))


def rice(z: FloatArray, lam: FloatArray) -> FloatArray:
    """log L(A)/L(0) of power over noise z >= 0 at λ >= 0, broadcast."""
    root = 2.0 * np.sqrt(z * lam)
    return np.asarray(np.log(i0e(root)) + root - lam, dtype=np.float64)


def amplitudes(windows: Windows) -> FloatArray:
    """Amplitudes [a] Nm worth trying: about the one at which a typical window shows λ = 1."""
    return np.asarray(AMPLITUDES / np.sqrt(max(float(np.median(windows.gain)), 1e-300)), dtype=np.float64)
