"""Severity: what a clutch has been through, counted as cycles, as sliding distance or as dissipated energy.

Eq. 6 is general-order kinetics, dD/dζ = -k Dⁿ, and the severity of the load enters through the rate k. A block of duty whose
cycles are w times as severe as a reference cycle therefore counts w times:

    ζ(N) = ∫ (w(n)/w_ref)^q dn

with N the duty cycles, w the sliding distance or the energy [J] of one cycle and q an exponent. The distance is given as
an angle [rad]: the mean radius, the same in all of a clutch's cycles, cancels. ζ is still counted in cycles, those of the
first block that states its severity. It is piecewise linear; beyond the last block it continues at the rate of recent
duty, and so remaining cycles are cycles of recent duty; or by a planned `DutyProgramme` of blocks that is run over and over.
The work of a planned block may be uncertain, and is then log-normal, the same at every pass of the programme.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, eq. 6; J. F. Archard, J. Appl. Phys. 24 (1953) 981-988, for
wear by work done.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from models.arrays import FloatArray, require_finite
from models.degradation.general_order import Number


class SeverityBasis(StrEnum):
    """The quantity that ζ counts."""

    CYCLES = "cycles"
    SLIDING_DISTANCE = "sliding_distance"
    DISSIPATED_ENERGY = "dissipated_energy"


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A block of duty cycles that ends at `end` cycles; the energy [J] of one cycle, its initial speed [rad/s] and
    duration [s] where stated.

    Raises ValueError where `cycles` is not positive or another number is negative or not finite.
    """

    end: float
    cycles: float
    energy: float | None = None
    speed: float | None = None
    duration: float | None = None

    def __post_init__(self) -> None:
        require_finite(self, ("end", "cycles", "energy", "speed", "duration"))
        if self.cycles == 0.0:
            raise ValueError("cycles must be positive, got 0")

    def since(self, origin: float) -> "Block":
        """The block with its cycles counted from `origin` < end."""
        return replace(self, end=self.end - origin)

    def work(self, basis: SeverityBasis) -> float | None:
        """The energy [J] or the slid angle [rad] of one cycle; None where the block does not state it.

        The speed falls evenly to rest, so the angle is ω t/2, with t = ω/(200 rad/s²) where it is not stated.
        """
        if basis is SeverityBasis.DISSIPATED_ENERGY:
            return self.energy
        if self.speed is None:
            return None
        # where a block does not say how long: 200 rad/s², 2,000 rpm in about one second
        return 0.5 * self.speed * (self.speed / 200.0 if self.duration is None else self.duration)


@dataclass(frozen=True, slots=True, kw_only=True)
class Severity:
    """The quantity that ζ counts, and the exponent q in [0, 10] by which severity enters."""

    basis: SeverityBasis = SeverityBasis.CYCLES
    exponent: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.exponent <= 10.0:
            raise ValueError(f"exponent must lie between 0 and 10, got {self.exponent}")


@dataclass(frozen=True, slots=True, kw_only=True)
class SeverityMap:
    """A piecewise linear map of cycles to ζ: knots (cycles [k], zeta [k]), both ascending from 0, `rate` dζ/dN beyond.

    A cycle of ζ is worth `unit` cycles of standard work: by it the ζ of clutches can be compared. `reference` is the work of
    a cycle [J] or [rad] that counts as one, None where ζ is the count of cycles.
    """

    cycles: FloatArray
    zeta: FloatArray
    rate: float
    unit: float = 1.0
    reference: float | None = None

    def progress(self, cycles: Number) -> FloatArray:
        """Progress ζ at cycles >= 0, any shape."""
        at = np.asarray(cycles, dtype=np.float64)
        beyond = np.maximum(at - self.cycles[-1], 0.0)
        return np.asarray(np.interp(at, self.cycles, self.zeta) + self.rate * beyond)

    def cycles_at(self, progress: Number) -> FloatArray:
        """Cycles at progress ζ >= 0, the inverse of `progress`; inf where ζ is."""
        at = np.asarray(progress, dtype=np.float64)
        beyond = np.maximum(at - self.zeta[-1], 0.0)
        return np.asarray(np.interp(at, self.zeta, self.cycles) + beyond / self.rate)


#: ζ is the count of cycles.
IDENTITY = SeverityMap(cycles=np.zeros(1), zeta=np.zeros(1), rate=1.0)


