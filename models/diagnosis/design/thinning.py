"""A campaign made small enough to be fitted at once: states left out evenly, the first and the last kept."""

from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign
from models.diagnosis.design.loop_bins import BINS

#: A run keeps at most this many plateaus (evenly taken), a campaign about this many rows (states evenly taken).
MOST_PLATEAUS, MOST_ROWS = 2000, 40_000
#: Loops of so many states (evenly taken, the first and the last among them) say what more would say.
MOST_LOOP_STATES = 12


def thinned(campaign: Campaign, notes: list[str]) -> Campaign:
    """The campaign with states left out evenly where it is too large; what was left out is noted."""
    campaign = _with_fewer_loops(campaign, notes)
    states = np.unique([*(run.cycles for run in campaign.stationary), *(run.cycles for run in campaign.dynamic)])
    size = sum(min(run.plateaus.torque.size, MOST_PLATEAUS) for run in campaign.stationary)
    size += sum(8 * BINS for _ in campaign.dynamic)
    if size <= MOST_ROWS or states.size < 3:
        return campaign
    keep = _evenly(states, max(2, int(states.size * MOST_ROWS / size)))
    notes.append(
        f"{states.size - len(keep)} of {states.size} states were left out, evenly: the campaign is very large."
    )
    return Campaign(
        geometry=campaign.geometry,
        oil=campaign.oil,
        cof_fraction=campaign.cof_fraction,
        stationary=tuple(run for run in campaign.stationary if run.cycles in keep),
        dynamic=tuple(run for run in campaign.dynamic if run.cycles in keep),
        duty=campaign.duty,
        maintenance=campaign.maintenance,
    )


def _with_fewer_loops(campaign: Campaign, notes: list[str]) -> Campaign:
    states = np.unique([run.cycles for run in campaign.dynamic])
    if states.size <= MOST_LOOP_STATES:
        return campaign
    keep = _evenly(states, MOST_LOOP_STATES)
    notes.append(f"Dynamic tests of {len(keep)} of {states.size} states were taken, evenly: there are very many.")
    return replace(campaign, dynamic=tuple(run for run in campaign.dynamic if run.cycles in keep))


def _evenly(states: FloatArray, count: int) -> set[float]:
    return set(states[np.linspace(0, states.size - 1, count).round().astype(int)].tolist())
