"""`make law_adoption`: what the diagnosis of measured curves offers is adopted, and remaining life held against the truth
(SEED= SIZE= ONLY= STORE= ARGS=--write). The end is where true mean COF is half of the first."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from models.prognosis.scoring import covered
from tests.lab.adoption.trials import asked
from tests.lab.law.kinds import tabulate
from tests.lab.law.worlds import sent_of_curves
from tests.service.clients import client_on

#: Kinds of campaigns with how many there are in the whole table.
KINDS = {f"{law}{hidden}": 15 for law in ("", "mild-", "control-") for hidden in ("none", "zero", "oil", "offset_late")}
TITLES = ("friction law", "hidden", "campaigns", "offered", "of the law alone", "end held before", "end held after")
LAWS = {"mild": "eq. 3 and a share of a measured misfit", "control": "eq. 3"}


@dataclass(frozen=True)
class Adopted:
    """What came of a campaign: whether something was offered, whether that was the law alone, and whether the 90 % interval
    of the end held it before and after."""

    kind: str
    seed: int
    offered: bool
    law_alone: bool
    held_before: bool
    held_after: bool


def adopted(job: tuple[str, int]) -> Adopted:
    """The campaign of a kind and a seed, posted, diagnosed, adopted."""
    kind, seed = job
    clutch, runs, end = sent_of_curves(kind, seed)
    with (
        tempfile.TemporaryDirectory() as folder,
        client_on(f"sqlite:///{Path(folder) / 'a.db'}", max_body_mb=64) as http,
    ):
        asked(http, "POST", "/v1/clutches", json=clutch)
        http.base_url = http.base_url.join(f"/v1/clutches/{clutch['clutch_id']}/")
        for run in runs:
            asked(http, "POST", "runs", json=run)
        report = asked(http, "POST", "diagnoses", json={"adopt": False}, headers={"Prefer": "wait=600"})
        if report["status"] != "finished":
            raise RuntimeError(f"a diagnosis ended without a report: {report['problem']}")
        before = after = asked(http, "GET", "remaining-useful-life")
        effects: list[str] = []
        if report["adoptable"]:
            made = asked(http, "PUT", "model", json={"diagnosis_id": report["diagnosis_id"]})
            after, effects = asked(http, "GET", "remaining-useful-life"), made["model"]["effects"]
    return Adopted(
        kind=kind,
        seed=seed,
        offered=bool(report["adoptable"]),
        law_alone=effects == ["friction_law"],
        held_before=_held(before["end_of_life_cycles"], end),
        held_after=_held(after["end_of_life_cycles"], end),
    )


def _held(quantiles: Mapping[str, float | None], end: float) -> bool:
    return bool(covered(quantiles["0.05"], quantiles["0.95"], end))


def row(kind: str, found: Sequence[Adopted]) -> tuple[str, ...]:
    """A row of the table: of a kind's campaigns those in which something was offered."""
    law, _, hidden = kind.rpartition("-")
    offered = [one for one in found if one.offered]
    return (
        LAWS.get(law, "measured"),
        {"none": "nothing"}.get(hidden, hidden.replace("_", " ")),
        f"{len(found)}",
        f"{len(offered)}",
        f"{sum(one.law_alone for one in offered)}",
        f"{sum(one.held_before for one in offered)}",
        f"{sum(one.held_after for one in offered)}",
    )


if __name__ == "__main__":
    tabulate("law_adoption", KINDS, adopted, Adopted, TITLES, row)
