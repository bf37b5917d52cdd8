"""The doubts about a run: whether a slip explains it better than that it is what it says.

    odds = Σ_k P(slip k) L(run without slip k | history) / L(run as sent | history)

summed over what may have gone wrong (`slips`); from `criteria.HELD` on the run is doubted, and the most probable slip says
how. Dead channels are found in the run by itself before. Pure, and a few milliseconds at most.
"""

import math
from collections.abc import Sequence

from models.clutch import Geometry
from service.errors import Notice
from service.lives.history import Event
from service.lives.incoming_run import IncomingRun
from service.lives.plausibility import criteria
from service.lives.plausibility.dead_channels import dead_channels
from service.lives.plausibility.likelihood import History, history_of
from service.lives.plausibility.reading import Reading, columns_of, reading_of
from service.lives.plausibility.slips import Slip, mistyped, slips_of
from service.lives.plausibility.wording import doubt, negative
from service.lives.recomputation import ClutchState
from service.lives.run_analysis import Analysis


def doubts(run: IncomingRun, analysis: Analysis, event: Event, before: ClutchState) -> tuple[Notice, ...]:
    """What is odd about a run that comes to a clutch; nothing for most.

    `event` is the run as the history sees it, with its mean COFs; `before` the clutch's state without it.
    """
    columns = columns_of(run, analysis)
    odd = [] if columns is None else dead_channels(event.kind, columns, before.geometry)
    if odd:
        return tuple(odd)
    reading = reading_of(event, columns, before.geometry)
    if reading.cof is not None and reading.cof <= 0:
        return (negative(reading),)
    history = history_of(before.events, event, corrected=before.extension is not None)
    slips = weighed(reading, history, before.geometry)
    if log_odds(slips) < math.log(criteria.HELD):
        return ()
    return (doubt(max(slips, key=lambda slip: slip.log_weight), reading, history),)


def weighed(reading: Reading, history: History, geometry: Geometry) -> list[Slip]:
    """All slips that may have been made, with their weights over that of the run as it was sent."""
    if reading.cof is not None:
        typed = [cycles for values in mistyped(reading.cycles).values() for cycles in values]
        history.predict([reading.cycles, history.pace.expected(), *typed])
    as_sent = history.log_likelihood(reading)
    return [slip.against(as_sent) for slip in slips_of(reading, history, geometry)]


def log_odds(slips: Sequence[Slip]) -> float:
    """log of the odds that any of the slips was made."""
    most = max((slip.log_weight for slip in slips), default=-math.inf)
    if most == -math.inf:
        return most
    return most + math.log(math.fsum(math.exp(slip.log_weight - most) for slip in slips))
