"""The prior of an effect's amplitude: most are small, a few are large.

    p(a) ∝ (1 + a²/(ν s²))^{-(ν + 1)/2}

with s the effect's prior deviation and ν its tails (Student's t; normal where ν is infinite). A normal prior would cost an
effect of six deviations 18 nats, and an effect that imitates it with a small amplitude would be named instead.
"""

import math

from models.diagnosis.effects.effect import Effect

#: Deviations of the two normal distributions that approximate p where everything is linear, in s; each has half the weight
#: (chosen; no table).
SCALES = (1.0, 6.0)


def cost(effect: Effect, amplitude: float) -> float:
    """-ln p(a)/p(0) [nats]."""
    squared = (amplitude / effect.prior_sd) ** 2
    if math.isinf(effect.tails):
        return 0.5 * squared
    return 0.5 * (effect.tails + 1.0) * math.log1p(squared / effect.tails)


def precision(effect: Effect, amplitude: float) -> float:
    """(d cost/da)/a, in 1/unit²: what a normal prior with the same slope at a would have."""
    if math.isinf(effect.tails):
        return float(effect.prior_sd**-2.0)
    return float((effect.tails + 1.0) / (effect.tails * effect.prior_sd**2 + amplitude**2))


def log_peak(effect: Effect) -> float:
    """ln(p(0) √(2π)) [nats], with a in its unit."""
    peak = -math.log(effect.prior_sd)
    if math.isinf(effect.tails):
        return peak
    half = 0.5 * effect.tails
    return peak + math.lgamma(half + 0.5) - math.lgamma(half) - 0.5 * math.log(half)
