"""Evidence that only raw records hold: lines of the shaft's orders, stick-slip, dwells that end before torque has settled.

- `shaft_ripple`: torque swings k times a revolution (a wobbling shaft, a disc out of true, teeth of a coupling). Its
  frequency goes with the speed, so all records are asked for one order k together (`detection.raw_records.shaft_orders`).
- `stick_slip`: at low speed, where torque falls with speed, the shaft's torsional mode is excited: a line of one
  frequency, whatever the speed, that is there below some speed and not above it (`fixed_frequency`). A line of
  one frequency at all speeds alike (mains, a pump, structure) is neither, and said in a note.
- `unsettled_dwell`: the exponential approach on a dwell is too slow for the dwell's length.

Evidence of a swing is the log of a likelihood ratio that is averaged over everything that was not known beforehand (size
and its law, order or frequency, how long the phase keeps, below which speed): what was tried is paid for.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from models.diagnosis.campaign import Campaign, DynamicRun, StationaryRun
from models.diagnosis.detection.raw_records.fixed_frequency import best_anywhere, best_slow
from models.diagnosis.detection.raw_records.settling_transient import approach
from models.diagnosis.detection.raw_records.shaft_orders import Line, best_order
from models.diagnosis.detection.raw_records.whitened_torque import Swings, swings
from models.diagnosis.effects.catalogued import shaft_ripple, stick_slip, unsettled_dwell
from models.diagnosis.effects.estimate import Estimate
from models.records.plateaus import PlateauCut, cut_plateaus
from models.records.runs import Record
from models.records.settling import SETTLING

#: Log likelihood ratio [nats] from which a swing counts as evidence; noise makes it in a campaign of a thousand or fewer.
SEEN = 4.5
#: A line that is seen beyond this much of the speed below which it was, is not slow; the same line lies so near [Hz].
FASTER, SAME = 2.0, 1.0
#: A dwell has not settled where its settling time is beyond this share of it.
SETTLED_SHARE = 0.8
#: Records analysed, evenly over life: so many, or as many more as hold so many samples in all.
FEW_RECORDS, MANY_SAMPLES = 8, 300_000

#: A line of one frequency at all speeds: structure that is no effect of the catalogue.
FIXED_LINE = "fixed_line"

Run = TypeVar("Run", StationaryRun, DynamicRun)


@dataclass(frozen=True, slots=True, kw_only=True)
class RawEvidence:
    """Of one effect: log_evidence [nats] against none, its amplitude, and a sentence on how it was seen."""

    effect: str
    log_evidence: float
    estimate: Estimate
    note: str


def raw_evidence(campaign: Campaign) -> tuple[RawEvidence, ...]:
    """What the raw records of a campaign show; nothing where there are none or they are too slow or too short."""
    held = [(run, run.record) for run in campaign.stationary if run.record is not None]
    cuts = [(record, _cut(record)) for _, record in _spread(held)]
    dwells = [(record, cut) for record, cut in cuts if cut is not None]
    found = [*_standing(dwells), *(swings(record) for _, record in _spread([(r, r.record) for r in campaign.dynamic]))]
    return (*_lines([each for each in found if each is not None]), *_unsettled(dwells))


def _standing(dwells: list[tuple[Record, PlateauCut]]) -> Iterator[Swings | None]:
    for record, cut in dwells:
        yield swings(record, np.stack([cut.start, cut.stop], axis=1))


def _spread(runs: list[tuple[Run, Record]]) -> list[tuple[Run, Record]]:
    """Evenly over life, as many as hold few enough samples."""
    usual = float(np.median([record.time.size for _, record in runs])) if runs else 1.0
    most = max(FEW_RECORDS, int(MANY_SAMPLES / usual))
    if len(runs) <= most:
        return runs
    return [runs[i] for i in np.linspace(0, len(runs) - 1, most).round().astype(int)]


def _cut(record: Record | None) -> PlateauCut | None:
    try:
        return None if record is None else cut_plateaus(record)
    except ValueError:  # a record without dwells says nothing here; the run that it came with said so
        return None


def _lines(records: list[Swings]) -> list[RawEvidence]:
    """Ripple and stick-slip; what explains more is taken out of the records before the other is asked for."""
    if not records:
        return []
    order, (line, slow) = best_order(records), _line(records, None)
    if order.evidence >= line.evidence > SEEN:
        line, slow = _line(records, order)
    elif line.evidence > order.evidence > SEEN:
        order = best_order(records, line)
    found = []
    if order.evidence > SEEN and order.amplitude > 0:
        note = f"torque swings {order.at:g} times a revolution at every speed"
        found.append(_seen(shaft_ripple.EFFECT.slug, order, "ripple amplitude", note))
    if line.evidence > SEEN and line.amplitude > 0:
        where = f"below {100 * line.share:.0f} % of the highest speed and not above" if slow else "at all speeds alike"
        note = f"torque swings at {line.at:.3g} Hz {where}"
        found.append(_seen(stick_slip.EFFECT.slug if slow else FIXED_LINE, line, "line amplitude", note))
    return found


def _line(records: list[Swings], order: Line | None) -> tuple[Line, bool]:
    """The best line, and whether it is at low speed only: seen there, and not where the shaft is much faster."""
    slow = best_slow(records, order)
    if slow.evidence <= SEEN:
        return best_anywhere(records, order), False
    fast = best_anywhere(records, order, above=FASTER * slow.share)
    if fast.evidence > SEEN and abs(fast.at - slow.at) < SAME:
        return best_anywhere(records, order), False
    return slow, True


def _seen(effect: str, line: Line, name: str, note: str) -> RawEvidence:
    # λ goes with A², so log L near its maximum has a curvature of about 4 log L / A²
    deviation = line.amplitude / max(2.0 * math.sqrt(max(line.clear, 0.0)), 1.0)
    estimate = Estimate(name=name, value=line.amplitude, sd=deviation, unit="Nm")
    return RawEvidence(effect=effect, log_evidence=line.evidence, estimate=estimate, note=note)


def _unsettled(dwells: list[tuple[Record, PlateauCut]]) -> list[RawEvidence]:
    """Dwells that ended before torque had settled: the evidence of all together, or how many show it by themselves."""
    cuts = [cut for _, cut in dwells]
    late = [
        (SETTLING * cut.time_constant > SETTLED_SHARE * (cut.stop - cut.start + cut.settling_time)) | ~cut.settled
        for cut in cuts
    ]
    rows = np.concatenate(late) if late else np.zeros(0, dtype=np.bool_)
    if rows.size == 0:
        return []
    seen = int(np.count_nonzero(rows))
    constants = np.concatenate([cut.time_constant for cut in cuts])[rows]
    known = constants[np.isfinite(constants)]
    alone = 0.5 * seen if seen >= max(4, 0.25 * rows.size) and known.size >= 4 else 0.0
    together, likely = approach(dwells)
    if max(alone, together) <= SEEN:
        return []
    note = f"{seen} of {rows.size} dwells ended before their torque had settled"
    if together > alone:
        note = f"after each step torque approaches its level from the side of the last one, for some {likely:.2g} s"
    usual = float(np.median(known)) if alone > 0 else likely
    spread = float(1.4826 * np.median(np.abs(known - usual))) / np.sqrt(known.size) if alone > 0 else 0.5 * likely
    estimate = Estimate(name="settling time constant", value=usual, sd=spread, unit="s")
    return [
        RawEvidence(effect=unsettled_dwell.EFFECT.slug, log_evidence=max(alone, together), estimate=estimate, note=note)
    ]
