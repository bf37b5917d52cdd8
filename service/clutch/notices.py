"""The warnings of runs and predictions, in words, and which of them a change of the history writes again."""

import math
from collections.abc import Mapping, Sequence

from models.prognosis.back_cast import BackCast
from models.prognosis.course_shares import CourseName, CourseProbability
from models.prognosis.criteria import HORIZON
from models.prognosis.stated_end import NewLater
from models.tracking.criteria import FAR
from service.api.life import LifePrediction
from service.api.run import Evaluation, Warned
from service.channels import ZERO_CELSIUS, bar
from service.clutch.criteria import EQ_6_DOUBTED, OTHER_OIL
from service.clutch.items import ENDED, INSUFFICIENT, share_of_way, warned
from service.clutch.timeline import (
    ByPressure,
    Event,
    Life,
    Series,
    date_of,
    latest_before,
    nearest,
    with_believed_dates,
)
from service.errors import Notice

#: The filter whose normals suit eq. 6 alone.
UNSCENTED = "ukf"
#: The warning of a last test that lies far off what the tests before it predict.
OFF_TRACK = "off_track"
#: Warnings of a run in its clutch's history, written again where the history changes: it arrived after a run of more cycles,
#: its pressures or its oil temperature are not those of the first test, its mean COF is not what those before it predict,
#: its date is not where its cycles are.
LATE, OTHER_PRESSURES, OTHER_OIL_TEMPERATURE = "late_arrival", "other_pressures", "other_oil_temperature"
ODD_DATE = "date_out_of_order"
OF_HISTORY = LATE, OTHER_PRESSURES, OTHER_OIL_TEMPERATURE, OFF_TRACK, ODD_DATE


def not_eq_6(courses: Sequence[CourseProbability]) -> list[Notice]:
    """The warning that mean COF follows a course that eq. 6 cannot describe; `courses`: most probable first."""
    if any(share.name is CourseName.EQ_6 and share.probability >= EQ_6_DOUBTED for share in courses):
        return []
    named = [share for share in courses if share.name is not CourseName.EQ_6]
    shares = ", ".join(f"{share.name.value.replace('_', ' ')}: {share.probability:.0%}" for share in named)
    message = (
        f"the clutch does not age by the usual law ({shares}). The forecast follows the trend of the tests and allows for "
        "further changes"
    )
    return [Notice(code="not_eq6", message=message)]


def approximate(method: str, courses: Sequence[CourseProbability]) -> list[Notice]:
    """The label of an answer by an unscented filter whose most probable course, the first, is not eq. 6: its normal
    distributions follow the curved ridges of other courses only roughly."""
    if method != UNSCENTED or courses[0].name is CourseName.EQ_6:
        return []
    named = courses[0].name.value.replace("_", " ")
    message = (
        f"this method is approximate here: the most probable course ({named}, {courses[0].probability:.0%}) is not eq. 6. "
        "Plan by method=particle"
    )
    return [Notice(code="approximate", message=message)]


def new_extrapolated(series: Series, late: NewLater | None, fraction: float) -> list[Notice]:
    """The warning of a clutch that, as tracked, had passed more than half of its way to the end before its first test:
    the result then depends on an unmeasured initial value. A bench counter that began with another clutch looks the
    same."""
    if late is None:
        return []
    (cycles, (first, _)), initial = series.as_measured(0), late.extrapolated
    if (share_of_way(first, initial, fraction * initial) or 0.0) >= 0.5:
        return []
    message = (
        f"the first test is at {cycles:,.0f} cycles with a mean COF of {first:.3g}; extrapolated to 0 cycles it "
        f"would be {initial:.3g}. With a probability of {late.probability:.0%} the counter began with another clutch, and "
        "this clutch was new at its first test. The forecast averages over both cases. If the clutch was new, send "
        f"maintenance with the event rebuild at {cycles:,.0f} cycles: its life then begins there"
    )
    return [Notice(code="new_extrapolated", message=message)]


def missed(back_cast: BackCast) -> list[Notice]:
    """The warning of a clutch whose earlier forecast intervals held too few of the later tests."""
    if not back_cast.surprising:
        return []
    earlier, later = back_cast.widening
    message = (
        f"the 90 % intervals of earlier forecasts contained only {back_cast.held} of {back_cast.misses.size} later tests. "
        f"The interval of the remaining life is therefore {earlier:.2g} times as wide below its median and {later:.2g} "
        "times above it, on a logarithmic scale"
    )
    return [Notice(code="missed_forecasts", message=message)]


def filters_disagree(answers: Mapping[str, LifePrediction]) -> list[Notice]:
    """The warning if one filter's median lies outside another's 90 % interval, from predictions by method."""
    predictions = {m: a.remaining_cycles for m, a in answers.items() if a.status not in (INSUFFICIENT, ENDED)}
    ends = [
        [math.inf if (cycles := prediction[q]) is None else cycles for q in ("0.05", "0.5", "0.95")]
        for prediction in predictions.values()
    ]
    if all(low <= median <= high for low, _, high in ends for _, median, _ in ends):
        return []
    intervals = "; ".join(f"{interval_in_words(prediction)} by {method}" for method, prediction in predictions.items())
    message = f"the methods disagree about the remaining cycles: {intervals}. Plan with the lowest, and test again soon"
    return [Notice(code="filters_disagree", message=message)]


