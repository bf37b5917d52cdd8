"""The condition of a clutch, as lists, pages and terminals show it: remaining life in short, state, reason and advice.

`summarised` (in `with_held.py`) makes what is stored; `state_of` is the only place where a state is decided, `top_line` the
only one where the line above a clutch's page and its action are written.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, cast

from models.prognosis.criteria import FEWEST_TESTS, HORIZON
from models.prognosis.first_passage import PassageStatus
from service.api.clutch import ClutchSummary, LastRun, LatestDiagnosis, Recent
from service.api.life import HeldRuns, LifePrediction
from service.api.run import Warned
from service.channels import whole
from service.clutch.criteria import FEW_CYCLES, LONGEST_TEST, MAX_LINE_POINTS, NEAR_LIMIT, OTHER_OIL, SOON
from service.clutch.items import ENDED, INSUFFICIENT
from service.clutch.notices import interval_in_words
from service.clutch.summary import Outlook, Pace, PredictionInShort, StoredSummary
from service.clutch.timeline import WORN, Event, Series, date_of

_SECONDS_PER_DAY = 86_400.0
#: The states of a clutch after NAMUR NE 107; the first that holds is its state.
STATES = FAILURE, MAINTENANCE, CHECK, OUT_OF_SPECIFICATION, NORMAL = (
    "failure",
    "maintenance",
    "check",
    "out_of_specification",
    "normal",
)
#: What a state is called on a page and in a terminal.
STATE_WORDS = dict(
    zip(STATES, ("Failure", "Maintenance required", "Function check", "Out of specification", "Normal"), strict=True)
)
#: Verdicts by which data and model disagree.
DISAGREES = NAMED, AMBIGUOUS, _ = ("cause_named", "cause_ambiguous", "unexplained_structure")
#: What of a prediction is stored with a clutch and shown by lists, and all that is stored.
SUMMARY = (
    "status", "as_of_cycles", "runs_used", "current", "criterion", "remaining_cycles", "at_least",
    "probability_of_reaching", "model", "ended",
)  # fmt: skip
STORED = (*SUMMARY, "horizon_cycles", "end_of_life_cycles")
#: What is said beside a prediction.
BESIDE = ("at_least", "at_least_at", "counted_from", "held_runs", "statement")
REACHED = PassageStatus.REACHED.value
#: The filter whose predictions lists and receipts show.
SHOWN = "particle"
#: The warning of an answer beside which runs are held.
HELD_RUNS = "held_runs"
#: Among clutches in the same state one without a prediction comes after all others; a life that has ended comes last of all.
RANK_UNKNOWN, RANK_ENDED = 2 * HORIZON, 3 * HORIZON


def as_stored(content: Mapping[str, Any]) -> StoredSummary:
    """The summary in a clutch's row."""
    return cast("StoredSummary", content)


def in_short(prediction: LifePrediction) -> PredictionInShort:
    """A prediction in the form of the summary."""
    return cast("PredictionInShort", prediction.model_dump())


def rank_of(summary: StoredSummary) -> float:
    """The clutch's sort key among those in its state: the safe bound on remaining cycles, with held runs considered."""
    if summary.get("ended") is not None:
        return RANK_ENDED
    if summary.get("status", INSUFFICIENT) == INSUFFICIENT:
        return RANK_UNKNOWN
    bound = bound_of(summary)
    return HORIZON if bound is None else min(bound, HORIZON)


@dataclass(frozen=True, slots=True, kw_only=True)
class BesidePrediction:
    """The fields of an answer beside its prediction: the safe bound and its date, the effect of held runs with a
    warning (None: none is held), and a sentence on the remaining life."""

    at_least: float | None
    at_least_at: str | None
    counted_from: str | None
    held_runs: HeldRuns | None
    statement: str
    warning: Warned | None

    def of(self, prediction: LifePrediction) -> Mapping[str, Any]:
        """These fields, as fields of an answer that contains the prediction."""
        own: dict[str, Any] = {name: getattr(self, name) for name in BESIDE}
        return own | {"warnings": [*prediction.warnings, *([] if self.warning is None else [self.warning])]}


