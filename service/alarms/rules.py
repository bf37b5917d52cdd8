"""What a rule watches: one value of a clutch against a limit, or a state or verdict among some."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri
from sqlalchemy import Connection

from models.clutch import Geometry
from models.friction.stribeck import PARAMETER_NAMES, StribeckParameters, slope, slope_gradient
from models.prognosis.first_passage import PassageStatus
from service.api.alarm import AlarmIn
from service.channels import RADIANS_PER_SECOND_PER_RPM, bar
from service.clutch import condition
from service.clutch.assumptions import ALL_PRESSURES
from service.clutch.items import ENDED, INSUFFICIENT
from service.clutch.notices import OFF_TRACK
from service.clutch.plausibility.doubts import OFF_COURSE
from service.clutch.summary import StoredSummary
from service.clutch.timeline import STATIONARY
from storage import alarms, diagnoses, results, runs
from storage.clutches import ClutchRow
from storage.results import FitRow

_SECONDS_PER_DAY = 86400.0
#: The quantile that is the safe bound.
_SAFE = 0.05
#: Shares of the limit of remaining life: at each its alarm is raised again. Chosen: an order, a date, a spare at hand.
STEPS = (0.5, 0.25)


@dataclass(frozen=True, slots=True)
class Silence:
    """The minimum number of hours without a run since the one received at `since` (ISO 8601)."""

    since: str
    hours: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ClutchFacts:
    """The stored facts of a clutch, for rules to check; facts that few rules need are read on demand. `silences`: known
    periods of silence of its rig, since its last run or earlier ones."""

    connection: Connection
    clutch: ClutchRow
    geometry: Geometry
    now: str
    silences: Sequence[Silence] = ()

    @property
    def clutch_id(self) -> str:
        return self.clutch.clutch_id

    @property
    def summary(self) -> StoredSummary:
        """The summary of the clutch's condition."""
        return condition.as_stored(self.clutch.summary)

    def heard(self) -> str | None:
        """When the clutch's last run arrived."""
        return alarms.last_heard(self.connection, [self.clutch_id]).get(self.clutch_id)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A rule's finding: its value, a clause that states it, and a `mark` that identifies its subject: the same mark is
    the same alarm. For remaining life: its `median`, and as mark the `step` that the value has passed."""

    value: float | None
    words: str
    mark: str = ""
    median: float = 0.0
    step: int | None = None

    def is_of(self, mark: str) -> bool:
        """Whether an alarm with that mark is about this finding: an alarm of a later step towards the end of life
        covers earlier steps."""
        return self.mark == mark or (self.step is not None and self.step < int(mark or 0))


def finding(rule: AlarmIn, facts: ClutchFacts) -> Finding | None:
    """The rule's finding for a clutch; None if there is nothing to compare."""
    return _QUANTITIES[rule.quantity](rule, facts)


def passes(rule: AlarmIn, result: Finding, hysteresis: float = 0.0) -> bool:
    """Whether the finding raises the rule's alarm or, with the rule's hysteresis, keeps a raised one."""
    if result.value is None:
        return True
    if rule.below is not None:
        limit = rule.below + hysteresis * abs(rule.below)
        shown = rule.median_within is None or result.step is None or result.median < rule.median_within * limit
        return result.value < limit and shown
    return rule.above is not None and result.value > rule.above - hysteresis * abs(rule.above)


def message(rule: AlarmIn, facts: ClutchFacts, result: Finding) -> str:
    """An alarm as a sentence, with the number of held runs."""
    (unit, scale), held_count = _UNITS.get(rule.quantity, (None, 1)), facts.summary.get("held", 0)
    again = f"; less than {100 * STEPS[result.step - 1]:.0f} % of it is left" if result.step else ""
    limit = "" if rule.limit is None or unit is None else f" (limit: {scale * rule.limit:,.6g}{unit}{again})"
    waiting = f"; {condition.held_in_words(held_count)}" if held_count and rule.quantity != "held_runs" else ""
    return f"{facts.clutch_id}: {result.words}{limit}{waiting}"


