"""Each mechanism and each constant left out in turn, or changed where it cannot be left out: whether it earns its place."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np

from models.arrays import FloatArray
from models.plausibility import course, criteria, judgement, pace, slips
from service.clutch.plausibility import doubts, reading

Patches = tuple[tuple[object, str, Any], ...]
#: A probability of nothing.
_NEVER = 1e-30


def _slips_but(*names: str) -> Any:
    def some(*arguments: Any) -> Iterator[Any]:
        return (slip for slip in slips.slips_of(*arguments) if slip.name not in names)

    return some


def _anywhere(cycles: FloatArray, *_: Any) -> FloatArray:
    there = np.isfinite(cycles)
    return np.asarray(np.where(there, pace.log_anywhere(np.where(there, cycles, 1.0)), 0.0).sum(axis=1))


def _changed(**values: float) -> Patches:
    """Constants of the judgement with other values."""
    return tuple((criteria, name, value) for name, value in values.items())


def _course(**values: tuple[Any, ...]) -> Patches:
    """The course with other values to choose among."""
    of = {name: values.get(name, getattr(criteria, name)) for name in ("SCALES", "SIZES", "SCATTERS")}
    grid = np.array([(s, *size, r) for s in of["SCALES"] for size in of["SIZES"] for r in of["SCATTERS"]])
    return (*_changed(**of), (course, "_NODES", grid), (course, "_LOG_SCALES", np.log(np.array(of["SCALES"]))))


def _each_left_out() -> Iterator[tuple[str, Patches]]:
    for name, title in {"SCALES": "scale of the course", "SIZES": "sizes", "SCATTERS": "scatter"}.items():
        values = getattr(criteria, name)
        for k, value in enumerate(values):
            yield f"{title} {value}", _course(**{name: values[:k] + values[k + 1 :]})


#: What is replaced by what, by the mechanism that this leaves out or changes.
WITHOUT: dict[str, Patches] = {
    "the pace of cycles": ((pace, "log_probability", _anywhere),),
    "order in time": ((pace, "log_order", lambda start, _: np.zeros(start.shape[0])),),
    "physics of COF": ((judgement, "log_physics", lambda _: 0.0),),
    "pressure, speed, oil": ((reading._Comparison, "_log_protocol", lambda *_: 0.0),),
    "dead channels": ((doubts, "dead_channels", lambda *_: []),),
    "slip: digits": ((judgement, "slips_of", _slips_but(*slips.OF_CYCLES[:3])),),
    "slip: other cycles": ((judgement, "slips_of", _slips_but(slips.OTHER_CYCLES)),),
    "slip: units": ((judgement, "slips_of", _slips_but("pressure", "torque", "speed", "oil")),),
    "slip: another clutch, its cycles": ((judgement, "slips_of", _slips_but(slips.OTHER_CLUTCH)),),
    "slip: another clutch, cycles of here": ((judgement, "slips_of", _slips_but(slips.OTHER_TEST)),),
    "slip: dead pressure": ((judgement, "slips_of", _slips_but(reading.DEAD_PRESSURE)),),
    "outlying tests": _changed(OUTLYING_SHARE=_NEVER),
    "new levels": _changed(LEVEL_UNDECLARED=_NEVER, LEVEL_AFTER_EVENT=_NEVER),
    "new levels where nothing is declared": _changed(LEVEL_UNDECLARED=_NEVER),
    "events make new levels probable": _changed(LEVEL_AFTER_EVENT=criteria.LEVEL_UNDECLARED),
    "a small step at every event": _changed(STEP_SD=0.0),
    "a new level half as far": _changed(LEVEL_SD=0.5 * criteria.LEVEL_SD),
    "physics from the median on": _changed(USUAL=0.0),
    "the median COF twice": _changed(COF=2.0 * criteria.COF),
    **dict(_each_left_out()),
    "runs at the cycles of another kind's": _changed(JOINS=_NEVER),
    "blocks that begin where a run was made": _changed(TILES=_NEVER),
    "blocks that begin at the start": _changed(STARTS=_NEVER),
    "equal blocks": _changed(EQUALS=_NEVER),
    "equal gaps": _changed(SAME_GAP=_NEVER),
    "gaps that resemble one another": _changed(LIKE_GAP=_NEVER),
    "gaps of one order": _changed(SIMILAR_GAP=_NEVER),
    "gaps before the last": ((pace, "_RECENCY", 1e-12 ** np.arange(criteria.MEMORY)),),
    "gaps that grow": _changed(GROWING=0.0),
    "round numbers": _changed(ROUND=_NEVER),
    "a first run at the start": _changed(AT_START=_NEVER),
    "maintenance within the life": _changed(WITHIN=0.0, BEYOND=0.0),
    "a most that clutches last": _changed(MAX_CYCLES=1e30),
    "dynamic tests as exact as stationary ones": ((reading, "DYNAMIC_SD", 0.0),),
    "engagements twice as exact": ((reading, "ENGAGEMENT_SD", 0.5 * reading.ENGAGEMENT_SD),),
    "held from half the odds on": _changed(HELD=0.5 * criteria.HELD),
    "held from twice the odds on": _changed(HELD=2.0 * criteria.HELD),
}


@contextmanager
def without(mechanism: str) -> Iterator[None]:
    """Doubts that lack a mechanism."""
    with ExitStack() as stack:
        for owner, name, replacement in WITHOUT[mechanism]:
            stack.enter_context(patch.object(owner, name, replacement))
        yield