def with_held_runs(
    payload: PredictionInShort, summary: StoredSummary, among: Outlook | None, count: int
) -> BesidePrediction:
    """The fields beside a prediction. `among` is the prediction with the `count` held runs counted (None: none is
    held); the safe bound is the lower of both, with its date at the pace of the runs. `summary` is the clutch's, empty
    if the answer is of an earlier time or life."""
    held_runs, warning = None, None
    if among is not None:
        held_runs = HeldRuns(count=count, status=among["status"], remaining_cycles=among["remaining_cycles"])
        warning = _warning_about_held_runs(payload, among, count)
    at_least = lower_bound(payload["at_least"], among)
    at, since = None, None
    if at_least is not None and (pace := summary.get("pace")) is not None:
        at, since = date_of(pace["moment"] + at_least / pace["cycles_per_second"]), date_of(pace["moment"])
    return BesidePrediction(
        at_least=at_least,
        at_least_at=at,
        counted_from=since,
        held_runs=held_runs,
        statement=statement_of(payload, at_least),
        warning=warning,
    )


def pace_in_words(pace: Pace | None, cycles: float | None) -> str | None:
    """Cycles converted to days at the pace of the runs, and the day from which they count; None if either is unknown.
    Answers do not depend on today's date, which may be long after the last run."""
    since = None if pace is None or cycles is None else date_of(pace["moment"])
    if pace is None or cycles is None or since is None:
        return None
    days = cycles / pace["cycles_per_second"] / _SECONDS_PER_DAY
    shown = "less than a day" if days < 1.0 else "1 day" if days < 2.0 else f"{rounded_down(days)} days"
    day = datetime.fromisoformat(since)
    return f"{shown} at the pace so far, counted from the last run on {day.day} {day:%b %Y}"


def stated(summary: StoredSummary) -> ClutchSummary | None:
    """A clutch's summary as lists show it; None before the first accepted run."""
    if "status" not in summary:
        return None
    beside = with_held_runs(summary, summary, _with_held(summary), summary.get("held", 0))
    own = {name: value for name, value in summary.items() if name in SUMMARY}
    return ClutchSummary.model_validate(own | {name: getattr(beside, name) for name in BESIDE})


def lower_bound(at_least: float | None, among: Outlook | None) -> float | None:
    """The lower of two safe bounds, without and with the held runs; None if neither is known."""
    bounds = [at_least, None if among is None else among["at_least"]]
    return min((bound for bound in bounds if bound is not None), default=None)


def _with_held(summary: StoredSummary) -> Outlook | None:
    """The shown prediction with the held runs counted; None if no run is held."""
    return (summary.get("with_held") or {}).get(SHOWN)


def bound_of(summary: StoredSummary) -> float | None:
    """The safe bound of a summary, with held runs considered; None if it is unknown."""
    return lower_bound(summary["at_least"], _with_held(summary))


def median_of(summary: StoredSummary) -> float:
    """The median of remaining cycles, at most the horizon; if runs are held, the lower of the medians without and with
    them."""
    medians = [each["remaining_cycles"]["0.5"] for each in (summary, _with_held(summary)) if each is not None]
    return min((float(median) for median in medians if median is not None), default=HORIZON)


def _warning_about_held_runs(payload: PredictionInShort, among: Outlook, count: int) -> Warned:
    """The warning about held runs, with their effect on the prediction; the safe bounds may differ even if both
    remaining lives are unknown."""
    if all(among[name] == payload[name] for name in ("status", "remaining_cycles", "at_least")):
        effect = f"the remaining life would be the same with {_pronoun(count)}"
    elif among["status"] == REACHED:
        effect = f"with {_pronoun(count)} the end of life would be reached"
    elif among["status"] == INSUFFICIENT and among["at_least"] is None:
        effect = f"with {_pronoun(count)} nothing could be predicted"
    elif among["status"] == INSUFFICIENT:
        effect = f"with {_pronoun(count)} the remaining life is not known: {bound_in_words(among['at_least'])}"
    else:
        effect = f"with {_pronoun(count)} {interval_in_words(among['remaining_cycles'])} cycles would remain"
    return Warned(code=HELD_RUNS, message=f"{held_in_words(count)}: {effect}")


def held_runs_left_out(count: int) -> list[Warned]:
    """The warning of an answer that leaves this many held runs out; empty if none is held."""
    message = f"{held_in_words(count)}: this is without {_pronoun(count)}"
    return [Warned(code=HELD_RUNS, message=message)] if count else []


def _pronoun(count: int) -> str:
    return "it" if count == 1 else "them"


def held_in_words(count: int) -> str:
    return "1 run is held and does not count" if count == 1 else f"{count} runs are held and do not count"


def state_of(summary: StoredSummary, *, disputed: bool, silent: str | None = None) -> dict[str, str]:
    """A clutch's state by NAMUR NE 107 with the reason, from its summary; `disputed`: its newest diagnosis found that
    data and model disagree, and nobody has acted on it; `silent`: the time of the last message, if the rig's silence is
    an alarm."""
    name, reason = _state_and_reason(summary, disputed=disputed, silent=silent)
    if reason or "status" not in summary:
        return {"name": name, "why": reason}
    return {"name": name, "why": statement_of(summary, bound_of(summary))}