def severity_map(severity: Severity, blocks: Sequence[Block]) -> SeverityMap:
    """The map of cycles to ζ for blocks in any order; cycles that no block covers are as severe as the rest on average.

    Where blocks overlap the one that ends first counts. The identity where ζ counts cycles, or no block states its severity.
    """
    if severity.basis is SeverityBasis.CYCLES:
        return IDENTITY
    ordered = sorted(blocks, key=lambda block: block.end)
    pieces = _pieces(ordered, [block.work(severity.basis) for block in ordered])
    reference = next((work for _, work in pieces if work), None)
    if reference is None:
        return IDENTITY
    rates = [None if work is None else float(counted(work, reference, severity.exponent)) for _, work in pieces]
    lengths = np.array([length for length, _ in pieces])
    filled = np.array([math.nan if rate is None else rate for rate in rates])
    stated = ~np.isnan(filled)
    filled[~stated] = np.average(filled[stated], weights=lengths[stated])
    # what an engagement of the life test dissipates about [J], and how far it slides [rad]
    standard = 20e3 if severity.basis is SeverityBasis.DISSIPATED_ENERGY else 100.0
    return SeverityMap(
        cycles=np.concatenate([[0.0], np.cumsum(lengths)]),
        zeta=np.concatenate([[0.0], np.cumsum(lengths * filled)]),
        rate=_recent(lengths, filled),
        unit=(reference / standard) ** severity.exponent,
        reference=reference,
    )


def counted(work: Number, reference: float, exponent: float) -> FloatArray:
    """Weight of a cycle by its work >= 0 relative to the reference's > 0, (work/reference)^exponent within
    1e-3 ... 1e3, any shape."""
    # a mistyped energy must not end or stop a life
    return np.clip((np.asarray(work, dtype=np.float64) / reference) ** exponent, 1e-3, 1e3)


def _pieces(ordered: Sequence[Block], works: Sequence[float | None]) -> list[tuple[float, float | None]]:
    """Lengths [cycles] and works of pieces from 0 to the end of the last block, without overlaps; None as work where no
    severity is stated."""
    pieces: list[tuple[float, float | None]] = []
    reached = 0.0
    for block, work in zip(ordered, works, strict=True):
        start = max(block.end - block.cycles, reached)
        if start > reached:
            pieces.append((start - reached, None))
        if block.end > start:
            pieces.append((block.end - start, work))
        reached = max(reached, block.end)
    return pieces


def _recent(lengths: FloatArray, rates: FloatArray) -> float:
    """Mean rate over the recent cycles, the last tenth or at least a thousand."""
    total = float(lengths.sum())
    window = min(total, max(0.1 * total, 1_000.0))  # the last tenth of the cycles, a thousand at least
    ends = np.cumsum(lengths)
    weights = np.clip(ends - (total - window), 0.0, lengths)
    return float(weights @ rates / weights.sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class DutyProgramme:
    """A repeated programme of duty blocks: `cycles` [b] > 0 of each, and `rates` [n, b] > 0, the increase of ζ by one
    cycle, by draw.

    Raises ValueError where there is no block or a number is not positive.
    """

    cycles: FloatArray
    rates: FloatArray

    def __post_init__(self) -> None:
        if not (self.cycles.size and (self.cycles > 0.0).all() and (self.rates > 0.0).all()):
            raise ValueError("a programme needs a block, and all its cycles and rates must be positive")

    def cycles_until(self, progress: FloatArray) -> FloatArray:
        """Cycles [n] after which ζ has increased by `progress` [n] >= 0; inf where that is."""
        steps = self.rates * self.cycles
        ends = np.cumsum(steps, axis=1)
        reached = np.isfinite(progress)
        finite = np.where(reached, progress, 0.0)
        passes = np.floor(finite / ends[:, -1])
        rest = np.maximum(finite - passes * ends[:, -1], 0.0)
        block = np.minimum((ends <= rest[:, None]).sum(axis=1), self.cycles.size - 1)
        draws = np.arange(rest.size)
        into = np.clip((rest - ends[draws, block]) / steps[draws, block] + 1.0, 0.0, 1.0)
        begun = np.concatenate([[0.0], np.cumsum(self.cycles)])
        return np.where(reached, passes * begun[-1] + begun[block] + into * self.cycles[block], np.inf)

    def blocks_in(self, cycles: float) -> float:
        """Number of blocks in so many cycles >= 0, the last one in part."""
        ends = np.concatenate([[0.0], np.cumsum(self.cycles)])
        passes, rest = divmod(cycles, float(ends[-1]))
        return passes * self.cycles.size + float(np.interp(rest, ends, np.arange(ends.size)))


def uncertain_work(mean: FloatArray | float, deviation: float, normals: FloatArray) -> FloatArray:
    """Log-normal work [n] of a mean > 0, [n] or the same for all, and a deviation >= 0, both in its unit, by normals [n]."""
    spread = np.log1p(np.square(deviation / np.asarray(mean)))
    return np.asarray(mean * np.exp(np.sqrt(spread) * normals - 0.5 * spread))
