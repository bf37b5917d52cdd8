"""Runs as numbers alone, and the slips that they may suffer on their way in: each the run as it would have been without it,
and how often it is made."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from models.plausibility import criteria
from models.plausibility.pace import log_anywhere

#: Slips that mistake the cycles; `other_cycles` may have been any.
EXTRA_ZERO, LOST_ZERO, SWAPPED, OTHER_CYCLES = "extra_zero", "lost_zero", "swapped_digits", "other_cycles"
OF_CYCLES = (EXTRA_ZERO, LOST_ZERO, SWAPPED, OTHER_CYCLES)
#: Another clutch's run, with its own cycles or with those expected here.
OTHER_CLUTCH, OTHER_TEST = "other_clutch", "other_test"
#: Slips of which the run without them is not known, so that only what they leave of it has a probability.
OF_CLUTCH = (OTHER_CLUTCH, OTHER_TEST)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunReading:
    """The numbers of a run, as sent or corrected for a slip.

    `cycles` since new; `log_cof` the logarithm of mean COF as the stationary tests of its life show it and `spread` its own
    deviation, None for a run that shows none; `log_protocol` the log density of its pressures, speeds and oil.
    """

    cycles: float
    log_cof: float | None = None
    spread: float = 0.0
    log_protocol: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip:
    """A slip with the log of its prior odds, the unit it concerns, and the run as it would be without it."""

    name: str
    log_prior: float
    likely: RunReading
    unit: str = ""


class _RunFields(NamedTuple):
    name: str
    kind: str
    cycles: float
    reading: Callable[[], RunReading]
    slips: Callable[[], Iterable[Slip]] = tuple
    tests: bool = False
    block: float | None = None
    moment: float | None = None
    shift: bool = False
    rebuild: bool = False
    fixed: bool = False


class Run(_RunFields):
    """A run at the `cycles` as sent: its `reading` as it came in, and the `slips` of its channels that are possible, both
    made when they are asked for, since of a long history few runs are looked at.

    `tests` says whether its COF is evidence of the course (a stationary test); `block` [cycles] what a block of duty says it
    ran; `moment` [s] when it was started, None where it does not say; `shift` an event that may move the level of COF,
    `rebuild` one that begins a life; `fixed` a run that somebody confirmed: it is not held, and seldom slipped all the same.
    """

    def at(self, cycles: float) -> "Run":
        """The run as if it had been sent at other cycles."""
        return self._replace(cycles=cycles, reading=lambda: replace(self.sent, cycles=cycles))

    @cached_property
    def sent(self) -> RunReading:
        """The run's numbers as it came in."""
        return self.reading()


def slips_of(run: Run, expected: float) -> Iterator[Slip]:
    """All slips that a run may have suffered, with their prior odds; if its cycles are mistaken altogether, they were
    most likely `expected`."""
    sent, anywhere = run.sent, float(log_anywhere(run.sent.cycles))
    for name, values in mistyped(sent.cycles).items():
        for cycles in values:
            log_prior = math.log(criteria.DIGIT_SLIP / len(values))
            yield Slip(name=name, log_prior=log_prior, likely=replace(sent, cycles=cycles))
    yield Slip(
        name=OTHER_CYCLES,
        log_prior=math.log(criteria.OTHER_CYCLES) + anywhere,
        likely=replace(sent, cycles=expected),
    )
    yield from run.slips()
    if sent.log_cof is not None:
        off = (sent.log_cof - math.log(criteria.COF)) / criteria.LOG_COF_SD
        of_any = -0.5 * off * off - math.log(criteria.LOG_COF_SD * math.sqrt(2 * math.pi))
        log_other_clutch = math.log(criteria.OTHER_CLUTCH) + of_any + anywhere
        yield Slip(name=OTHER_CLUTCH, log_prior=log_other_clutch, likely=sent)
        yield Slip(name=OTHER_TEST, log_prior=math.log(criteria.OTHER_TEST) + of_any, likely=sent)


def mistyped(cycles: float) -> dict[str, list[float]]:
    """The possible true cycles behind mistyped `cycles`, by slip: a zero too many, a lost zero, swapped digits."""
    if not cycles.is_integer() or cycles < 1 or cycles >= 1e12:
        return {}
    digits = str(int(cycles))
    swapped = {
        int(padded[:k] + padded[k + 1] + padded[k] + padded[k + 2 :])
        for padded in (digits, "0" + digits)
        for k in range(len(padded) - 1)
    }
    lost, extra = [10.0 * cycles], [cycles / 10.0] if cycles % 10 == 0 else []
    other_numbers = sorted(swapped - {int(cycles), *map(int, lost), *map(int, extra)})
    found = {EXTRA_ZERO: extra, LOST_ZERO: lost, SWAPPED: [float(value) for value in other_numbers]}
    return {name: values for name, values in found.items() if values}