def _state_and_reason(summary: StoredSummary, *, disputed: bool, silent: str | None) -> tuple[str, str]:
    """The first state with a true condition, and its reason as a clause; the reason is empty if the statement of the
    remaining life serves as one."""
    held = summary.get("held", 0)
    if "damaged" in summary:
        return CHECK, f"its stored results are damaged: {summary['damaged']}"
    if "status" not in summary:
        return CHECK, held_in_words(held) if held else "no run counts yet"
    status = summary["status"]
    worn = status == ENDED and (end := summary["ended"]) is not None and end["reason"] == WORN
    near = None if status in (REACHED, INSUFFICIENT, ENDED) else _near_end(summary)
    rules = (
        (FAILURE, "" if status == REACHED or worn else None),
        (MAINTENANCE, near),
        (CHECK, held_in_words(held) if held else None),
        (CHECK, _tests(summary) if status == INSUFFICIENT else None),
        (CHECK, (silent and status != ENDED and silence_in_words(silent)) or None),
        (OUT_OF_SPECIFICATION, "data and model disagree, see the diagnosis" if disputed and status != ENDED else None),
        (NORMAL, ""),
    )
    return next((name, reason) for name, reason in rules if reason is not None)


def silence_in_words(since: str) -> str:
    """The clause stating that no run has arrived since a moment (ISO 8601)."""
    return f"the rig is silent, no run arrived since {since[:16].replace('T', ' ')} UTC"


def top_line(
    summary: StoredSummary,
    *,
    disputed: bool,
    diagnosis: LatestDiagnosis | None = None,
    silent: str | None = None,
    raised: int = 0,
) -> dict[str, str]:
    """The first lines of a clutch's page and of `clutchlife status`: `headline`, its state in words, the safe bound in
    cycles and days, and the median; `action`, a recommendation. `diagnosis`: the newest one as sent to clients;
    `raised`: the number of unacknowledged alarms."""
    name, reason = _state_and_reason(summary, disputed=disputed, silent=silent)
    words = STATE_WORDS[name]
    if "status" not in summary:
        return {"headline": f"{words}: {reason}", "action": _action(name, summary, "soon", diagnosis, raised)}
    at_least = bound_of(summary)
    paced = pace_in_words(summary.get("pace"), at_least)
    soon = "now" if at_least is not None and at_least < 1.0 else "soon" if paced is None else f"within {paced}"
    says = _numbers_in_words(summary, at_least, paced)
    return {
        "headline": f"{words}: {reason}; {says}" if reason else f"{words}: {says}",
        "action": _action(name, summary, soon, diagnosis, raised),
    }


def _numbers_in_words(summary: StoredSummary, at_least: float | None, paced: str | None) -> str:
    """The safe bound (both, if held runs lower it), its days and the median; the statement of the remaining life if
    there is no number."""
    own = summary["at_least"]
    if own is not None and own >= 1.0 and at_least is not None and at_least < own:
        runs = "the held run counts" if summary.get("held") == 1 else "the held runs count"
        if at_least < 1.0:
            return f"no further cycle is safe if {runs}; {bound_in_words(own)} if not"
        return f"{bound_in_words(at_least)} if {runs}, for {rounded_down(own)} if not"
    if summary["status"] in (REACHED, INSUFFICIENT, ENDED) or at_least is None or at_least < 1.0:
        return statement_of(summary, at_least)
    bound = bound_in_words(at_least) + ("" if paced is None else f": {paced}")
    if summary["status"] == PassageStatus.MAY_NEVER_REACH.value:
        return _left_open(bound, summary)
    if (median := summary["remaining_cycles"]["0.5"]) is None:
        return bound
    unit = _second_digit(max(1.0, median))
    return f"{bound}; 50 % chance of {round(median / unit) * unit:,.0f} or more"


