"""Runs as the judgement sees them: numbers alone, as sent and as they would be without each slip."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """What a run shows, as sent or without a slip.

    `cycles` since new; `log_cof` the logarithm of mean COF as the stationary tests of its life show it and `spread` its own
    deviation, None for a run that shows none; `log_protocol` the log density of its pressures, speeds and oil.
    """

    cycles: float
    log_cof: float | None = None
    spread: float = 0.0
    log_protocol: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip:
    """A slip, the log of its prior odds, the unit that it is about, and the run without it."""

    name: str
    log_prior: float
    likely: Reading
    unit: str = ""


def none() -> tuple[Slip, ...]:
    """No slips."""
    return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A run: `sent` as it came in, and the `slips` of its channels that are possible, made when they are asked for.

    `tests` says whether its COF is evidence of the course (a stationary test); `block` [cycles] what a block of duty says it
    ran; `moment` [s] when it was started, None where it does not say; `shift` an event that may move the level of COF,
    `rebuild` one that begins a life; `fixed` a run that somebody confirmed: it is not held, and seldom slipped all the same.
    """

    name: str
    kind: str
    sent: Reading
    slips: Callable[[], Iterable[Slip]] = none
    tests: bool = False
    block: float | None = None
    moment: float | None = None
    shift: bool = False
    rebuild: bool = False
    fixed: bool = False
