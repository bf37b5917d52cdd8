"""The extended model of a judgement: the effects that it names, fitted together; its gain is that of `held_out`."""

from dataclasses import dataclass

import numpy as np

from models.diagnosis.explanations.verdict import HeldOut, Judgement, Verdict
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.validation.held_out import Gain, measure_gain
from models.diagnosis.validation.smooth_correction import AXES, smooth_fit


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """The extended model (None where there is nothing to extend by) and its gain (None where nothing can be held out)."""

    extended: Fit | None
    gain: Gain | None

    @property
    def held_out(self) -> HeldOut | None:
        """What a judgement is revised by."""
        if self.gain is None:
            return None
        return HeldOut(
            rmse_before=self.gain.rmse_before,
            rmse_after=self.gain.rmse_after,
            log_score_gain=self.gain.log_score_gain,
            forecast_log_score_gain=self.gain.forecast_log_score_gain,
        )


def validate(problem: FitProblem, baseline: Fit, judgement: Judgement, rng: np.random.Generator) -> Validation:
    """Extend the baseline by the likeliest causes, or by a smooth correction on the axes of unexplained structure."""
    extended = judgement.stand[0].fit if judgement.stand else None
    if judgement.verdict is Verdict.UNEXPLAINED_STRUCTURE:
        extended = smooth_fit(problem, baseline, [axis.axis for axis in judgement.where if axis.axis in AXES])
    gain = None if extended is None else measure_gain(problem, baseline, extended, rng)
    return Validation(extended=extended, gain=gain)
