"""Each mechanism left out in turn: whether it earns its place."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np

from models.arrays import FloatArray
from service.lives.plausibility import course, criteria, doubts, pace, slips
from service.lives.plausibility.course import Predicted
from service.lives.plausibility.likelihood import History
from service.lives.plausibility.pace import Pace


def _nothing(*_: object) -> Iterator[Any]:
    return iter(())


def _zero(*_: object) -> float:
    return 0.0


def _anywhere(_: Pace, cycles: float) -> float:
    return pace.log_anywhere(cycles)


def _level_alone(own: course.Course, cycles: FloatArray) -> FloatArray:
    return np.full((1, cycles.size), own.level)


def _of_any(history: History, reading: Any) -> float:
    return slips.log_cof_of_any(reading, history) or 0.0


def _unlimited(log_weight: FloatArray, mean: FloatArray, variance: FloatArray) -> Predicted:
    return Predicted(log_weight=log_weight, mean=mean, variance=variance)


#: What is replaced by what, by the mechanism that this leaves out or changes.
WITHOUT: dict[str, tuple[tuple[object, str, Any], ...]] = {
    "the pace of cycles": ((Pace, "log_probability", _anywhere),),
    "equal blocks": ((Pace, "_blocks", _zero),),
    "order in time": ((History, "of_time", _zero),),
    "physics of COF": ((course, "_possible", _unlimited),),
    "the course of COF": ((History, "of_cof", _of_any),),
    "the life before": ((course.Course, "_means", _level_alone),),
    "pressure, speed, oil": ((History, "of_protocol", _zero),),
    "slip: digits": ((slips, "digit_slips", _nothing),),
    "slip: other cycles": ((slips, "other_cycles", _nothing),),
    "slip: units": ((slips, "other_units", _nothing),),
    "slip: another clutch": ((slips, "other_clutches", _nothing),),
    "slip: dead pressure": ((slips, "dead_pressure", _nothing),),
    "held from half the odds on": ((criteria, "HELD", 0.5 * criteria.HELD),),
    "held from twice the odds on": ((criteria, "HELD", 2.0 * criteria.HELD),),
    "dead channels": ((doubts, "dead_channels", lambda *_: []),),
}


@contextmanager
def without(mechanism: str) -> Iterator[None]:
    """Doubts that lack a mechanism."""
    with ExitStack() as stack:
        for owner, name, replacement in WITHOUT[mechanism]:
            stack.enter_context(patch.object(owner, name, replacement))
        yield