def _action(name: str, summary: StoredSummary, soon: str, diagnosis: LatestDiagnosis | None, raised: int) -> str:
    """The recommended action for a state, in one sentence; `soon`: how soon. Alarms ask for attention even if the state
    does not."""
    held = summary.get("held", 0)
    if summary.get("ended") and not held:
        return "Its life has ended: record the rebuild, or archive it."
    if (oil := summary.get("oil_question")) and not summary.get("ended"):
        return f"Bring the oil to one temperature, within {OTHER_OIL:g} °C, and repeat the test: {oil}."
    if name in (FAILURE, MAINTENANCE) and not summary.get("ended") and (question := summary.get("rig_question")):
        how = "run the diagnosis" if diagnosis is None else "see the diagnosis"
        return f"Check the measurement before you replace anything: {question}, which a rig may do too; {how}."
    if name == FAILURE:
        unseen = summary["status"] == REACHED and untested_since(summary) is not None
        return "Run a stationary test, or replace the clutch." if unseen else "Replace the clutch."
    if name == MAINTENANCE:
        return f"Replace {soon}."
    if "damaged" in summary:
        return "Run clutchlife verify, then clutchlife replay, on the service's machine."
    if name == CHECK and held:
        return "Confirm, correct or withdraw " + ("one held run." if held == 1 else f"{held} held runs.")
    if name == CHECK and summary.get("status", INSUFFICIENT) != INSUFFICIENT:
        return "Find out why the rig sends nothing."
    if name == CHECK:
        missing = FEWEST_TESTS - _distinct_test_cycles(summary)
        tests = "one more stationary test" if missing == 1 else f"{missing} more stationary tests, at different cycles"
        alike = ", with the pressures and oil of this life's first test" if _tests_unlike_first(summary) else ""
        return f"Run {tests}{alike}: then the remaining life is predicted."
    if name == NORMAL and raised:
        return (
            "Look at the alarm and acknowledge it." if raised == 1 else f"Look at {raised} alarms and acknowledge them."
        )
    health = summary["current"]["health"]
    if name == NORMAL and health is not None and health < SOON:
        return f"Have a replacement at hand: health {100 * health:.0f} %."
    if name == NORMAL and summary.get("corrected"):
        return " ".join(summary["corrected"])
    if name == NORMAL or diagnosis is None:
        return "Nothing to do: carry on testing."
    causes = [_cause_in_words(cause) for cause in diagnosis.causes]
    if diagnosis.adoptable and diagnosis.verdict == NAMED:
        return f"Adopt the model with {' and '.join(causes)}: it explains where data and model disagree."
    if (advice := diagnosis.advice) is not None:
        unclear = "The cause is not clear yet. " if diagnosis.verdict == AMBIGUOUS else ""
        return f"{unclear}Run {_test_in_words(advice.test)}: {_decides(advice.separates)}."
    return "Read the diagnosis before you rely on the forecast."


def _test_in_words(test: str) -> str:
    """An advised test in words; for a long protocol, which the diagnosis shows in full, its first test."""
    test = test.removeprefix("the ")
    if not test.startswith(("stationary", "dynamic")):
        return test
    return f"a {test}" if len(test) <= LONGEST_TEST else f"the advised tests, first a {test.partition(',')[0]}"


def _decides(separates: Sequence[str]) -> str:
    """The clause that says which causes an advised test distinguishes."""
    effects = [_cause_in_words(effect) for effect in separates if effect != "baseline"]
    if len(effects) == 1:
        return f"it shows whether {effects[0]} is at work"
    return f"it decides between {' and '.join(effects)}"


def _cause_in_words(slug: str) -> str:
    return "a cause outside the catalogue" if slug == "uncatalogued" else slug.replace("_", " ")


def _tests(summary: StoredSummary) -> str:
    """The number of present tests out of those needed for a prediction, as a clause."""
    places, left_out = _distinct_test_cycles(summary), _tests_unlike_first(summary)
    known = f"{places} of the {FEWEST_TESTS} tests that a prediction needs"
    if places < summary["runs_used"]:
        known = f"tests at {places} of the {FEWEST_TESTS} different cycles that a prediction needs"
    return f"{known} ({left_out} more cannot be compared with the first)" if left_out else known


def _distinct_test_cycles(summary: StoredSummary) -> int:
    """The number of different cycles with counted tests; for an older summary without it, the number of counted tests."""
    return int(summary.get("places", summary.get("runs_used", 0)))


def _tests_unlike_first(summary: StoredSummary) -> int:
    """The number of tests that cannot be compared with the first."""
    return int(summary.get("tests", 0) - summary.get("runs_used", 0)) if "tests" in summary else 0


def _near_end(summary: StoredSummary) -> str | None:
    """The reason why a predicted end is near, by the share of life left at the safe bound or by a quantity's limit;
    None if it is not near."""
    as_of, left = summary["as_of_cycles"], summary["at_least"]
    if as_of is not None and left is not None and left < SOON * (as_of - summary["from_cycles"] + left):
        return f"less than {100 * SOON:.0f} % of its life may be left"
    health = summary["current"]["health"]
    if health is not None and health < NEAR_LIMIT:
        return f"near its limit, {limit_in_words(summary['criterion'])}"
    return None


