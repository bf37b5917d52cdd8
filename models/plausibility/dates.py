"""Which dates of a life's runs are believed, in the order of their cycles.

Dates must not fall as cycles rise: those of the fewest runs without which they do not are not believed. Nor does a
rig suddenly run FASTER times as fast. Where one step of cycles in time is so much faster than every other, of its two
dates the one is not believed without which the life runs most evenly; where every later step is so much faster than
the first one, the first date is not. A rig may stand still for any time between other runs.
"""

import bisect
import itertools
from collections.abc import Sequence

from models.plausibility import criteria


def believed_dates(cycles: Sequence[float], moments: Sequence[float]) -> list[int]:
    """The runs whose dates are believed, by ascending cycles; `cycles` at their starts and `moments` [s], each [n]."""
    order = sorted(range(len(cycles)), key=lambda run: (cycles[run], moments[run]))
    rise = longest_rise([moments[run] for run in order])
    kept = [run for place, run in enumerate(order) if place in rise]
    while suspects := _suspects(_rates(cycles, moments, kept)):
        kept = min(
            (kept[:place] + kept[place + 1 :] for place in suspects), key=lambda way: max(_rates(cycles, moments, way))
        )
    return kept


def _rates(cycles: Sequence[float], moments: Sequence[float], kept: Sequence[int]) -> list[float]:
    """Cycles a second up to each run but the first; 0 where their dates are too close to tell."""
    rates = []
    for before, run in itertools.pairwise(kept):
        seconds = moments[run] - moments[before]
        rates.append((cycles[run] - cycles[before]) / seconds if seconds > criteria.LEAST_SECONDS else 0.0)
    return rates


def _suspects(rates: Sequence[float]) -> list[int]:
    """Places of the runs one of which has a wrong date, from the rates [n - 1] of cycles a second up to each run but the
    first; empty where the rates agree within the factor FASTER."""
    steps = [(rate, place) for place, rate in enumerate(rates) if rate > 0.0]
    if len(steps) <= criteria.FEWEST_RATES:
        return []
    *others, (fastest, place) = sorted(steps)
    if fastest > criteria.FASTER * others[-1][0]:
        return [place, place + 1]
    (first, place), *later = steps
    return [place] if min(rate for rate, _ in later) > criteria.FASTER * first else []


def longest_rise(values: Sequence[float]) -> set[int]:
    """The places of a longest subsequence that does not fall."""
    lowest: list[float] = []  # the least value that ends a rise of each length, and where
    ends: list[int] = []
    before: list[int] = []
    for k, value in enumerate(values):
        length = bisect.bisect_right(lowest, value)
        before.append(ends[length - 1] if length else -1)
        lowest[length : length + 1], ends[length : length + 1] = [value], [k]
    places: set[int] = set()
    k = ends[-1] if ends else -1
    while k >= 0:
        places.add(k)
        k = before[k]
    return places
