"""By which power of its work a duty cycle ages a clutch: estimated within one life, where its duty varies.

A law that runs over accumulated damage, ζ = ∫ (w/w_ref)^q dn, bends where the work w changes, and by how much depends on q.
Each of a few exponents gives the tests other ζ, and the exact filter gives the probability of the tests along them, with
all else summed out: coefficients, courses, discrepancy, scatter, outlying runs. All exponents are as probable before. The
discrepancy may take a bend for its own, so nothing is concluded from a bend that is within it.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.degradation.severity import Severity, SeverityBasis
from models.prognosis.criteria import FEWEST_TESTS
from models.tracking.filters.grid import Grid
from service.clutch.assumptions import WEAK, Assumptions
from service.clutch.criteria import SEVERITY_DOUBTED, SEVERITY_EXPONENTS, VARIED_WORK
from service.clutch.timeline import Life
from service.errors import Notice

_GRID = Grid()


@dataclass(frozen=True, slots=True, kw_only=True)
class SeverityPosterior:
    """The posterior probability [k] of each of SEVERITY_EXPONENTS, for the work named by `basis`."""

    basis: SeverityBasis
    probability: FloatArray

    @property
    def mean(self) -> float:
        return float(self.probability @ np.array(SEVERITY_EXPONENTS))

    @property
    def deviation(self) -> float:
        return float(np.sqrt(self.probability @ (np.array(SEVERITY_EXPONENTS) - self.mean) ** 2))

    @property
    def likeliest(self) -> float:
        return SEVERITY_EXPONENTS[int(self.probability.argmax())]

    def doubts(self, counted: Severity) -> list[Notice]:
        """A warning if the exponent counted by ζ (0 if it counts cycles) is improbable compared with the others."""
        in_force = 0.0 if counted.basis is SeverityBasis.CYCLES else counted.exponent
        if in_force not in SEVERITY_EXPONENTS:
            return []
        probability = float(self.probability[SEVERITY_EXPONENTS.index(in_force)])
        if probability >= SEVERITY_DOUBTED:
            return []
        work = self.basis.value.replace("_", " ")
        message = (
            f"by the tests, wear grows with {work} to the power of {self.likeliest:g} (probability "
            f"{self.probability.max():.0%}), but `severity` of the clutch states {in_force:g} ({probability:.0%})"
        )
        return [Notice(code="severity_exponent", message=message)]


def severity_estimate(life: Life, assumptions: Assumptions) -> SeverityPosterior | None:
    """The posterior of a life's severity exponent, under its assumptions of tracking except the severity.

    None if its duty states no work or hardly varies, or if it has too few tests, because then the data cannot
    distinguish exponents. The work is the one counted by the record, or dissipated energy if that counts cycles.
    """
    basis = assumptions.severity.basis
    if basis is SeverityBasis.CYCLES:
        basis = SeverityBasis.DISSIPATED_ENERGY
    works = [work for event in life.events if event.duty is not None and (work := event.duty.work(basis))]
    if not works or max(works) <= VARIED_WORK * min(works):
        return None
    log_evidence = []
    for exponent in SEVERITY_EXPONENTS:
        under = replace(assumptions, severity=Severity(basis=basis, exponent=exponent))
        series = life.pooled(under)
        if len({measurement.progress for measurement in series.measurements}) <= FEWEST_TESTS:
            return None
        prior = under.priors(series.quantity, series.measurements[0], series.scale)[WEAK]
        log_evidence.append(_GRID.laid(_GRID.from_merged(prior, series.measurements)).log_evidence)
    share = np.exp(np.array(log_evidence) - max(log_evidence))
    return SeverityPosterior(basis=basis, probability=share / share.sum())
