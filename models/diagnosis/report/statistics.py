"""Numbers of the computation in a report, by public name."""

import numpy as np

from models.diagnosis.explanations.alternative import NOTHING
from models.diagnosis.explanations.posterior import Posterior
from models.diagnosis.explanations.verdict import Judgement
from models.diagnosis.pooled_fit.run_scatter import RunScatter


def statistics_of(posterior: Posterior, judgement: Judgement, scatter: RunScatter) -> dict[str, float]:
    """All finite numbers: the scatter from run to run, the log evidence [nats] of what is likeliest over nothing and the
    same with its prior, the evidence of the strongest axis, refits."""
    probabilities = posterior.probabilities
    best = next(iter(probabilities))
    numbers = {
        "run_scatter": scatter.median,
        "run_scatter_lower": scatter.lower,
        "run_scatter_upper": scatter.upper,
        "run_scatter_information": scatter.information,
        "probability_nothing": probabilities[NOTHING],
        "log_evidence": posterior.weights[best] - posterior.prior(best),
        "log_posterior_odds": posterior.weights[best],
        "structure": judgement.where[0].strength if judgement.where else 0.0,
        "refits": float(posterior.refits),
    }
    return {name: value for name, value in numbers.items() if np.isfinite(value)}
