"""What a prediction is warned of: an odd last test, a course that eq. 6 cannot take, earlier forecasts that fared badly."""

import math
from collections.abc import Sequence

from models.prognosis.back_cast import BackCast
from models.prognosis.course_shares import CourseName, CourseShare
from models.tracking.innovation import last_innovation
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior
from models.tracking.prior import Prior
from service.lives.criteria import EQ_6_DOUBTED
from service.lives.run_analysis import Notice

#: The warning of a last test that lies far off what the tests before it predict.
OFF_TRACK = "off_track"
#: The warning of a prediction whose course is none of eq. 6's.
NOT_EQ_6 = "not_eq6"
#: The warning of a prediction whose forerunners held too few of the tests since.
MISSED_FORECASTS = "missed_forecasts"


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
