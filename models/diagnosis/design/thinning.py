"""A campaign made small enough to be fitted at once: states are left out evenly, the first and the last are kept."""

from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign
from models.diagnosis.design.limits import MOST_LOOP_STATES, MOST_PLATEAUS, MOST_ROWS
from models.diagnosis.design.loop_bins import BINS

#: Pressures that a dynamic test is taken to have when its rows are counted beforehand.
_LOOPS_PER_TEST = 8


def thinned(campaign: Campaign, notes: list[str]) -> Campaign:
    """The campaign with states left out evenly where it is too large; `notes` gets a sentence on what was left out."""
    campaign = _with_fewer_loops(campaign, notes)
    states = np.unique([*(run.cycles for run in campaign.stationary), *(run.cycles for run in campaign.dynamic)])
    size = sum(min(run.plateaus.torque.size, MOST_PLATEAUS) for run in campaign.stationary)
    size += sum(_LOOPS_PER_TEST * BINS for _ in campaign.dynamic)
    if size <= MOST_ROWS or states.size < 3:
        return campaign
    kept = _evenly(states, max(2, int(states.size * MOST_ROWS / size)))
    notes.append(
        f"{states.size - len(kept)} of {states.size} states were left out, evenly: the campaign is very large."
    )
    return replace(
        campaign,
        stationary=tuple(run for run in campaign.stationary if run.cycles in kept),
        dynamic=tuple(run for run in campaign.dynamic if run.cycles in kept),
    )


def _with_fewer_loops(campaign: Campaign, notes: list[str]) -> Campaign:
    states = np.unique([run.cycles for run in campaign.dynamic])
    if states.size <= MOST_LOOP_STATES:
        return campaign
    kept = _evenly(states, MOST_LOOP_STATES)
    notes.append(f"Dynamic tests of {len(kept)} of {states.size} states were taken, evenly: there are very many.")
    return replace(campaign, dynamic=tuple(run for run in campaign.dynamic if run.cycles in kept))


def _evenly(states: FloatArray, count: int) -> set[float]:
    return set(states[np.linspace(0, states.size - 1, count).round().astype(int)].tolist())
