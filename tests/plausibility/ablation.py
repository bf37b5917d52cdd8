"""Each mechanism left out in turn: whether it earns its place."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np

from models.arrays import FloatArray
from models.plausibility import criteria, judgement, pace, slips
from service.lives.plausibility import doubts, reading


def _slips_but(*names: str) -> Any:
    def some(*arguments: Any) -> Iterator[Any]:
        return (slip for slip in slips.slips_of(*arguments) if slip.name not in names)

    return some


def _anywhere(cycles: FloatArray, *_: Any) -> FloatArray:
    there = np.isfinite(cycles)
    return np.where(there, pace.log_anywhere(np.where(there, cycles, 1.0)), 0.0).sum(axis=1)


#: What is replaced by what, by the mechanism that this leaves out or changes.
WITHOUT: dict[str, tuple[tuple[object, str, Any], ...]] = {
    "the pace of cycles": ((pace, "log_probability", _anywhere),),
    "order in time": ((pace, "log_order", lambda start, _: np.zeros(start.shape[0])),),
    "physics of COF": ((judgement, "log_physics", lambda _: 0.0),),
    "pressure, speed, oil": ((reading._Comparison, "_log_protocol", lambda *_: 0.0),),
    "slip: digits": ((judgement, "slips_of", _slips_but(*slips.OF_CYCLES[:3])),),
    "slip: other cycles": ((judgement, "slips_of", _slips_but(slips.OTHER_CYCLES)),),
    "slip: units": ((judgement, "slips_of", _slips_but("pressure", "torque", "speed", "oil")),),
    "slip: another clutch": ((judgement, "slips_of", _slips_but(*slips.OF_CLUTCH)),),
    "slip: dead pressure": ((judgement, "slips_of", _slips_but(reading.DEAD_PRESSURE)),),
    "new levels": ((criteria, "LEVEL_UNDECLARED", 1e-30), (criteria, "LEVEL_AFTER_EVENT", 1e-30)),
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
