"""Campaigns as `clutchlife simulate` writes them, with or without --hide, as the diagnosis takes them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun, StationaryRun
from models.rig import campaign as rig
from models.rig.hidden import clutch_for, hidden_in
from models.rig.programme import Programme
from models.rig.sampled import DynamicTest
from models.rig.stationary import SHARP


def rehearsal(
    seed: int,
    hidden: Mapping[str, float] | None = None,
    *,
    dynamic: bool = True,
    tests: int = 40,
    noise: float | None = None,
) -> Campaign:
    """A simulated campaign; without `hidden` (sizes by slug) the one of `clutchlife simulate --seed SEED`."""
    sizes = hidden or {}
    clutch = clutch_for(rig.simulated_clutch(seed), sizes)
    runs = rig.simulate(
        seed,
        clutch=clutch,
        sensor=SHARP if noise is None else replace(SHARP, noise=noise),
        programme=Programme(dynamic=DynamicTest() if dynamic else None, engagements=True),
        most_tests=tests,
    )
    stationary, moving, duty = [], [], []
    for run in (hidden_in(run, clutch, sizes) for run in runs):
        head: dict[str, Any] = {"run_id": run.run_id, "cycles": float(run.cycles)}
        if run.plateaus is not None:
            stationary.append(StationaryRun(**head, plateaus=run.plateaus))
        elif run.duty is not None:
            block = run.duty
            engaged = {"energy": block.energy_per_cycle, "initial_speed": block.initial_speed}
            duty.append(DutyRun(**head, engagements=block.cycles, maximum_pressure=block.maximum_pressure, **engaged))
        elif run.record is not None:
            moving.append(DynamicRun(**head, record=run.record))
    return Campaign(stationary=tuple(stationary), dynamic=tuple(moving), duty=tuple(duty))
