"""The slips that a run may suffer on its way: each is the run as it would have been without it, and how probable it is."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from models.clutch import Geometry
from service.columns import RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS
from service.lives.plausibility import criteria
from service.lives.plausibility.likelihood import History
from service.lives.plausibility.pace import log_anywhere, normal
from service.lives.plausibility.reading import Reading


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip:
    """`log_weight` is log(prior odds × likelihood); `likely` is the run without the slip, `unit` what was sent in."""

    name: str
    log_weight: float
    likely: Reading
    unit: str = ""

    def against(self, as_sent: float) -> "Slip":
        """With its weight over that of the run as it was sent."""
        return replace(self, log_weight=self.log_weight - as_sent)


#: Units in which a channel may have been sent: channel, its unit here, the unit, and how many of it are one of ours.
UNITS = (
    ("pressure", "bar", "psi", 14.503_774),
    ("pressure", "bar", "kPa", 100.0),
    ("pressure", "bar", "MPa", 0.1),
    ("torque", "Nm", "lbf ft", 0.737_562),
    ("torque", "Nm", "lbf in", 8.850_746),
    ("torque", "Nm", "kNm", 1e-3),
    ("torque", "Nm", "kgf m", 0.101_972),
    ("torque", "Nm", "Nmm", 1e3),
    ("speed", "rpm", "rad/s", RADIANS_PER_SECOND_PER_RPM),
    ("speed", "rpm", "1/s", 1 / 60),
)


def slips_of(reading: Reading, history: History, geometry: Geometry) -> Iterator[Slip]:
    """All slips with their weights."""
    yield from digit_slips(reading, history)
    yield from other_cycles(reading, history)
    yield from other_units(reading, history)
    yield from other_clutches(reading, history)
    yield from dead_pressure(reading, history, geometry)


def digit_slips(reading: Reading, history: History) -> Iterator[Slip]:
    """A zero too many, a zero lost, two neighbouring digits swapped."""
    for name, values in mistyped(reading.cycles).items():
        for cycles in values:
            likely = replace(reading, cycles=cycles)
            weight = math.log(criteria.DIGIT_SLIP / len(values)) + history.log_likelihood(likely)
            yield Slip(name=name, log_weight=weight, likely=likely)


def other_cycles(reading: Reading, history: History) -> Iterator[Slip]:
    """Cycles that are mistyped otherwise: the run was made where the next one is expected."""
    likely = replace(reading, cycles=history.pace.expected())
    weight = math.log(criteria.OTHER_CYCLES) + log_anywhere(reading.cycles)
    yield Slip(
        name="other_cycles",
        log_weight=weight + history.of_cof(likely) + history.of_protocol(reading),
        likely=likely,
    )


def other_units(reading: Reading, history: History) -> Iterator[Slip]:
    """A channel in another unit."""
    if reading.cof is not None:
        for channel, _, unit, factor in UNITS:
            likely = reading.scaled(**{channel: factor})
            weight = math.log(criteria.OTHER_UNIT / len(UNITS)) + history.log_likelihood(likely)
            yield Slip(name=channel, log_weight=weight, likely=likely, unit=unit)
    if reading.oil is not None:
        celsius = reading.oil - ZERO_CELSIUS
        for unit, oil in (("K", celsius), ("°F", (celsius - 32.0) / 1.8 + ZERO_CELSIUS)):
            likely = replace(reading, oil=oil)
            weight = math.log(criteria.OTHER_UNIT / len(UNITS)) + history.log_likelihood(likely)
            yield Slip(name="oil", log_weight=weight, likely=likely, unit=unit)


def other_clutches(reading: Reading, history: History) -> Iterator[Slip]:
    """Another clutch's test: COF is that of any clutch; its cycles are its own, or those expected here.

    Before the first test of a clutch any clutch's may be its own.
    """
    of_cof = log_cof_of_any(reading, history)
    if of_cof is None or not any(course.cycles.size for course in history.courses):
        return
    of_cof += history.of_protocol(reading)
    for name, weight, of_cycles in (
        ("other_clutch", criteria.OTHER_CLUTCH, log_anywhere(reading.cycles)),
        ("other_test", criteria.OTHER_TEST, history.of_cycles(reading)),
    ):
        yield Slip(name=name, log_weight=math.log(weight) + of_cof + of_cycles, likely=reading)


def dead_pressure(reading: Reading, history: History, geometry: Geometry) -> Iterator[Slip]:
    """A torque of a pressed clutch, and a pressure that says it is open."""
    if reading.torque is None or reading.torque <= 0:
        return
    pressed = geometry.torque_per_cof(criteria.PRESSURE)
    for life in history.lives[-1:]:
        if life.reference:
            pressed = geometry.torque_per_cof(sum(life.reference) / len(life.reference))
    predicted, column = history.predicted(reading.cycles)
    low, high = predicted.interval(column, 0.0)
    centre, size = 0.5 * math.log(low * high), math.log(reading.torque / pressed)
    dead = normal(size, centre, 0.3 + 0.25 * math.log(high / low))
    drag = normal(size, centre + math.log(criteria.DRAG), criteria.LOG_DRAG_SD)
    weight = math.log(criteria.OTHER_TEST * dead + 1e-250) - math.log(drag + 1e-250)
    yield Slip(name="dead_pressure", log_weight=weight + history.log_likelihood(reading), likely=reading)


def log_cof_of_any(reading: Reading, history: History) -> float | None:
    """log density of a run's COF as that of any clutch; None where it shows none."""
    compared = history.comparable(reading, len(history.lives) - 1)
    if reading.cof is None or compared is None:
        return None
    z = (compared[0] - math.log(criteria.COF)) / criteria.LOG_COF_SD
    return -0.5 * z * z - math.log(criteria.LOG_COF_SD * math.sqrt(2 * math.pi))


def mistyped(cycles: float) -> dict[str, list[float]]:
    """What `cycles` may have been before a slip of the fingers."""
    if not cycles.is_integer() or cycles < 1 or cycles >= 1e12:
        return {}
    digits = str(int(cycles))
    swapped = {
        int(padded[:k] + padded[k + 1] + padded[k] + padded[k + 2 :])
        for padded in (digits, "0" + digits)
        for k in range(len(padded) - 1)
    }
    lost, extra = [10.0 * cycles], [cycles / 10.0] if cycles % 10 == 0 else []
    others = sorted(swapped - {int(cycles), *map(int, lost), *map(int, extra)})
    return {
        name: values
        for name, values in (
            ("extra_zero", extra),
            ("lost_zero", lost),
            ("swapped_digits", [float(value) for value in others]),
        )
        if values
    }
