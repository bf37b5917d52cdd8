"""Settling transients on raw dwells: torque that is still approaching its level, from all dwells of all records together.

After a step from level M_(i-1) to M_i torque that has not settled is off by a (M_(i-1) - M_i) e^{-t/τ}: its sign goes with
the step, which no drift does. Friction itself lags a step by S/C, some tenths of a second, and so do filters: transients as
fast as that may have any size, and only what no two of them explain counts. Samples are autocorrelated by ρ (pooled over a
record) and whitened by it; each dwell's own level is taken off. With I the information and s the score of a at one τ, and
a ~ N(0, S²) positive, evidence is

    ½ s²/(I + S⁻²) - ½ ln(1 + S² I) + ln 2Φ(s/√(I + S⁻²)),     averaged over τ  [nats].
"""

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.effects.fitted_effect import AmplitudeEstimate
from models.gaussian_evidence import log_gain_alone, log_positive
from models.records.plateaus import PlateauCut
from models.records.runs import Record

#: Time constants [s] of friction's own lag and of filters, whose share of a step may have any size; those that are tried.
_FAST_TIMES, _SLOW_TIMES = (0.1, 0.25), (0.8, 1.3, 2.0, 3.2, 5.0)
#: Usual share [-] of a step that remains after it.
_USUAL_SHARE = 0.2


def settling_evidence(dwells: Iterable[tuple[Record, PlateauCut]]) -> tuple[float, AmplitudeEstimate]:
    """Log Bayes factor [nats] of slow settling transients over none, from all dwells together, and their time constant
    τ [s]."""
    times = np.array([*_FAST_TIMES, *_SLOW_TIMES])
    gram, along = np.zeros((times.size, times.size)), np.zeros(times.size)
    for record, cut in dwells:
        transients = list(_transients(record, cut))
        if len(transients) < 2:
            continue
        neighbours = sum(float(torque[1:] @ torque[:-1]) for _, torque, _ in transients)
        squares = sum(float(torque @ torque) for _, torque, _ in transients)
        correlation = np.clip(neighbours / max(squares, 1e-300), 0.0, 0.98)  # of neighbouring samples
        for time, torque, step in transients:
            columns = np.column_stack([torque, step * np.exp(-time[:, None] / times)])
            white = columns[1:] - correlation * columns[:-1]
            white = white - white.mean(axis=0)
            residual, decays = white[:, 0], white[:, 1:]
            variance = max(float(residual @ residual) / (residual.size - 1), 1e-300)
            gram += decays.T @ decays / variance
            along += decays.T @ residual / variance
    fast = len(_FAST_TIMES)
    corner = gram[:fast, :fast] + 1e-9 * np.diag(np.diag(gram)[:fast]) + 1e-300 * np.eye(fast)
    by_fast = np.linalg.solve(corner, np.column_stack([gram[:fast, fast:], along[:fast]]))
    info = np.maximum(np.diag(gram[fast:, fast:] - gram[fast:, :fast] @ by_fast[:, :-1]), 0.0)
    score = along[fast:] - gram[fast:, :fast] @ by_fast[:, -1]
    logs = log_gain_alone(info, score, _USUAL_SHARE) + log_positive(info, score, _USUAL_SHARE)
    weights, log_times = np.exp(logs - logsumexp(logs)), np.log(_SLOW_TIMES)
    middle = float(weights @ log_times)
    within = np.ptp(log_times) / (log_times.size - 1) / np.sqrt(12)  # the grid cannot tell τ closer than its spacing
    return float(logsumexp(logs) - np.log(len(_SLOW_TIMES))), AmplitudeEstimate(
        name="settling time constant",
        value=float(np.exp(middle)),
        sd=float(np.exp(middle) * np.sqrt(weights @ (log_times - middle) ** 2 + within**2)),
        unit="s",
        one_sided=True,
    )


def _transients(record: Record, cut: PlateauCut) -> Iterator[tuple[FloatArray, FloatArray, float]]:
    """The transient of each dwell but the first: time since the step [n] s, torque minus its mean [n] Nm, and the step
    before [Nm]."""
    means, speeds = cut.plateaus.torque, cut.plateaus.speed
    for i in range(1, means.size):
        rows = np.flatnonzero((record.time > cut.stop[i - 1]) & (record.time <= cut.stop[i]))
        distance = np.abs(record.speed[rows] - speeds[i])
        arrived = distance < 0.01 * abs(speeds[i]) + 0.2
        if not arrived.any():
            continue
        begin = record.time[rows[int(np.argmax(arrived))]]
        used = rows[arrived & (record.time[rows] >= begin + 0.3)]  # before, the rig's ramp is not over
        torque = record.torque[used]
        if torque.size >= 20 and np.isfinite(torque).all():
            yield record.time[used] - begin, torque - torque.mean(), float(means[i - 1] - means[i])