def interval_in_words(remaining: Mapping[str, float | None]) -> str:
    """The median of remaining cycles with its 90 % interval, in words."""
    low, median, high = (remaining[quantile] for quantile in ("0.05", "0.5", "0.95"))
    if median is None:
        return "an unknown number of" if low is None else f"at least {low:,.0f}"
    upper = f"over {max(HORIZON, median):,.0f}" if high is None else f"{high:,.0f}"
    return f"{median:,.0f} (90 %: {low:,.0f} to {upper})"


def off_track(back_cast: BackCast, value: float) -> list[Notice]:
    """The warning of a last test far from its prediction by the earlier tests."""
    deviations = float(back_cast.innovation[0]) if back_cast.innovation.size else 0.0
    if not abs(deviations) > FAR:
        return []
    side = "below" if deviations < 0 else "above"
    size = f"{abs(deviations):.1f}" if math.isfinite(deviations) else "very many"
    message = (
        f"the last test's mean COF of {value:.4g} is {size} standard deviations {side} its prediction from "
        "the earlier tests. Repeat the test: if the value stays, the clutch has changed"
    )
    return [Notice(code=OFF_TRACK, message=message)]


def new_level(cycles: Sequence[float]) -> list[Notice]:
    """The warning that COF stepped to a new level at tests at these cycles since new, with no event to explain it."""
    if not cycles:
        return []
    message = (
        f"mean COF has a new level since the test at {' and at '.join(f'{at:,.0f}' for at in cycles)} cycles, and no "
        "event explains it. Look at the lining and the sensors; if something was changed, send it as maintenance"
    )
    return [Notice(code="new_level", message=message)]


def late_arrival(cycles: float, latest: float) -> list[Notice]:
    """The notice of a run that arrived after one of more cycles; `latest`: the most cycles of earlier arrivals."""
    if cycles >= latest:
        return []
    message = (
        f"this run at {cycles:g} cycles arrived after one at {latest:g}: the results of this life were computed again"
    )
    return [Notice(code=LATE, message=message)]


def odd_dates(life: Life) -> dict[str, list[Notice]]:
    """By run_id, the warning of a date that does not fit those of the other runs of a life in the order of their cycles."""
    believed = {event.run_id for event in with_believed_dates(life.events)}
    odd = [event for event in life.events if event.dated and event.run_id not in believed]
    message = (
        "the date (started_at) {} does not fit the dates of the other runs in the order of their cycles. It takes no part "
        "in the pace: check the rig's clock and the cycles"
    )
    return {event.run_id: [Notice(code=ODD_DATE, message=message.format(date_of(event.moment)))] for event in odd}


def other_pressures_notice(reference: ByPressure, cofs: ByPressure) -> list[Notice]:
    """The notice of a test that shares no pressure with the reference test and cannot be compared with it."""
    if not cofs or any(nearest(level, cofs) is not None for level in reference):
        return []
    measured = ", ".join(f"{bar(level):g}" for level in sorted(reference))
    message = (
        f"this test has no pressure of the first test ({measured} bar), so it does not count for the remaining life"
    )
    return [Notice(code=OTHER_PRESSURES, message=message)]


def left_out(tests: int, runs: int) -> list[Notice]:
    """The warning of a life in which only these `runs` of its tests can be compared with the first."""
    if runs >= tests:
        return []
    verb = "does" if tests - runs == 1 else "do"
    message = (
        f"{tests - runs} of {tests} tests {verb} not count: the pressures differ from those of the first test, or the "
        f"oil temperature by more than {OTHER_OIL:g} °C. The warnings of each run say which"
    )
    return [Notice(code="tests_left_out", message=message)]


def other_oil_notice(life: Life, event: Event) -> list[Notice]:
    """The notice of a test in oil much warmer or colder than the reference test's."""
    if not life.in_other_oil(event) or event.oil_temperature is None or life.reference_oil is None:
        return []
    oil, reference = (kelvin - ZERO_CELSIUS for kelvin in (event.oil_temperature, life.reference_oil))
    message = (
        f"the mean oil temperature was {oil:.0f} °C in this test and {reference:.0f} °C in the first, more than "
        f"{OTHER_OIL:g} °C apart. The test counts only under an adopted model that corrects for oil temperature"
    )
    return [Notice(code=OTHER_OIL_TEMPERATURE, message=message)]


def history_warnings(
    lives: Sequence[Life], off_track: Mapping[str, list[Warned]], *, run_id: str | None = None
) -> dict[str, list[Warned]]:
    """run_id -> warnings that depend on the history, for every run or one; `off_track`: the warnings of predictions
    after tests."""
    latest = latest_before([event for life in lives for event in life.events])
    dates = {name: notices for life in lives for name, notices in odd_dates(life).items()}
    return {
        event.run_id: [
            *warned(late_arrival(event.cycles, latest[event.run_id])),
            *warned(other_pressures_notice(life.reference, event.cofs)),
            *warned(other_oil_notice(life, event)),
            *warned(dates.get(event.run_id, [])),
            *off_track.get(event.run_id, ()),
        ]
        for life in lives
        for event in life.events
        if run_id is None or event.run_id == run_id
    }


def warned_again(
    lives: Sequence[Life], off_track: Mapping[str, list[Warned]], receipts: Mapping[str, Evaluation]
) -> dict[str, Evaluation]:
    """The receipts with changed warnings about the history."""
    changed = {}
    for run_id, noticed in history_warnings(lives, off_track).items():
        before = receipts[run_id].warnings
        after = [warning for warning in before if warning.code not in OF_HISTORY] + noticed
        if after != before:
            changed[run_id] = receipts[run_id].model_copy(update={"warnings": after})
    return changed
