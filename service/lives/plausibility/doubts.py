"""Doubts about a run: what a person should look at before it counts."""

from service.columns import bar
from service.lives.history import Event
from service.lives.incoming_run import IncomingRun
from service.lives.recomputation import ClutchState
from service.lives.run_analysis import Analysis, Notice


def doubts(run: IncomingRun, analysis: Analysis, event: Event, before: ClutchState) -> tuple[Notice, ...]:  # noqa: ARG001
    """What is odd about a run; nothing where it is plausible.

    `event` is the run as the history would see it, with its mean COFs, `before` the clutch's state without it.
    """
    return tuple(
        Notice(
            code="cof_implausible",
            message=f"at {bar(pressure):g} bar: a mean COF of {cof:.4g}, where 0 to 1 would be expected: "
            "is the torque in Nm and the pressure in bar? Confirm or withdraw it.",
        )
        for pressure, (cof, _) in event.cofs.items()
        if not 0.0 < cof < 1.0
    )
