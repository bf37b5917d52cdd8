"""The slips that a run may suffer on its way in: each the run as it would have been without it, and how often it is made."""

import math
from collections.abc import Iterator
from dataclasses import replace

from models.plausibility import criteria
from models.plausibility.pace import log_anywhere
from models.plausibility.runs import Run, Slip

#: Slips that mistake the cycles; `other_cycles` may have been any.
EXTRA_ZERO, LOST_ZERO, SWAPPED, OTHER_CYCLES = "extra_zero", "lost_zero", "swapped_digits", "other_cycles"
OF_CYCLES = (EXTRA_ZERO, LOST_ZERO, SWAPPED, OTHER_CYCLES)
#: Another clutch's run, with its own cycles or with those expected here.
OTHER_CLUTCH, OTHER_TEST = "other_clutch", "other_test"
#: Slips of which the run without them is not known, so that only what they leave of it has a probability.
OF_CLUTCH = (OTHER_CLUTCH, OTHER_TEST)


def slips_of(run: Run, expected: float) -> Iterator[Slip]:
    """All slips of a run; its cycles were most likely `expected` where they are mistaken altogether."""
    sent = run.sent
    for name, values in mistyped(sent.cycles).items():
        for cycles in values:
            log_prior = math.log(criteria.DIGIT_SLIP / len(values))
            yield Slip(name=name, log_prior=log_prior, likely=replace(sent, cycles=cycles))
    yield Slip(
        name=OTHER_CYCLES,
        log_prior=math.log(criteria.OTHER_CYCLES) + float(log_anywhere(sent.cycles)),
        likely=replace(sent, cycles=expected),
    )
    yield from run.slips()
    if sent.log_cof is not None:
        off = (sent.log_cof - math.log(criteria.COF)) / criteria.LOG_COF_SD
        of_any = -0.5 * off * off - math.log(criteria.LOG_COF_SD * math.sqrt(2 * math.pi))
        own = math.log(criteria.OTHER_CLUTCH) + of_any + float(log_anywhere(sent.cycles))
        yield Slip(name=OTHER_CLUTCH, log_prior=own, likely=sent)
        yield Slip(name=OTHER_TEST, log_prior=math.log(criteria.OTHER_TEST) + of_any, likely=sent)


def mistyped(cycles: float) -> dict[str, list[float]]:
    """What `cycles` may have been before a slip of the fingers."""
    if not cycles.is_integer() or cycles < 1 or cycles >= 1e12:
        return {}
    digits = str(int(cycles))
    swapped = {
        int(padded[:k] + padded[k + 1] + padded[k] + padded[k + 2 :])
        for padded in (digits, "0" + digits)
        for k in range(len(padded) - 1)
    }
    lost, extra = [10.0 * cycles], [cycles / 10.0] if cycles % 10 == 0 else []
    others = sorted(swapped - {int(cycles), *map(int, lost), *map(int, extra)})
    return {
        name: values
        for name, values in (
            (EXTRA_ZERO, extra),
            (LOST_ZERO, lost),
            (SWAPPED, [float(value) for value in others]),
        )
        if values
    }
