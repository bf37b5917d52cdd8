"""The diagnosis of a campaign: baseline, alarm, candidates, set, closure, gain, advice."""

import numpy as np

from models.diagnosis.campaign import Campaign
from models.diagnosis.report import Report


def diagnose(campaign: Campaign, *, rng: np.random.Generator, without: frozenset[str] = frozenset()) -> Report:
    """What the baseline gets wrong in this campaign, why, and what an extension gains. The same rng, the same answer.

    Effects whose slugs stand in `without` are taken out of the catalogue.
    """
    raise NotImplementedError