def slope_quantile(rule: AlarmIn, fit: FitRow, geometry: Geometry) -> float | None:
    """The quantile of dμ/dv [s/m] of a fitted curve at the rule's speed, by its standard error; None without friction.

    Value and standard error as in `models.friction.identification.cof_slope`, with Σ from the unbiased noise.
    """
    parameters = StribeckParameters(**{name: getattr(fit, name) for name in PARAMETER_NAMES})
    velocity = geometry.sliding_velocity(np.array(rule.speed_rpm * RADIANS_PER_SECOND_PER_RPM))
    gradient = slope_gradient(float(velocity), parameters)
    variance = float(gradient @ np.reshape(fit.unbiased_covariance, (4, 4)) @ gradient)
    if not variance > 0.0:
        return None
    margin = float(slope(velocity, parameters)) + float(ndtri(rule.probability)) * math.sqrt(variance)
    return margin / geometry.torque_per_cof(fit.mean_pressure)


def _remaining(rule: AlarmIn, facts: ClutchFacts) -> tuple[float, float] | None:
    """The remaining cycles at the rule's quantile and their median, with held runs considered, at most the horizon;
    None if they are unknown or the quantile is beyond the horizon."""
    summary = facts.summary
    if summary.get("status", INSUFFICIENT) in (INSUFFICIENT, ENDED):
        return None
    if summary["status"] == PassageStatus.REACHED.value:
        return 0.0, 0.0
    own = summary["remaining_cycles"][f"{rule.probability:g}"]
    cycles = condition.bound_of(summary) if rule.probability == _SAFE else own
    return None if cycles is None else (float(cycles), condition.median_of(summary))


def _remaining_cycles(rule: AlarmIn, facts: ClutchFacts) -> Finding | None:
    known = _remaining(rule, facts)
    return None if known is None else _of_remaining(rule, *known, _left(rule, *known))


def _of_remaining(rule: AlarmIn, value: float, median: float, words: str) -> Finding:
    """The finding on remaining cycles or days, with the step that they have passed."""
    step = sum(value < share * (rule.limit or 0.0) for share in STEPS)
    return Finding(value=value, words=words, median=median, step=step, mark=f"{step}")


def _left(rule: AlarmIn, cycles: float, median: float) -> str:
    """The remaining cycles at the rule's quantile in words, with their median as a measure of certainty."""
    if cycles < 1.0 and median < 1.0:
        return condition.bound_in_words(cycles)
    half = f"50 % chance of {condition.rounded_down(max(1.0, median))} or more"
    if rule.probability == _SAFE:
        return f"{condition.bound_in_words(cycles)}, {half}"
    return f"{condition.chance_in_words(1.0 - rule.probability)} chance of {cycles:,.0f} or more cycles, {half}"


def _remaining_days(rule: AlarmIn, facts: ClutchFacts) -> Finding | None:
    known, pace = _remaining(rule, facts), facts.summary.get("pace")
    if known is None or pace is None:
        return None
    days, median = (cycles / pace["cycles_per_second"] / _SECONDS_PER_DAY for cycles in known)
    return _of_remaining(rule, days, median, f"{_left(rule, *known)}: {condition.pace_in_words(pace, known[0])}")


def _health(_rule: AlarmIn, facts: ClutchFacts) -> Finding | None:
    current = facts.summary.get("current")
    health = None if current is None else current["health"]
    if health is None or facts.summary.get("status") == ENDED:
        return None
    return Finding(value=float(health), words=f"health {100 * health:.0f} %")


