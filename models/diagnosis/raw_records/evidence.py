"""Evidence that only raw records hold: lines at the shaft's orders, stick-slip, dwells that end before torque has settled.

- `shaft_ripple`: torque swings k times a revolution (a wobbling shaft, a disc out of true, teeth of a coupling). Its
  frequency goes with the speed, so one order k is looked for in all records together (`swing`).
- `stick_slip`: at low speed, where torque falls with speed, the shaft's torsional mode is excited: a line of one
  frequency, whatever the speed, that is there below some speed and not above it (`swing`). A line of
  one frequency at all speeds alike (mains, a pump, structure) is neither; it is reported in a note.
- `unsettled_dwell`: the exponential approach on a dwell is too slow for the dwell's length (`settling_transient`).

Evidence of a swing is the log of a likelihood ratio that is averaged over everything that was not known beforehand (size
and its law, order or frequency, how long the phase is kept, below which speed): the search is paid for.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from models.diagnosis import criteria
from models.diagnosis.campaign import Campaign, TestRun
from models.diagnosis.effects.catalogue import CATALOGUE
from models.diagnosis.effects.fitted_effect import AmplitudeEstimate
from models.diagnosis.effects.moving import SHAFT_RIPPLE, STICK_SLIP
from models.diagnosis.effects.readings import UNSETTLED_DWELL
from models.diagnosis.raw_records.settling_transient import settling_evidence
from models.diagnosis.raw_records.swing import Line, best_line, best_order, best_slow_line
from models.diagnosis.raw_records.whitened_torque import WhitenedRecord, whitened_record
from models.records.cleaning import UnusableRecordError
from models.records.plateaus import PlateauCut, cut_plateaus
from models.records.runs import Record

#: Log likelihood ratio [nats] from which a line or a settling transient counts as evidence. Derived: it pays for the prior
#: odds of one effect of the catalogue, so that the effect is at work rather than not.
LEAST_EVIDENCE = math.log((1 / criteria.ANYTHING_WRONG - 1) * len(CATALOGUE) / (1 - criteria.UNCATALOGUED_SHARE))
#: A line of one frequency at all speeds, or a swing of a kind that the catalogue lacks: structure without a name.
FIXED_LINE = "fixed_line"


@dataclass(frozen=True, slots=True, kw_only=True)
class RawEvidence:
    """Raw-record evidence of one effect: log_evidence [nats] against none, its amplitude, and a sentence on how it
    shows."""

    effect: str
    log_evidence: float
    estimate: AmplitudeEstimate
    note: str


def raw_evidence(campaign: Campaign, without: frozenset[str] = frozenset()) -> tuple[RawEvidence, ...]:
    """Evidence of swings and unsettled dwells in a campaign's raw records; empty where there are none or they are too
    slow or too short. A swing of a kind that the catalogue is `without` has no name."""
    stationary = [(run, run.record) for run in campaign.stationary if run.record is not None]
    dwells = list[tuple[Record, PlateauCut]]()
    for _, record in _evenly(stationary):
        with suppress(UnusableRecordError):  # a record without dwells: the run that it came with has reported it
            dwells.append((record, cut_plateaus(record)))
    records = [whitened_record(record, np.stack([cut.start, cut.stop], axis=1)) for record, cut in dwells]
    records += [whitened_record(record) for _, record in _evenly([(run, run.record) for run in campaign.dynamic])]
    swings = _swings([record for record in records if record is not None])
    nameless = [replace(swing, effect=FIXED_LINE) if swing.effect in without else swing for swing in swings]
    return (*nameless, *(_unsettled(dwells) if UNSETTLED_DWELL.slug not in without else ()))


def _evenly(runs: Sequence[tuple[TestRun, Record]]) -> Sequence[tuple[TestRun, Record]]:
    """Runs spread evenly over life, as many as the limit on samples allows."""
    usual = float(np.median([record.time.size for _, record in runs])) if runs else 1.0
    most = max(8, int(300_000 / usual))  # eight at least, more where they hold fewer than 300,000 samples in all
    if len(runs) <= most:
        return runs
    return [runs[i] for i in np.linspace(0, len(runs) - 1, most).round().astype(int)]


def _swings(records: list[WhitenedRecord]) -> list[RawEvidence]:
    """Evidence of shaft ripple, and of a line of one frequency: stick-slip where only low speeds have it, else a line
    without a name.

    The one with more evidence is taken out of the records before the other is looked for again.
    """
    if not records:
        return []
    order = best_order(records)
    line, slow = _fixed_line(records, None)
    if order.evidence >= line.evidence > LEAST_EVIDENCE:
        line, slow = _fixed_line(records, order)
    elif line.evidence > order.evidence > LEAST_EVIDENCE:
        order = best_order(records, line)
    found = []
    if order.evidence > LEAST_EVIDENCE and order.amplitude > 0:
        times = {1.0: "once", 2.0: "twice"}.get(order.position, f"{order.position:g} times")
        note = f"torque swings {times} a revolution at every speed"
        found.append(_line_evidence(SHAFT_RIPPLE.slug, order, "ripple amplitude", note))
    if line.evidence > LEAST_EVIDENCE and line.amplitude > 0:
        low = f"below {100 * line.speed_share:.0f} % of the highest speed and not above"
        note = f"torque swings at {line.position:.3g} Hz {low if slow else 'at all speeds alike'}"
        found.append(_line_evidence(STICK_SLIP.slug if slow else FIXED_LINE, line, "line amplitude", note))
    return found


def _fixed_line(records: list[WhitenedRecord], order: Line | None) -> tuple[Line, bool]:
    """The best line, and whether it is limited to low speed: found there, and not where the shaft is much faster."""
    slow = best_slow_line(records, order)
    if slow.evidence <= LEAST_EVIDENCE:
        return best_line(records, order), False
    # no stick-slip where the same line, within 1 Hz, is seen at more than twice the speed below which it was found
    fast = best_line(records, order, above=2.0 * slow.speed_share)
    if fast.evidence > LEAST_EVIDENCE and abs(fast.position - slow.position) < 1.0:
        return best_line(records, order), False
    return slow, True


def _line_evidence(effect: str, line: Line, name: str, note: str) -> RawEvidence:
    """The evidence of an effect from a line, with the standard deviation of its amplitude from the curvature of log
    L."""
    # λ goes with A², so log L near its maximum has a curvature of about 4 log L / A²
    deviation = line.amplitude / max(2.0 * math.sqrt(max(line.peak, 0.0)), 1.0)
    estimate = AmplitudeEstimate(name=name, value=line.amplitude, sd=deviation, unit="Nm", one_sided=True)
    return RawEvidence(effect=effect, log_evidence=line.evidence, estimate=estimate, note=note)


def _unsettled(dwells: list[tuple[Record, PlateauCut]]) -> list[RawEvidence]:
    """Evidence of dwells that ended before torque had settled, from all their transients together: one that looks late
    without it adds nothing."""
    evidence, constant = settling_evidence(dwells)
    if evidence <= LEAST_EVIDENCE:
        return []
    note = f"after each step torque settles from the side of the last level, with a time constant of {constant.value:.2g} s"
    return [RawEvidence(effect=UNSETTLED_DWELL.slug, log_evidence=evidence, estimate=constant, note=note)]
