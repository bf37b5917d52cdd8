"""What a prediction is warned of (an odd last test, a course that eq. 6 cannot take, forecasts that fared badly), and a run
in its clutch's history."""

import math
from collections.abc import Sequence

from models.prognosis.back_cast import BackCast
from models.prognosis.course_shares import CourseName, CourseShare
from models.tracking.innovation import last_innovation
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior
from models.tracking.prior import Prior
from service.columns import ZERO_CELSIUS, bar
from service.errors import Notice
from service.lives.criteria import EQ_6_DOUBTED, OTHER_OIL
from service.lives.history import ByPressure, Event, Life, nearest

#: The warning of a last test that lies far off what the tests before it predict.
OFF_TRACK = "off_track"
#: The warning of a prediction whose course is none of eq. 6's.
NOT_EQ_6 = "not_eq6"
#: The warning of a prediction whose forerunners held too few of the tests since.
MISSED_FORECASTS = "missed_forecasts"
#: Warnings of a run in its clutch's history, written anew where the history changes: it arrived after a run of more cycles,
#: its pressures or its oil temperature are not those of the first test, its mean COF is not what those before it predict.
LATE, OTHER_PRESSURES, OTHER_OIL_TEMPERATURE = "late_arrival", "other_pressures", "other_oil_temperature"
OF_HISTORY = LATE, OTHER_PRESSURES, OTHER_OIL_TEMPERATURE, OFF_TRACK


def not_eq_6(courses: Sequence[CourseShare]) -> list[Notice]:
    """The warning of a course that eq. 6 cannot take; `courses`: the most probable first."""
    if any(share.name is CourseName.EQ_6 and share.probability >= EQ_6_DOUBTED for share in courses):
        return []
    named = [share for share in courses if share.name is not CourseName.EQ_6]
    others = ", ".join(f"{share.name.value}: {share.probability:.0%}" for share in named)
    message = (
        f"the tests follow a course that eq. 6 cannot take ({others}); the forecast is that of such courses "
        "and of whatever may come beside them"
    )
    return [Notice(code=NOT_EQ_6, message=message)]


def missed(back_cast: BackCast) -> list[Notice]:
    """The warning of a clutch whose earlier forecasts held too few of the tests since."""
    if not back_cast.surprising:
        return []
    message = (
        f"earlier forecasts of this clutch held {back_cast.held} of the {back_cast.misses.size} tests since, where nine in "
        f"ten are meant to be: remaining life is stated wider (ratios to its median, to the power {back_cast.widening:.2g})"
    )
    return [Notice(code=MISSED_FORECASTS, message=message)]


def off_track(posterior: Posterior, measurements: Sequence[Measurement], prior: Prior) -> list[Notice]:
    """The warning of a last test that lies far off what the tests before it predict, and no event lies between."""
    innovation = last_innovation(posterior, measurements, prior)
    if innovation is None or not innovation.off_track:
        return []
    deviations = innovation.value
    side = "below" if deviations < 0 else "above"
    size = f"{abs(deviations):.1f}" if math.isfinite(deviations) else "very many"
    message = (
        f"the last test's mean COF of {measurements[-1].value:.4g} lies {size} deviations {side} what the tests before it "
        "predict: an outlying run, or the clutch has left its course"
    )
    return [Notice(code=OFF_TRACK, message=message)]


def late_arrival(cycles: float, latest: float) -> list[Notice]:
    """A run that arrived after another of more cycles; `latest` are the most of those that were there."""
    if cycles >= latest:
        return []
    message = f"the run's {cycles:g} cycles lie before the latest known {latest:g}: all was tracked anew"
    return [Notice(code=LATE, message=message)]


def other_pressures(reference: ByPressure, cofs: ByPressure) -> list[Notice]:
    """A test that cannot be compared with the reference test: none of its pressures is one of that's."""
    if not cofs or any(nearest(level, cofs) is not None for level in reference):
        return []
    measured = ", ".join(f"{bar(level):g}" for level in sorted(reference))
    message = f"none of its pressures is one of the first stationary test's ({measured} bar): no track uses it"
    return [Notice(code=OTHER_PRESSURES, message=message)]


def other_oil(life: Life, event: Event) -> list[Notice]:
    """A test in oil that is much warmer or colder than the reference test's."""
    if not life.in_other_oil(event) or event.oil_temperature is None or life.reference_oil is None:
        return []
    oil, reference = (kelvin - ZERO_CELSIUS for kelvin in (event.oil_temperature, life.reference_oil))
    message = (
        f"its oil was at {oil:.0f} °C on average, that of the first stationary test at {reference:.0f} °C, more than "
        f"{OTHER_OIL:g} °C apart: no track uses it but under an adopted model that corrects for oil temperature"
    )
    return [Notice(code=OTHER_OIL_TEMPERATURE, message=message)]
