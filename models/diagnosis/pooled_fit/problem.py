"""What every fit and every projection of a campaign is given: the rows, their noise, the priors of the baseline."""

from dataclasses import dataclass, replace

from models.diagnosis.design.design import Design
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.priors import Priors


@dataclass(frozen=True, slots=True, kw_only=True)
class FitProblem:
    """A least-squares problem: design (rows and measured torque), noise (their covariance) and priors on θ."""

    design: Design
    noise: Noise
    priors: Priors

    def with_noise(self, noise: Noise) -> "FitProblem":
        """The same rows and priors under another noise."""
        return replace(self, noise=noise)
