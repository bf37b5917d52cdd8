"""The courses that a quantity may take: kinetics of general order with φ and ε of either sign, and a discrepancy beside.

    ξ(ζ) = ξ0 + Δ b(ζ),   b = σ [1 - (1 + ζ/φ)^-ε],   σ the product of the signs of φ and ε

With both positive it is eq. 6, whose order n = 1 + 1/ε lies above 1: it slows down and levels off. With both negative the
order lies below 1 and the course ends at |φ|: with |ε| < 1 it accelerates towards a cliff, at 1 it is a straight line, above
it levels off at the end. With one negative, damage feeds on itself: a power of cycles (φ > 0, the root among them), or
hyperbolic growth without bounds at |φ| (φ < 0). Between them lie, as courses of their own, the exponential to a floor, of
order 1 (ε → ∞), and the logarithm (ε → 0). Given (φ, ε) each is linear in ξ0 and Δ.

A form is a course with a size q of the discrepancy (`discrepancy`) and a law of the scatter, which is the same at every
value or a share of the value. Eq. 6 is physics and believed with little beside it;
the others are shapes only, and believed no further than a discrepancy of some size lets them.

Source: order n of dD/dζ = -k Dⁿ with D = (1 + ζ/φ)^-ε: n = 1 + 1/ε.
"""

import math
from enum import IntEnum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.degradation.general_order import ENDED, LOG_MOST
from models.tracking.criteria import COURSE_SHARES, OTHER_SHARES, OTHER_SIZES, SHARES, SIZES
from models.tracking.prior import TrackPrior


class CourseForm(IntEnum):
    """The kinds of course, by the signs of φ and ε; the exponential and the logarithm are limits between them."""

    EQ_6 = 0
    ENDING = 1
    POWER = 2
    HYPERBOLIC = 3
    EXPONENTIAL = 4
    LOGARITHM = 5

    @property
    def scale_sign(self) -> float:
        """The sign of φ: -1 where the course ends at a finite ζ."""
        return -1.0 if self in (CourseForm.ENDING, CourseForm.HYPERBOLIC) else 1.0

    @property
    def exponent_sign(self) -> float:
        """The sign of ε."""
        return -1.0 if self in (CourseForm.ENDING, CourseForm.POWER, CourseForm.LOGARITHM) else 1.0


#: Signs of φ and ε by course.
SCALE_SIGN, EXPONENT_SIGN = np.array([(course.scale_sign, course.exponent_sign) for course in CourseForm]).T
#: The course by twice whether φ is positive, and once more whether ε is.
_BY_SIGNS: NDArray[np.intp] = np.array(
    [CourseForm.ENDING, CourseForm.HYPERBOLIC, CourseForm.POWER, CourseForm.EQ_6], dtype=np.intp
)

#: |ε| of the two courses that have none: of the exponential, whose order is 1 and whose coordinate log φ stands for log τ,
#: and of the logarithm, whose change is counted in units of |ε|. Chosen: as far from 1 as leaves b its digits; no table.
_LARGE, _SMALL = 1e4, 1e-4
#: ε where it is fixed, and φ over exp of its coordinate, by course.
_EXPONENT = np.array(
    [{CourseForm.EXPONENTIAL: _LARGE, CourseForm.LOGARITHM: -_SMALL}.get(course, np.nan) for course in CourseForm]
)
_PLAIN_SCALE = np.array([_LARGE if course is CourseForm.EXPONENTIAL else course.scale_sign for course in CourseForm])
#: What a Δ of b is to be divided by to be that of σ [1 - (1 + ζ/φ)^-ε], by course.
UNIT_OF_CHANGE = np.array([_SMALL if course is CourseForm.LOGARITHM else 1.0 for course in CourseForm])
#: What 1 - (1 + ζ/φ)^-ε is multiplied by.
_HEIGHT = SCALE_SIGN * EXPONENT_SIGN / UNIT_OF_CHANGE
#: Courses whose ε is fixed: their coordinate log ε stands for nothing.
WITHOUT_EXPONENT = ~np.isnan(_EXPONENT)
_COURSES = np.array([course for course in CourseForm for _ in (OTHER_SIZES if course else SIZES)], dtype=np.intp)
_SIZES = np.concatenate([OTHER_SIZES if course else SIZES for course in CourseForm])
#: Of every form its course, its size q, and whether its scatter is a share of the value.
FORM_COURSE: NDArray[np.intp] = np.tile(_COURSES, 2)
FORM_SIZE = np.tile(_SIZES, 2)
FORM_PROPORTIONAL: NDArray[np.bool_] = np.repeat([False, True], _SIZES.size)
#: Whether a form has the least discrepancy that its course may have: none beside eq. 6.
LEAST_DISCREPANCY = np.where(FORM_COURSE == CourseForm.EQ_6, SIZES[0], OTHER_SIZES[0]) == FORM_SIZE


