"""What a diagnosis reports: verdict, causes, the misfit and what it depends on, what the extension gains, which test
decides.

How well a fit does is its error against the noise alone: the baseline's is that of eq. 3 taken for exact, the extended
model's that of causes beside the law as it was found. The scatter of gains is no misfit: each run's gain, and in the
same way each curve's, is taken out of its residual at its best linear prediction,

    r - M ĝ,     ĝ = σ_g² Mᵀ V⁻¹ r / (1 + σ_g² Mᵀ V⁻¹ M)

and rows weigh by their precision, so that a loop's bin of a hundred samples weighs more than one plateau's reading.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from models.diagnosis.effects.fitted_effect import AmplitudeEstimate
from models.diagnosis.experiments.test_plan import Advice
from models.diagnosis.explanations.verdict import Explanation, Verdict, Where
from models.diagnosis.extension import Extension
from models.diagnosis.pooled_fit.gauss_newton import FitStatus, PooledFit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import RunScatter, left_over
from models.diagnosis.report.friction_law import FrictionLaw
from models.diagnosis.report.maps import LoopTrace, Maps
from models.diagnosis.validation.held_out import Gain


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """The misfit of a model: rmse and noise [Nm], the share of the variance beyond noise, and the axes of the
    structure."""

    rmse: float
    noise: float
    unexplained_share: float
    where: tuple[Where, ...] = ()


def misfit_of(problem: FitProblem, fitted: PooledFit, where: Sequence[Where] = ()) -> Misfit:
    """The misfit of a fit: rmse and noise [Nm], the gains and the law's discrepancy (where the problem has one) taken
    out."""
    left = left_over(problem, fitted) / problem.noise.deviation
    actual = float((left**2).mean())
    unit = float(np.sqrt((problem.noise.deviation**-2.0).mean()))
    return Misfit(
        rmse=float(np.sqrt(actual)) / unit,
        noise=1.0 / unit,
        unexplained_share=max(0.0, 1 - 1 / actual) if actual > 0 else 0.0,
        where=tuple(where),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """An effect that competed, in the fit that it was part of."""

    effect: str
    title: str
    probability: float
    log_evidence_gain: float  # over the baseline [nats]
    estimate: AmplitudeEstimate
    # ι: the share of its information that is left beside the law's discrepancy [-]; None where it was not refitted
    isolability: float | None = None
    beside: tuple[str, ...] = ()  # the effects beside it
    fit: FitStatus | None = None  # how that fit ended, None where there is none


@dataclass(frozen=True, slots=True, kw_only=True)
class Visible:
    """The smallest amplitude of an effect that these data would have shown with 90 % power."""

    effect: str
    amplitude: float  # in whatever of its shapes (infinite where one of them would be absorbed whole)
    least: float  # in the shape that shows best
    usual: float
    unit: str
    isolability: float  # ι: the share of its information that is left beside the law's discrepancy [-]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two effects that the data may tell from each other."""

    effects: tuple[str, str]
    probability: float  # that either, if it is at work, is told from the other
    apart: bool  # whether that is sure
    # where it is not, the shortest test that is sure to part them, else the one that helps most (a key of
    # `experiments.candidates.TRIALS`; empty where none helps), in words, and the probability with it
    trial: str
    test: str
    with_trial: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Isolability:
    """Pairs of effects that a campaign shows, hardest to distinguish first, and the slugs of effects that it cannot
    show at all."""

    pairs: tuple[Pair, ...]
    unseen: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A finished diagnosis. `explanations`, most probable first, exclude each other and sum to one; none where nothing could
    be judged. `extension` is what may be adopted, None where there is nothing to adopt."""

    verdict: Verdict
    causes: tuple[str, ...] = ()
    summary: str = ""
    explanations: tuple[Explanation, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    baseline: Misfit | None = None
    extended: Misfit | None = None
    extended_effects: tuple[str, ...] = ()  # the effects of the extended model
    gain: Gain | None = None
    advice: tuple[Advice, ...] = ()
    visible: tuple[Visible, ...] = ()
    unseen: tuple[str, ...] = ()  # effects of which these data show nothing at any size
    maps: Maps | None = None
    loops: tuple[LoopTrace, ...] = ()
    #: What the friction law does otherwise than eq. 3; None where no plateau shows it.
    friction_law: FrictionLaw | None = None
    #: Causes that would explain the data and cannot be told from the form of the friction curve by these tests.
    like_the_law: tuple[str, ...] = ()
    extension: Extension | None = None
    #: Why a cause that was fitted gives nothing to adopt, in a sentence; empty where it does, or none was fitted.
    not_adoptable: str = ""
    #: Anything an engineer should know about the data: assumed noise floor, missing channels, states left out.
    notes: tuple[str, ...] = ()
    #: Numbers of the engine that a test may want: scatter of runs, evidence, odds, refits.
    statistics: Mapping[str, float] = field(default_factory=dict)
    tests: int = 0  # how many tests at how many states of use were examined
    states: int = 0
    resembles: str = ""  # the fault that what has no name most resembles, in words
    scatter: RunScatter | None = None  # the scatter of the runs' gains
    isolability: Isolability | None = None  # which causes this design could tell apart, where that was asked for
