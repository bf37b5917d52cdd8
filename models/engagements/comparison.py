"""How far an engagement is from the first ones of its clutch: three indicators of the sliding speed alone.

With x the speed at 50 moments of the reference's duration, zero once the shaft stands, and r the mean of the reference's:

    normalised duration   τ / τ_r
    Euclidean distance    ‖x - r‖ / ‖r‖
    spectral angle        arccos(x·r / (‖x‖ ‖r‖))   [rad]

τ lasts from contact to the end of slip; τ_r is the mean over the first engagements. All three need no torque sensor. Valid
for engagements of one duty: the same initial speed and pressure. Noise alone gives a distance and an angle of about their
standard error.

Source: Ompusunggu, Papy, Vandenplas, Sas, Van Brussel, "Condition monitoring method for automatic transmission clutches",
International Journal of Prognostics and Health Management 2012; also PHM Europe 2012. The three are named in its abstract;
how the signal is framed is this project's.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.engagements.slip import ValueWithError

#: Points of a kept course of speed. Chosen: a course that is kept is some 600 bytes.
COURSE_POINTS = 65


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedCourse:
    """The speed of one slip [65] rad/s at equal steps from contact to its end, or the mean of several [50]; `duration` [s]
    of that, `noise` [rad/s] the deviation of a point."""

    duration: ValueWithError
    speed: FloatArray
    noise: float

    @property
    def time(self) -> FloatArray:
        """Times [s since contact] of the steps."""
        return np.linspace(0.0, self.duration.value, self.speed.size)

    def at(self, time: FloatArray) -> FloatArray:
        """Speed [m] rad/s at time [m] s since contact; zero once the shaft stands."""
        return np.asarray(np.interp(time, self.time, self.speed, right=0.0), dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Three indicators of an engagement's deviation from the reference; `spectral_angle` in rad, the others without a
    unit."""

    normalised_duration: ValueWithError
    euclidean_distance: ValueWithError
    spectral_angle: ValueWithError


def reference_of(courses: Sequence[SpeedCourse]) -> SpeedCourse:
    """The reference course from several engagements' courses. Raises ValueError where there is none."""
    if not courses:
        raise ValueError("a reference needs at least one engagement, got none")
    count = len(courses)
    mean = ValueWithError(
        value=sum(course.duration.value for course in courses) / count,
        sd=math.hypot(*(course.duration.sd for course in courses)) / count,
    )
    time = np.linspace(0.0, mean.value, 50)
    return SpeedCourse(
        duration=mean,
        speed=np.mean([course.at(time) for course in courses], axis=0),
        noise=math.hypot(*(course.noise for course in courses)) / count,
    )


def compared(course: SpeedCourse, reference: SpeedCourse) -> Comparison:
    """Comparison of a course with the reference. Standard errors are of the speed's noise and of the moments of contact
    and end."""
    x, r = course.at(reference.time), reference.speed
    size, measured_size = float(np.linalg.norm(x)), float(np.linalg.norm(r))
    cosine = float(x @ r) / (size * measured_size)
    rate = float(np.linalg.norm(np.gradient(x, reference.time)))
    error = math.hypot(course.noise, reference.noise, rate * course.duration.sd)
    ratio = course.duration.value / reference.duration.value
    ratio_sd = math.hypot(course.duration.sd, ratio * reference.duration.sd) / reference.duration.value
    return Comparison(
        normalised_duration=ValueWithError(value=ratio, sd=ratio_sd),
        euclidean_distance=ValueWithError(value=float(np.linalg.norm(x - r)) / measured_size, sd=error / measured_size),
        spectral_angle=ValueWithError(value=math.acos(min(max(cosine, -1.0), 1.0)), sd=error / size),
    )


def same_duty(value: float, reference: float) -> bool:
    """Whether an initial speed or a highest pressure nearly equals that of the reference."""
    return abs(value - reference) <= 0.1 * abs(reference)  # beyond it an engagement is of another duty


def bin_means(time: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """Means [m] of a channel [n], linear between its samples, over steps centred on equally spaced times `at` [m]."""
    step = float(at[1] - at[0])
    edges = np.concatenate([at - step / 2, [at[-1] + step / 2]])
    everywhere = np.union1d(time, edges)
    course = np.interp(everywhere, time, values)
    sums = np.concatenate([[0.0], np.cumsum(np.diff(everywhere) * (course[1:] + course[:-1]) / 2)])
    return np.asarray(np.diff(np.interp(edges, everywhere, sums)) / step, dtype=np.float64)
