"""A doubt in words: what is odd, the value, what would be expected, the likely slip, and what to do."""

import math

from service.columns import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS
from service.errors import Notice
from service.lives.plausibility import criteria
from service.lives.plausibility.likelihood import History
from service.lives.plausibility.reading import Reading
from service.lives.plausibility.slips import Slip

OFF_PACE, AGAINST_TIME = "cycles_off_pace", "cycles_against_time"
BEYOND_PHYSICS, OFF_COURSE = "cof_beyond_physics", "cof_off_course"
UNIT, DEAD = "unit", "dead_channel"

_CYCLES = ("extra_zero", "lost_zero", "swapped_digits", "other_cycles")


def doubt(slip: Slip, reading: Reading, history: History) -> Notice:
    """The doubt of which `slip` is the most probable explanation."""
    if slip.name in _CYCLES:
        return _of_cycles(slip, reading, history)
    if slip.unit and (slip.name in ("oil", "speed") or _expected_then(slip.likely, history)):
        return _of_unit(slip, reading, history)
    if slip.name == "dead_pressure":
        message = (
            f"pressure says that the clutch is open, and its torque of {reading.torque:.3g} Nm is that of a pressed one: is "
            "the pressure sensor connected? Withdraw the run, or confirm it."
        )
        return Notice(code=DEAD, message=message)
    return _of_cof(reading, history)


def negative(reading: Reading) -> Notice:
    """The doubt of a torque that pushes."""
    message = (
        f"torque acts with the sliding, a COF of {reading.cof:.3g}: is the sign of torque or speed the wrong way round? "
        "Send it with a positive torque, or confirm it."
    )
    return Notice(code=BEYOND_PHYSICS, message=message)


def _of_cycles(slip: Slip, reading: Reading, history: History) -> Notice:
    against_time = history.out_of_order(reading.cycles)
    sentences = [_gap(reading, history)]
    if against_time:
        sentences.append("By its started_at it is out of order with runs of other cycles.")
    cof = _cof_there(reading, history)
    if cof:
        sentences.append(cof)
    guessed = slip.name != "other_cycles" and history.pace.cycles.size > 0
    ask = f"Is it {_number(slip.likely.cycles)}? " if guessed else ""
    message = " ".join([*sentences, f"{ask}Confirm or correct it."])
    return Notice(code=AGAINST_TIME if against_time else OFF_PACE, message=message)


def _gap(reading: Reading, history: History) -> str:
    cycles = history.pace.cycles
    if cycles.size == 0:
        return f"{_number(reading.cycles)} cycles are more than clutches last."
    before = cycles[cycles < reading.cycles - 0.5]
    if before.size == 0 or reading.cycles <= cycles[-1] + 0.5:
        latest = _number(float(cycles[-1]))
        return f"{_number(reading.cycles)} cycles lie among those of earlier runs, the last of which was at {latest}."
    gap = f"{_number(reading.cycles)} cycles are {_number(reading.cycles - before[-1])} after the run before"
    usual = history.pace.usual_gap
    return f"{gap}." if usual is None else f"{gap}, whose like were about {_number(usual)} apart."


def _cof_there(reading: Reading, history: History) -> str:
    """Where COF is not that of those cycles."""
    if not history.lives or not history.lives[-1].reference:
        return ""
    compared = _beside_expected(reading, history)
    if compared is None:
        return ""
    cof, low, high = compared
    return (
        "" if low <= cof <= high else f"Its mean COF of {cof:.3g} is not that of those cycles, {low:.3g} to {high:.3g}."
    )


def _of_unit(slip: Slip, reading: Reading, history: History) -> Notice:
    if slip.name == "oil":
        oil = (reading.oil or 0.0) - ZERO_CELSIUS
        message = f"oil temperature is {oil:.4g} °C: was it sent in {slip.unit}?"
    else:
        channel, ours, scale = {
            "pressure": ("pressure", "bar", (reading.pressure or 0.0) / PASCALS_PER_BAR),
            "torque": ("torque", "Nm", None),
            "speed": ("speed", "rpm", (reading.speed or 0.0) / RADIANS_PER_SECOND_PER_RPM),
        }[slip.name]
        size = "" if scale is None else f" is up to {scale:.4g} {ours}"
        cof = f" a COF of {reading.cof:.3g}" if reading.cof is not None else ""
        expected = _expected(reading, history)
        message = (
            f"{channel}{size or ' gives'}{' and gives' if size else ''}{cof}, {expected}: was it sent in {slip.unit}?"
        )
    return Notice(code=UNIT, message=f"{message} Withdraw the run and send it in the channel's unit, or confirm it.")


def _expected_then(likely: Reading, history: History) -> bool:
    """Whether COF without the slip is one that is expected: else no unit of torque or pressure is asked for, though it
    explains a part."""
    compared = _beside_expected(likely, history)
    return compared is None or compared[1] <= compared[0] <= compared[2]


def _beside_expected(reading: Reading, history: History) -> tuple[float, float, float] | None:
    """COF as the last life's tests show it, and from where to where it is expected; None where a run shows none."""
    compared = None if reading.cof is None else history.comparable(reading, max(len(history.lives) - 1, 0))
    if compared is None:
        return None
    predicted, column = history.predicted(reading.cycles)
    return math.exp(compared[0]), *predicted.interval(column, compared[1])


def _expected(reading: Reading, history: History) -> str:
    predicted, column = history.predicted(reading.cycles)
    low, high = predicted.interval(column, reading.spread)
    return f"where {low:.3g} to {high:.3g} is expected"


def _of_cof(reading: Reading, history: History) -> Notice:
    compared = history.comparable(reading, max(len(history.lives) - 1, 0))
    cof = reading.cof if compared is None else math.exp(compared[0])
    log_off = abs(math.log(max(cof or 1e-9, 1e-9) / criteria.COF)) / criteria.LOG_COF_SD
    beyond = log_off > 2.5
    cause = "Is a sensor or a unit wrong?" if beyond else "Is it another clutch's test?"
    expected = f"{_expected(reading, history)} at {_number(reading.cycles)} cycles"
    message = f"mean COF is {cof:.3g}, {expected}. {cause} Withdraw the run, or confirm it."
    return Notice(code=BEYOND_PHYSICS if beyond else OFF_COURSE, message=message)


def _number(value: float) -> str:
    return f"{value:.0f}" if float(value).is_integer() else f"{value:g}"
