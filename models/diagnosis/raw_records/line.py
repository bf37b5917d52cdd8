"""A swing that stands out of the noise, at an order of the shaft or at a fixed frequency."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """evidence [nats], averaged over everything tried; position, the order [per revolution] or the frequency [Hz];
    amplitude [Nm]; speed_share, the share of the highest speed below which it acts; peak, the largest log likelihood
    ratio [nats]. Without arguments: no line."""

    evidence: float = 0.0
    position: float = 0.0
    amplitude: float = 0.0
    speed_share: float = 1.0
    peak: float = 0.0
