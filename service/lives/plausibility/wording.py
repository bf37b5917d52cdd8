"""A doubt in words: what is odd, the value, what would be expected, the likely slip, and what to do."""

import math

from models.plausibility import criteria
from models.plausibility.judgement import Verdict
from models.plausibility.runs import Reading
from models.plausibility.slips import OF_CYCLES, OTHER_CYCLES
from service.columns import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS
from service.errors import Notice
from service.lives.history import Shown
from service.lives.plausibility.reading import DEAD_PRESSURE

OFF_PACE, AGAINST_TIME = "cycles_off_pace", "cycles_against_time"
BEYOND_PHYSICS, OFF_COURSE = "cof_beyond_physics", "cof_off_course"
UNIT, DEAD = "unit", "dead_channel"


def doubt(verdict: Verdict, sent: Reading, shown: Shown) -> Notice:
    """The doubt of which the verdict's slip is the most probable explanation."""
    slip = verdict.slip
    if slip.name in OF_CYCLES:
        return _of_cycles(verdict, sent)
    if slip.unit and (slip.name in ("oil", "speed") or _expected_then(verdict)):
        return _of_unit(verdict, shown)
    if slip.name == DEAD_PRESSURE:
        message = (
            f"pressure says that the clutch is open, and its torque of {shown.open_torque or 0.0:.3g} Nm is that of a "
            "pressed one: is the pressure sensor connected? Withdraw the run, or confirm it."
        )
        return Notice(code=DEAD, message=message)
    return _of_cof(verdict, sent)


def negative(cof: float) -> Notice:
    """The doubt of a torque that pushes."""
    message = (
        f"torque acts with the sliding, a COF of {cof:.3g}: is the sign of torque or speed the wrong way round? "
        "Send it with a positive torque, or confirm it."
    )
    return Notice(code=BEYOND_PHYSICS, message=message)


def _of_cycles(verdict: Verdict, sent: Reading) -> Notice:
    sentences = [_gap(verdict, sent.cycles)]
    if verdict.against_time:
        sentences.append("By its started_at it is out of order with runs of other cycles.")
    if verdict.expected is not None and sent.log_cof is not None:
        (low, high), cof = verdict.expected, math.exp(sent.log_cof)
        if not low <= cof <= high:
            sentences.append(f"Its mean COF of {cof:.3g} is not that of those cycles, {low:.3g} to {high:.3g}.")
    guessed = verdict.slip.name != OTHER_CYCLES and verdict.latest is not None
    ask = f"Is it {_number(verdict.slip.likely.cycles)}? " if guessed else ""
    message = " ".join([*sentences, f"{ask}Confirm or correct it."])
    likely = verdict.slip.likely.cycles if guessed else None
    return Notice(code=AGAINST_TIME if verdict.against_time else OFF_PACE, message=message, likely_cycles=likely)


def _gap(verdict: Verdict, cycles: float) -> str:
    if verdict.latest is None:
        return f"{_number(cycles)} cycles are more than clutches last."
    if verdict.before is None or cycles <= verdict.latest + 0.5:
        return f"{_number(cycles)} cycles lie among those of other runs, the last of which was at {_number(verdict.latest)}."
    gap = f"{_number(cycles)} cycles are {_number(cycles - verdict.before)} after the run before"
    usual = verdict.usual_gap
    return f"{gap}." if usual is None else f"{gap}; earlier runs were about {_number(usual)} cycles apart."


def _of_unit(verdict: Verdict, shown: Shown) -> Notice:
    slip = verdict.slip
    if slip.name == "oil":
        oil = (shown.oil or 0.0) - ZERO_CELSIUS
        message = f"oil temperature is {oil:.4g} °C: was it sent in {slip.unit}?"
    else:
        channel, ours, scale = {
            "pressure": ("pressure", "bar", (shown.pressure or 0.0) / PASCALS_PER_BAR),
            "torque": ("torque", "Nm", None),
            "speed": ("speed", "rpm", (shown.speed or 0.0) / RADIANS_PER_SECOND_PER_RPM),
        }[slip.name]
        size = "" if scale is None else f" is up to {scale:.4g} {ours}"
        cof = f" a COF of {shown.cof:.3g}" if shown.cof is not None else ""
        gives = f"{channel}{size or ' gives'}{' and gives' if size else ''}{cof}"
        message = f"{gives}, {_expected(verdict)}: was it sent in {slip.unit}?"
    return Notice(code=UNIT, message=f"{message} Withdraw the run and send it in the channel's unit, or confirm it.")


def _expected_then(verdict: Verdict) -> bool:
    """Whether COF without the slip is one that is expected: else no unit of torque or pressure is asked for, though it
    explains a part."""
    likely = verdict.slip.likely
    if verdict.expected_then is None or likely.log_cof is None:
        return True
    return verdict.expected_then[0] <= math.exp(likely.log_cof) <= verdict.expected_then[1]


def _expected(verdict: Verdict) -> str:
    return (
        "" if verdict.expected is None else f"where {verdict.expected[0]:.3g} to {verdict.expected[1]:.3g} is expected"
    )


def _of_cof(verdict: Verdict, sent: Reading) -> Notice:
    cof = math.exp(sent.log_cof or -20.0)
    beyond = abs(math.log(cof / criteria.COF)) / criteria.LOG_COF_SD > 2.5
    cause = "Is a sensor or a unit wrong?" if beyond else "Is it another clutch's test?"
    expected = f"{_expected(verdict)} at {_number(sent.cycles)} cycles"
    message = f"mean COF is {cof:.3g}, {expected}. {cause} Withdraw the run, or confirm it."
    return Notice(code=BEYOND_PHYSICS if beyond else OFF_COURSE, message=message)


def _number(value: float) -> str:
    return f"{value:.0f}" if float(value).is_integer() else f"{value:g}"