def basis(
    progress: FloatArray, log_scale: FloatArray, log_exponent: FloatArray, course: NDArray[np.intp]
) -> FloatArray:
    """b = σ [1 - (1 + ζ/φ)^-ε], in the shape of ζ/φ and of the course, to which ε is broadcast:
    `general_order.progress_fraction`, three times as quick.

    Accurate to 2e-16 absolute, not relative: here b is only compared with measurement noise. What grows is cut at LOG_MOST.
    """
    scale_inverse, exponent = np.exp(-log_scale), np.exp(log_exponent)
    has_courses = bool(course.any())
    if has_courses:
        fixed = _EXPONENT[course]
        scale_inverse = scale_inverse / _PLAIN_SCALE[course]
        exponent = np.where(np.isnan(fixed), exponent * EXPONENT_SIGN[course], fixed)
        height = _HEIGHT[course]
    power = np.asarray(progress * scale_inverse)
    power += 1.0
    if has_courses:
        np.maximum(power, ENDED, out=power)
    np.log(power, out=power)
    power *= -exponent
    if has_courses:
        np.minimum(power, LOG_MOST, out=power)
    np.exp(power, out=power)
    if not has_courses:
        return np.subtract(1.0, power, out=power)
    power *= -height
    power += height
    return power


@lru_cache(maxsize=64)
def log_form_weight(prior: TrackPrior) -> FloatArray:
    """Log prior probability of each form [f]; -inf for forms that the prior excludes."""
    home = prior.eq_6_share * np.concatenate([[prior.law_share], (1.0 - prior.law_share) * SHARES])
    other_forms = (1.0 - prior.eq_6_share) * np.outer(COURSE_SHARES, OTHER_SHARES).ravel()
    once = np.concatenate([home, other_forms])
    weight = np.outer([1.0 - prior.proportional_share, prior.proportional_share], once).ravel()
    with np.errstate(divide="ignore"):
        np.log(weight, out=weight)
    weight.setflags(write=False)
    return weight


def form_of(course: NDArray[np.intp], size: FloatArray, proportional: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The form [n] of courses, sizes q and laws of the scatter, each [n]."""
    off = np.abs(_SIZES - size[:, None]) + (course[:, None] != _COURSES)
    return np.asarray(off.argmin(axis=1) + np.where(proportional, _SIZES.size, 0), dtype=np.intp)


def scatter_growth(form: NDArray[np.intp], relative: FloatArray) -> FloatArray:
    """Factors [n, t] on the scatter variance s² under forms [n], from the tests' relative squared values `relative`
    [t]; 1 for forms whose scatter is the same at every value."""
    return np.where(FORM_PROPORTIONAL[form][:, None], relative, 1.0)


def course_of(scale: FloatArray, exponent: FloatArray) -> NDArray[np.intp]:
    """The course [n] of signed φ and ε, each [n]."""
    course = np.asarray(_BY_SIGNS[2 * (scale > 0.0) + (exponent > 0.0)], dtype=np.intp)
    for fixed in (CourseForm.EXPONENTIAL, CourseForm.LOGARITHM):
        course[exponent == _EXPONENT[fixed]] = fixed
    return course


def coefficients_at(
    log_scale: FloatArray, log_exponent: FloatArray, course: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Signed φ and ε from the coordinates (log φ, log ε) of courses, all broadcast together."""
    fixed = _EXPONENT[course]
    return np.exp(log_scale) * _PLAIN_SCALE[course], np.where(
        np.isnan(fixed), np.exp(log_exponent) * EXPONENT_SIGN[course], fixed
    )


def coordinates_of(scale: FloatArray, exponent: FloatArray, course: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    """Coordinates (log φ, log ε) from signed φ and ε; the inverse of `coefficients_at`."""
    free = np.isnan(_EXPONENT[course])
    return np.log(scale / _PLAIN_SCALE[course]), np.where(free, np.log(np.abs(exponent)), 0.0)


def log_scale_at(place: FloatArray, course: NDArray[np.intp], span: float) -> tuple[FloatArray, FloatArray]:
    """log |φ| at a lattice coordinate `place`, and log |d log φ / d place|; `place` broadcasts against `course`.

    A course that ends does so beyond what was measured, up to the progress `span`: its place is log(|φ| - span).
    """
    ends = SCALE_SIGN[course] < 0.0
    beyond = np.broadcast_to(place, np.broadcast_shapes(place.shape, course.shape)).copy()
    np.logaddexp(math.log(span), place, out=beyond, where=ends)
    return beyond, place - beyond


def place_of(log_scale: FloatArray, course: NDArray[np.intp], span: float) -> FloatArray:
    """The lattice coordinate of log |φ|, the inverse of `log_scale_at`; for a course that ended before `span`, that of
    an end just beyond it."""
    place, ends = log_scale.copy(), SCALE_SIGN[course] < 0.0
    place[ends] += np.log(-np.expm1(np.minimum(math.log(span) - log_scale[ends], -ENDED)))
    return place
