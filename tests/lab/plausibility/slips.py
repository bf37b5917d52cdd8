"""One slip each: an honest run -> the same run as a mistyped number, a wrong unit, a wrong file or a loose cable make it."""

from collections.abc import Callable

import numpy as np

from tests.lab.plausibility.bench import Body, with_gain, with_values
from tests.lab.plausibility.simulated import Campaign

#: A run with its slip, None where this slip changes nothing of this run.
Slip = Callable[[np.random.Generator, Body], Body | None]


def zero_too_many(_: np.random.Generator, run: Body) -> Body | None:
    return run | {"cycles": run["cycles"] * 10} if run["cycles"] else None


def zero_lost(_: np.random.Generator, run: Body) -> Body | None:
    return run | {"cycles": run["cycles"] // 10} if run["cycles"] and run["cycles"] % 10 == 0 else None


def swapped_digits(rng: np.random.Generator, run: Body) -> Body | None:
    digits = str(int(run["cycles"]))
    pairs = [k for k in range(len(digits) - 1) if digits[k] != digits[k + 1]]
    if not pairs:
        return None
    k = int(rng.choice(pairs))
    return run | {"cycles": int(digits[:k] + digits[k + 1] + digits[k] + digits[k + 2 :])}


def wrong_digit(rng: np.random.Generator, run: Body) -> Body | None:
    """The first digit, or the second, is another one."""
    digits = str(int(run["cycles"]))
    if len(digits) < 3:
        return None
    k = int(rng.integers(2))
    other = str(rng.choice([digit for digit in "123456789" if digit != digits[k]]))
    return run | {"cycles": int(digits[:k] + other + digits[k + 1 :])}


def wrong_gain(rng: np.random.Generator, run: Body) -> Body | None:
    """An amplifier's range is off by a factor of three to fifty, up or down."""
    factor = float(np.exp(rng.choice([-1.0, 1.0]) * rng.uniform(np.log(3), np.log(50))))
    return _scaled("torque_nm", factor)(rng, run)


def _changed(channel: str, reading: Callable[[np.random.Generator, np.ndarray], np.ndarray]) -> Slip:
    def slip(rng: np.random.Generator, run: Body) -> Body | None:
        if channel not in run.get("channels", {}):
            return None
        values = reading(rng, np.array(run["channels"][channel]))
        if "time_s" not in run["channels"] and channel in ("pressure_bar", "speed_rpm"):
            values = np.abs(values)
        return with_values(run, channel, values)

    return slip


def _scaled(channel: str, factor: float, offset: float = 0.0) -> Slip:
    return _changed(channel, lambda _, values: values * factor + offset)


def _about(level: float, noise: float) -> Callable[[np.random.Generator, np.ndarray], np.ndarray]:
    return lambda rng, values: level + noise * rng.standard_normal(values.size)


def _frozen(_: np.random.Generator, values: np.ndarray) -> np.ndarray:
    return np.full(values.size, values[values.size // 2])


#: Wrong units: the values as that unit has them, under the name of ours.
UNITS: dict[str, Slip] = {
    "pressure in kPa": _scaled("pressure_bar", 100.0),
    "pressure in psi": _scaled("pressure_bar", 14.503774),
    "pressure in MPa": _scaled("pressure_bar", 0.1),
    "torque in lbf ft": _scaled("torque_nm", 0.737562),
    "torque in kNm": _scaled("torque_nm", 1e-3),
    "torque in kgf m": _scaled("torque_nm", 0.101972),
    "speed in rad/s": _scaled("speed_rpm", 2 * np.pi / 60),
    "speed in 1/s": _scaled("speed_rpm", 1 / 60),
    "temperature in K": _scaled("oil_temperature_c", 1.0, 273.15),
    "temperature in °F": _scaled("oil_temperature_c", 1.8, 32.0),
}
UNPLUGGED: dict[str, Slip] = {
    "torque zero": _changed("torque_nm", lambda _, values: 0.0 * values),
    "torque about zero": _changed("torque_nm", _about(0.02, 0.05)),
    "torque railed": _changed("torque_nm", _about(200.0, 0.02)),
    "torque frozen": _changed("torque_nm", _frozen),
    "pressure about zero": _changed("pressure_bar", _about(0.0, 0.004)),
    "pressure railed": _changed("pressure_bar", _about(10.0, 0.002)),
    "pressure frozen": _changed("pressure_bar", _frozen),
    "speed about zero": _changed("speed_rpm", _about(0.0, 0.3)),
    "speed frozen": _changed("speed_rpm", _frozen),
    "temperature zero": _changed("oil_temperature_c", lambda _, values: 0.0 * values),
    "temperature at -273": _changed("oil_temperature_c", lambda _, values: 0.0 * values - 273.0),
    "temperature railed": _changed("oil_temperature_c", _about(850.0, 0.1)),
}
CYCLES: dict[str, Slip] = {"cycles x 10": zero_too_many, "swapped digits": swapped_digits}
#: Slips that nobody demanded.
OTHERS: dict[str, Slip] = {"cycles / 10": zero_lost, "a wrong digit": wrong_digit, "torque at a wrong gain": wrong_gain}

#: Sizes of other discs, as their factor of torque at the same COF and pressure (area times radius).
SIZES = (0.35, 0.5, 0.65, 1.5, 2.0, 3.0)


def other_size(rng: np.random.Generator, run: Body, made: Campaign, other: Campaign) -> Body | None:
    """The test that another, larger or smaller clutch had at about these cycles."""
    tests = _like(other, run)
    if not tests:
        return None
    theirs = min(tests, key=lambda test: abs(test["cycles"] - run["cycles"]))
    return _noticeable(rng, run, with_gain(theirs, float(rng.choice(SIZES))), made)


def other_age(rng: np.random.Generator, run: Body, made: Campaign, other: Campaign) -> Body | None:
    """The test of another clutch of the kind at another age."""
    tests = [theirs for theirs in _like(other, run) if differs(theirs, run)]
    return _noticeable(rng, run, tests[int(rng.integers(len(tests)))], made) if tests else None


def same_age(_: np.random.Generator, run: Body, __: Campaign, other: Campaign) -> Body | None:
    """The test of another clutch of the kind at the same age, which cannot be told from this one's."""
    tests = _like(other, run)
    if not tests:
        return None
    theirs = min(tests, key=lambda test: abs(np.log(level(test) / level(run))))
    return _under(run, theirs, cycles=run["cycles"])


def _like(other: Campaign, run: Body) -> list[Body]:
    """The other clutch's tests of the run's kind; none where the run is no test."""
    is_test = "channels" in run and "duty" not in run
    return [theirs for theirs in other.runs if theirs["kind"] == run["kind"]] if is_test else []


def _noticeable(rng: np.random.Generator, run: Body, theirs: Body, made: Campaign) -> Body | None:
    """Sent with the cycles of `run` or with its own; None where this clutch's own test at those cycles looks alike."""
    cycles = run["cycles"] if rng.random() < 0.5 else theirs["cycles"]
    own = min(_like(made, run), key=lambda test: abs(test["cycles"] - cycles))
    return _under(run, theirs, cycles=cycles) if differs(theirs, own) else None


def differs(theirs: Body, run: Body) -> bool:
    """Whether friction differs by more than a fifth: less is what an honest gain may be misread by."""
    return bool(abs(np.log(level(theirs) / level(run))) > np.log(1.2))


def level(run: Body) -> float:
    """The median of torque over pressure of a test."""
    channels = run["channels"]
    pressure = np.array(channels["pressure_bar"])
    return float(np.median(np.array(channels["torque_nm"]) / np.maximum(pressure, 0.1)))


def _under(run: Body, theirs: Body, *, cycles: float) -> Body:
    return (
        {name: run[name] for name in ("run_id", "kind") if name in run}
        | {name: theirs[name] for name in ("channels", "origin") if name in theirs}
        | {"cycles": cycles}
        | {name: theirs[name] for name in ("started_at",) if name in theirs and "started_at" in run}
    )


Swap = Callable[[np.random.Generator, Body, Campaign, Campaign], Body | None]
CLUTCHES: dict[str, Swap] = {"other clutch, another size": other_size, "other clutch, another age": other_age}
ALIKE: dict[str, Swap] = {"other clutch, same kind and age": same_age}
GROUPS = ("cycles x 10", "swapped digits", "wrong unit", "wrong clutch", "sensor unplugged")