def statement_of(payload: PredictionInShort, at_least: float | None) -> str:
    """A sentence on the remaining life: its safe bound, which held runs may lower, and the probability of an end within
    the horizon if that is open."""
    bound, own = bound_in_words(at_least), payload["at_least"]
    if own is not None and bound != bound_in_words(own):
        bound += ", if held runs count"
    if (end := payload.get("ended")) is not None:
        early = "" if end["reason"] == WORN else ", taken out before it was worn"
        return f"ended at {end['cycles']:,.0f} cycles{early}"
    if payload["status"] == REACHED:
        tested = untested_since(payload)
        since = "reached" if tested is None else f"probably reached since the last test at {tested:,.0f} cycles"
        return f"the end of life is {since}: its limit is {limit_in_words(payload['criterion'])}"
    if payload["status"] == INSUFFICIENT:
        return "the remaining life is not known yet" + (f": {bound}" if payload["runs_used"] else "")
    return _left_open(bound, payload) if payload["status"] == PassageStatus.MAY_NEVER_REACH.value else bound


def untested_since(payload: PredictionInShort) -> float | None:
    """The cycles of the last test, if the predicted end of life lies after it, so that no measurement confirms it; else
    None."""
    tested, end = payload["current"]["measured_at_cycles"], payload.get("end_of_life_cycles", {}).get("0.5")
    return tested if tested is not None and end is not None and end > tested else None


def _left_open(bound: str, payload: PredictionInShort) -> str:
    """The statement for an interval that reaches the horizon: the safe bound, and the probability of an end before the
    horizon."""
    chance = chance_in_words(payload["probability_of_reaching"] or 0.0)
    within = f"the end comes within {payload.get('horizon_cycles', HORIZON):,.0f} cycles with a probability of {chance}"
    return f"{bound}; later tests will tell how many more ({within})"


def bound_in_words(at_least: float | None) -> str:
    """The safe bound of remaining cycles in words, rounded down to two digits; below FEW_CYCLES no number is given."""
    if at_least is None or at_least < 1.0:
        return "no further cycle is safe"
    shown = f"fewer than {FEW_CYCLES}" if at_least < FEW_CYCLES else rounded_down(at_least)
    return f"safe for {shown} more cycles (95 %)"


def rounded_down(cycles: float) -> str:
    """Cycles, at least 1, rounded down to two digits."""
    unit = _second_digit(cycles)
    return f"{math.floor(cycles / unit) * unit:,.0f}"


def _second_digit(cycles: float) -> float:
    """The unit of the second digit of a number of cycles of at least 1."""
    return float(10.0 ** max(0, math.floor(math.log10(cycles)) - 1))


def limit_in_words(criterion: Mapping[str, Any]) -> str:
    """A criterion as part of a sentence, as `mean COF at 50 % of new`."""
    units = (("speed_rpm", "rpm"), ("frequency_hz", "Hz"), ("pressure_bar", "bar"))
    place = [f"{criterion[name]:g} {unit}" for name, unit in units if criterion.get(name) is not None]
    name = ", ".join([criterion["quantity"].replace("_", " ").replace("cof", "COF"), *place])
    if criterion["fraction"] is not None:
        return f"{name} at {100 * criterion['fraction']:g} % of new"
    word = "below" if criterion.get("below") is not None else "above"
    return f"{name} {word} {criterion[word]:g}"


def chance_in_words(probability: float) -> str:
    """A probability in per cent, never rounded to 0 or 100 %."""
    if probability > 0.995:
        return "more than 99 %"
    return "less than 1 %" if probability < 0.005 else f"{math.floor(100 * probability + 0.5)} %"


def recent(events: Sequence[Event], series: Series) -> Recent:
    """The most recent run, and mean COF [-] of the present life as a sparkline, thinned evenly with its last value
    kept.

    `events` is not empty; `series` is mean COF over the reference pressures, ordered by cycles.
    """
    last = max(events, key=lambda event: event.moment)
    values = [measurement.value for measurement in series.measurements]
    step = -(-len(values) // MAX_LINE_POINTS)  # rounded up
    return Recent(
        last_run=LastRun(
            run_id=last.run_id,
            kind=last.kind,
            cycles=whole(last.cycles),
            at=datetime.fromtimestamp(last.moment, UTC).isoformat(timespec="seconds"),
        ),
        mean_cof=[round(value, 6) for value in values[::-1][:: step or 1]][::-1],
    )
