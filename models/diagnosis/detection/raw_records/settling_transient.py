"""What raw dwells show of torque that still approaches its level: all dwells of all records asked together.

After a step from level M_(i-1) to M_i torque that has not settled is off by a (M_(i-1) - M_i) e^{-t/τ}: its sign goes with
the step, which no drift does. Friction itself lags a step by S/C, some tenths of a second, and so do filters: approaches as
fast as that may have any size, and only what no two of them explain counts. Samples remember their neighbours by ρ (pooled
over a record) and are freed of that; each dwell's own level is taken off. With I the information and s the score of a at one
τ, and a ~ N(0, S²) positive, evidence is

    ½ s²/(I + S⁻²) - ½ ln(1 + S² I) + ln 2Φ(s/√(I + S⁻²)),     averaged over τ  [nats].
"""

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.special import log_ndtr, logsumexp

from models.arrays import FloatArray
from models.records.plateaus import PlateauCut
from models.records.runs import Record

#: Time constants [s] of approaches that are friction's own or a filter's, and those that are tried.
FAST, TIMES = (0.1, 0.25), (0.8, 1.3, 2.0, 3.2, 5.0)
#: The usual share of a step that is left after it [-].
USUAL_SHARE = 0.2
#: After a step torque is looked at from here on [s]: before, the rig's ramp is not over.
FIRST = 0.3
#: Samples at the dwell's own speed: within this share of it and so much [rad/s].
SPEED_SHARE, SPEED_NEAR = 0.01, 0.2
_FEWEST_SAMPLES = 20


def approach(dwells: Iterable[tuple[Record, PlateauCut]]) -> tuple[float, float]:
    """Evidence [nats] of torque that approaches its level on dwells, over none, and the likeliest time constant [s]."""
    times = np.array([*FAST, *TIMES])
    gram, along = np.zeros((times.size, times.size)), np.zeros(times.size)
    for record, cut in dwells:
        pieces = list(_pieces(record, cut))
        if len(pieces) < 2:
            continue
        memory = _memory([torque for _, torque, _ in pieces])
        for time, torque, step in pieces:
            columns = np.column_stack([torque, step * np.exp(-time[:, None] / times)])
            fresh = columns[1:] - memory * columns[:-1]
            fresh = fresh - fresh.mean(axis=0)
            left, waves = fresh[:, 0], fresh[:, 1:]
            variance = max(float(left @ left) / (left.size - 1), 1e-300)
            gram += waves.T @ waves / variance
            along += waves.T @ left / variance
    fast = len(FAST)
    corner = gram[:fast, :fast] + 1e-9 * np.diag(np.diag(gram)[:fast]) + 1e-300 * np.eye(fast)
    taken = np.linalg.solve(corner, np.column_stack([gram[:fast, fast:], along[:fast]]))
    info = np.maximum(np.diag(gram[fast:, fast:] - gram[fast:, :fast] @ taken[:, :-1]), 0.0)
    score = along[fast:] - gram[fast:, :fast] @ taken[:, -1]
    precision = info + USUAL_SHARE**-2.0
    logs = 0.5 * score**2 / precision - 0.5 * np.log(precision * USUAL_SHARE**2)
    logs = logs + np.log(2.0) + log_ndtr(score / np.sqrt(precision))
    return float(logsumexp(logs) - np.log(len(TIMES))), TIMES[int(np.argmax(logs))]


def _pieces(record: Record, cut: PlateauCut) -> Iterator[tuple[FloatArray, FloatArray, float]]:
    """Time since the step [n] s, torque off its mean [n] Nm and the step before [Nm], of each dwell but the first."""
    means, speeds = cut.plateaus.torque, cut.plateaus.speed
    for i in range(1, means.size):
        rows = np.flatnonzero((record.time > cut.stop[i - 1]) & (record.time <= cut.stop[i]))
        off = np.abs(record.speed[rows] - speeds[i])
        there = off < SPEED_SHARE * abs(speeds[i]) + SPEED_NEAR
        if not there.any():
            continue
        begin = record.time[rows[int(np.argmax(there))]]
        chosen = rows[there & (record.time[rows] >= begin + FIRST)]
        torque = record.torque[chosen]
        if torque.size >= _FEWEST_SAMPLES and np.isfinite(torque).all():
            yield record.time[chosen] - begin, torque - torque.mean(), float(means[i - 1] - means[i])


def _memory(series: list[FloatArray]) -> float:
    """ρ of neighbouring samples, pooled."""
    along = sum(float(each[1:] @ each[:-1]) for each in series)
    whole = sum(float(each @ each) for each in series)
    return float(np.clip(along / max(whole, 1e-300), 0.0, 0.98))
