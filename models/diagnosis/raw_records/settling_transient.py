"""Settling transients on raw dwells: torque that is still approaching its level, from all dwells of all records together.

After a step from level M_(i-1) to M_i torque that has not settled is off by a (M_(i-1) - M_i) e^{-t/τ}: its sign goes with
the step, which no drift does. Friction itself lags a step by S/C, some tenths of a second, and so do filters: transients as
fast as that may have any size, and only what no two of them explain counts. Samples are autocorrelated by ρ (pooled over a
record) and whitened by it; each dwell's own level is taken off. With I the information and s the score of a at one τ, and
a ~ N(0, S²) positive, evidence is

    ½ s²/(I + S⁻²) - ½ ln(1 + S² I) + ln 2Φ(s/√(I + S⁻²)),     averaged over τ  [nats].
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.raw_records import criteria
from models.gaussian_evidence import log_gain_alone, log_positive
from models.records.plateaus import PlateauCut
from models.records.runs import Record


@dataclass(frozen=True, slots=True, kw_only=True)
class SettlingEvidence:
    """Evidence [nats] of slow settling transients over none, their time constant τ [s] and its deviation [s]."""

    evidence: float
    time_constant: float
    deviation: float


def settling_evidence(dwells: Iterable[tuple[Record, PlateauCut]]) -> SettlingEvidence:
    """Of all dwells together."""
    times = np.array([*criteria.FAST_TIMES, *criteria.SLOW_TIMES])
    gram, along = np.zeros((times.size, times.size)), np.zeros(times.size)
    for record, cut in dwells:
        transients = list(_transients(record, cut))
        if len(transients) < 2:
            continue
        correlation = _neighbour_correlation([torque for _, torque, _ in transients])
        for time, torque, step in transients:
            columns = np.column_stack([torque, step * np.exp(-time[:, None] / times)])
            white = columns[1:] - correlation * columns[:-1]
            white = white - white.mean(axis=0)
            residual, decays = white[:, 0], white[:, 1:]
            variance = max(float(residual @ residual) / (residual.size - 1), 1e-300)
            gram += decays.T @ decays / variance
            along += decays.T @ residual / variance
    fast = len(criteria.FAST_TIMES)
    corner = gram[:fast, :fast] + 1e-9 * np.diag(np.diag(gram)[:fast]) + 1e-300 * np.eye(fast)
    by_fast = np.linalg.solve(corner, np.column_stack([gram[:fast, fast:], along[:fast]]))
    info = np.maximum(np.diag(gram[fast:, fast:] - gram[fast:, :fast] @ by_fast[:, :-1]), 0.0)
    score = along[fast:] - gram[fast:, :fast] @ by_fast[:, -1]
    logs = log_gain_alone(info, score, criteria.USUAL_SHARE) + log_positive(info, score, criteria.USUAL_SHARE)
    weights, log_times = np.exp(logs - logsumexp(logs)), np.log(criteria.SLOW_TIMES)
    middle = float(weights @ log_times)
    within = np.ptp(log_times) / (log_times.size - 1) / np.sqrt(12)  # the grid cannot tell τ closer than its spacing
    return SettlingEvidence(
        evidence=float(logsumexp(logs) - np.log(len(criteria.SLOW_TIMES))),
        time_constant=float(np.exp(middle)),
        deviation=float(np.exp(middle) * np.sqrt(weights @ (log_times - middle) ** 2 + within**2)),
    )


def _transients(record: Record, cut: PlateauCut) -> Iterator[tuple[FloatArray, FloatArray, float]]:
    """Time since the step [n] s, torque off its mean [n] Nm and the step before [Nm], of each dwell but the first."""
    means, speeds = cut.plateaus.torque, cut.plateaus.speed
    for i in range(1, means.size):
        rows = np.flatnonzero((record.time > cut.stop[i - 1]) & (record.time <= cut.stop[i]))
        distance = np.abs(record.speed[rows] - speeds[i])
        arrived = distance < criteria.SPEED_SHARE * abs(speeds[i]) + criteria.SPEED_DISTANCE
        if not arrived.any():
            continue
        begin = record.time[rows[int(np.argmax(arrived))]]
        used = rows[arrived & (record.time[rows] >= begin + criteria.FIRST_USED)]
        torque = record.torque[used]
        if torque.size >= criteria.FEWEST_DWELL_SAMPLES and np.isfinite(torque).all():
            yield record.time[used] - begin, torque - torque.mean(), float(means[i - 1] - means[i])


def _neighbour_correlation(dwells: list[FloatArray]) -> float:
    """ρ of neighbouring samples, pooled over dwells."""
    along = sum(float(torque[1:] @ torque[:-1]) for torque in dwells)
    squares = sum(float(torque @ torque) for torque in dwells)
    return float(np.clip(along / max(squares, 1e-300), 0.0, 0.98))
