"""What the diagnosis says of real measurements: the traction sweeps as a campaign, each sweep a stationary run.

Nothing in them is a clutch, and what they do is known: traction rises at the lowest speeds where the baseline's curve
falls, and differs between the sweep down and the sweep up. No effect of the catalogue is that. Right answers are
`unexplained_structure`, with the speed first, or an ambiguous set; a named cause would be wrong.
"""

import numpy as np

from models.diagnosis.campaign import Campaign, StationaryRun
from models.diagnosis.diagnose import diagnose
from models.diagnosis.report.report import Report
from models.records.runs import Plateaus
from service.api.clutch import GeometryIn
from tests.lab.blind.rig.sent import in_si
from tests.lab.measuring import show
from tests.lab.real.loaders import TRACTION_CLUTCH, traction_runs

#: How many of the sweeps, evenly taken, are a campaign.
CAMPAIGNS = (20, 60, 200)


def traction_campaign(count: int) -> Campaign:
    """`count` of the sweeps, evenly taken."""
    runs = traction_runs()
    chosen = [runs[i] for i in np.linspace(0, len(runs) - 1, count).round().astype(int)]
    return Campaign(
        geometry=GeometryIn.model_validate(TRACTION_CLUTCH["geometry"]).to_model(),
        stationary=tuple(
            StationaryRun(
                run_id=run["run_id"], cycles=float(run["cycles"]), plateaus=Plateaus(**in_si(run["channels"]))
            )
            for run in chosen
        ),
    )


def report_of(count: int) -> Report:
    return diagnose(traction_campaign(count), rng=np.random.default_rng(2013))


def main() -> None:
    """Verdict, axes and candidates by campaign, as Markdown, and the paragraph on the largest."""
    rows = []
    for count in CAMPAIGNS:
        report = report_of(count)
        where = report.baseline.where if report.baseline is not None else ()
        rows.append(
            {
                "sweeps": count,
                "verdict": report.verdict.value,
                "causes": ", ".join(report.causes) or "none",
                "axes, strongest first [nats]": ", ".join(f"{each.axis} {each.strength:.0f}" for each in where[:3]),
                "what fitted best, not named": ", ".join(each.effect for each in report.candidates[:2]),
            }
        )
    show("### Traction sweeps as a campaign: the diagnosis", rows)
    print(f"> {report.summary}\n")


if __name__ == "__main__":
    main()
