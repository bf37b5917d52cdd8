"""What the diagnosis says of real measurements: the traction sweeps as a campaign, each sweep a stationary run.

Nothing in them is a clutch, and what they do is known: traction rises at the lowest speeds where the baseline's curve
falls, and differs between the sweep down and the sweep up. No effect of the catalogue is that. Right answers are
`unexplained_structure`, with the speed first, or an ambiguous set; a named cause would be wrong.
"""

from collections.abc import Sequence

import numpy as np

from models.clutch import Geometry
from models.diagnosis.campaign import Campaign, StationaryRun
from models.diagnosis.diagnose import diagnose
from models.diagnosis.report.report import Report
from models.friction.speed_protocol import RPM
from models.records.runs import Plateaus
from tests.real.lag import table
from tests.real.loaders import TRACTION_CLUTCH, traction_runs

#: How many of the sweeps, evenly taken, are a campaign.
CAMPAIGNS = (20, 60, 200)
KELVIN = 273.15


def traction_campaign(count: int) -> Campaign:
    """`count` of the sweeps, evenly taken."""
    geometry: dict[str, float] = TRACTION_CLUTCH["geometry"]
    runs = traction_runs()
    chosen = [runs[i] for i in np.linspace(0, len(runs) - 1, count).round().astype(int)]
    return Campaign(
        geometry=Geometry(
            inner_diameter=geometry["inner_diameter_mm"] / 1e3,
            outer_diameter=geometry["outer_diameter_mm"] / 1e3,
            friction_faces=int(geometry["friction_faces"]),
            mean_radius_override=geometry["mean_radius_mm"] / 1e3,
        ),
        stationary=tuple(_run(run["run_id"], run["cycles"], run["channels"]) for run in chosen),
    )


def _run(run_id: str, cycles: float, channels: dict[str, Sequence[float]]) -> StationaryRun:
    columns = {name: np.array(values, dtype=np.float64) for name, values in channels.items()}
    return StationaryRun(
        run_id=run_id,
        cycles=float(cycles),
        plateaus=Plateaus(
            pressure=columns["pressure_bar"] * 1e5,
            speed=columns["speed_rpm"] * RPM,
            torque=columns["torque_nm"],
            oil_temperature=columns["oil_temperature_c"] + KELVIN,
        ),
    )


def report_of(count: int) -> Report:
    return diagnose(traction_campaign(count), rng=np.random.default_rng(2013))


def main() -> None:
    """Verdict, axes and candidates by campaign, as Markdown, and the paragraph on the largest."""
    rows, last = [], ""
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
        last = report.summary
    print(f"### Traction sweeps as a campaign: the diagnosis\n\n{table(rows)}\n\n> {last}\n")


if __name__ == "__main__":
    main()