def _shudder_margin(rule: AlarmIn, facts: ClutchFacts) -> Finding | None:
    """The smallest slope dμ/dv over the pressures of the newest stationary test (by cycles), at the quantile of its
    standard error, if the test is accepted and has curves."""
    newest = runs.newest_fitted(facts.connection, facts.clutch_id, STATIONARY)
    margins = [
        (margin, fit.pressure)
        for fit in ([] if newest is None else results.fits_of_run(facts.connection, newest))
        if (margin := slope_quantile(rule, fit, facts.geometry)) is not None
    ]
    if not margins:
        return None
    margin, pressure = min(margins)
    chance = f"{condition.chance_in_words(1.0 - rule.probability)} chance of {margin:.3g} s/m or more"
    return Finding(
        value=margin, words=f"slope of friction at {rule.speed_rpm:g} rpm and {bar(pressure):g} bar: {chance}"
    )


def _held_runs(_rule: AlarmIn, facts: ClutchFacts) -> Finding | None:
    count = facts.summary.get("held", 0)
    return Finding(
        value=float(count), words=f"{count} held {'run waits' if count == 1 else 'runs wait'} for a decision"
    )


def _off_course(_rule: AlarmIn, facts: ClutchFacts) -> Finding | None:
    """The reason why the newest test is off its course: the prediction's warning, or the doubt about a held run."""
    newest = results.prediction_at(facts.connection, facts.clutch_id, condition.SHOWN, ALL_PRESSURES)
    notices = [] if newest is None else [notice for notice in newest.payload["warnings"] if notice["code"] == OFF_TRACK]
    for row in runs.page(facts.connection, facts.clutch_id, state=runs.HELD):
        notices += [doubt for doubt in row.doubts if doubt["code"] == OFF_COURSE]
    return Finding(value=None, words=f"off course: {notices[0]['message']}") if notices else None


def _verdict(rule: AlarmIn, facts: ClutchFacts) -> Finding | None:
    """The finding of a rule on verdicts: the newest diagnosis is of this life, has one of them, and was not adopted."""
    newest = diagnoses.newest(facts.connection, [facts.clutch_id]).get(facts.clutch_id)
    verdicts = tuple(condition.DISAGREES) if rule.any_of is None else rule.any_of
    if newest is None or newest.adopted or newest.verdict not in verdicts:
        return None
    if newest.life != facts.summary.get("life", ""):
        return None
    causes = ", ".join(cause.replace("_", " ") for cause in newest.causes)
    words = str(newest.verdict).replace("_", " ") + (f" ({causes})" if causes else "")
    return Finding(value=None, words=f"the newest diagnosis says: {words}", mark=f"{newest.verdict}:{causes}")


def _state(rule: AlarmIn, facts: ClutchFacts) -> Finding | None:
    """The finding of a rule on states: the clutch is in one of them."""
    state = condition.state_of(facts.summary, disputed=facts.clutch.is_disputed, silent=facts.clutch.silent)
    name = state["name"]
    if name not in (rule.any_of or [other for other in condition.STATE_WORDS if other != condition.NORMAL]):
        return None
    known = condition.stated(facts.summary)
    clauses = dict.fromkeys([state["why"], *([known.statement] if known else [])])
    return Finding(value=None, words=f"{condition.STATE_WORDS[name].lower()}: {'; '.join(clauses)}", mark=name)


def _silent_hours(_rule: AlarmIn, facts: ClutchFacts) -> Finding | None:
    heard = facts.heard()
    if heard is None or facts.summary.get("status") == ENDED:
        return None
    hours = max((silence.hours for silence in facts.silences if silence.since == heard), default=0.0)
    return Finding(value=hours, words=condition.silence_in_words(heard))


_QUANTITIES: dict[str, Callable[[AlarmIn, ClutchFacts], Finding | None]] = {
    "remaining_cycles": _remaining_cycles,
    "remaining_days": _remaining_days,
    "health": _health,
    "shudder_margin": _shudder_margin,
    "held_runs": _held_runs,
    "off_course": _off_course,
    "verdict": _verdict,
    "state": _state,
    "silent_hours": _silent_hours,
}
#: The units of limits that a message states, and how many of them 1 is.
_UNITS = {
    "remaining_cycles": (" cycles", 1),
    "remaining_days": (" days", 1),
    "health": (" %", 100),
    "shudder_margin": (" s/m", 1),
    "silent_hours": (" h", 1),
}
