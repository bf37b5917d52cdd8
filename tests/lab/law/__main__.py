"""`make law`: the table of docs/appendix/diagnosis.md on other friction laws than eq. 3 (SEED= SIZE= ONLY= STORE=
ARGS=--write).

SIZE=full: 60 campaigns of measured curves with nothing hidden, 40 of each other kind, 15 of each formula.
"""

from collections.abc import Sequence

import numpy as np

from tests.lab.law.kinds import tabulate
from tests.lab.law.trials import Said, diagnosed
from tests.lab.law.worlds import FORMULAS

#: Kinds of campaigns with how many there are in the whole table.
KINDS = (
    {"none": 60, "zero": 40, "oil": 40, "offset_late": 40}
    | {"mild-none": 40, "mild-zero": 40, "mild-oil": 40, "mild-offset_late": 40}
    | dict.fromkeys(FORMULAS, 15)
)
TITLES = (
    "friction law", "hidden", "campaigns", "adequate", "false cause", "named wrongly", "in the set", "named alone",
    "said to be like the law", "sign right", "law differs by, % (median)", "seconds (median, largest)",
)  # fmt: skip


def row(kind: str, found: Sequence[Said]) -> tuple[str, ...]:
    """A row of the table: counts of a kind's campaigns."""
    law = kind if kind in FORMULAS else "eq. 3 and a share of a measured misfit" if "mild" in kind else "measured"
    hidden = found[0].cause
    signs = [said.size_right for said in found if said.in_set and said.size_right is not None]
    seconds = [said.seconds for said in found]
    return (
        law,
        hidden or "nothing",
        f"{len(found)}",
        f"{sum(said.adequate for said in found)}",
        f"{sum(said.falsely_sure for said in found)}",
        f"{sum(said.named_wrongly for said in found)}",
        f"{sum(said.in_set for said in found)}" if hidden else "",
        f"{sum(said.causes == [hidden] for said in found)}" if hidden else "",
        f"{sum(hidden in said.like_the_law for said in found)}" if hidden else "",
        f"{sum(signs)} of {len(signs)}" if hidden else "",
        f"{np.median([said.law_percent for said in found]):.2g}",
        f"{np.median(seconds):.1f}, {max(seconds):.0f}",
    )


if __name__ == "__main__":
    tabulate("law", KINDS, diagnosed, Said, TITLES, row)
