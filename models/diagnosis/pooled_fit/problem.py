"""What every fit and every projection of a campaign is given: the rows, their noise, the priors of the baseline."""

from dataclasses import dataclass, replace

from models.arrays import FloatArray
from models.diagnosis.design.design import Design
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.priors import Priors


@dataclass(frozen=True, slots=True, kw_only=True)
class FitProblem:
    """A least-squares problem: design (rows and measured torque), noise (their covariance) and priors on θ; `fitted` is the
    torque [N] Nm of a fit, None before there is one."""

    design: Design
    noise: Noise
    priors: Priors
    fitted: FloatArray | None = None

    @property
    def gained(self) -> FloatArray:
        """The torque [N] Nm that gains multiply. It is the same in all fits of a problem, so that their costs compare.

        Not the measured one where a fit is at hand: a gain of it shrinks its noise and all structure as well, and to gains
        that scatter by 2 % so much was worth 14 % less torque in every run.
        """
        return self.design.torque if self.fitted is None else self.fitted

    def with_noise(self, noise: Noise) -> "FitProblem":
        """The same rows and priors under another noise."""
        return replace(self, noise=noise)
