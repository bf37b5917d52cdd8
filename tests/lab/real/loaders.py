"""The measured files -> clutch records and run bodies. The files stay where they are; nothing of them is in the project.

A rig that is no clutch is posted as the clutch that has its arithmetic: a mean radius, a lining area and a number of
faces with which torque over faces · pressure · area · radius is the coefficient of friction that was measured.
"""

import csv
import itertools
import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from models.arrays import FloatArray

FOLDER = Path(__file__).parents[4] / "shared" / "data"
SCREW_DRIVES = FOLDER / "screw_drive_friction" / "steady_state_summary.csv"
TRACTION_SWEEPS = FOLDER / "traction_sweeps" / "traction_sweeps_001_200.csv"

_RPM = 2 * math.pi / 60

#: A 10 mm mean radius and one face; the ring's area turns 1,650 N into 47.8 bar.
TRACTION_CLUTCH = {
    "clutch_id": "traction",
    "geometry": {"inner_diameter_mm": 1, "outer_diameter_mm": 21, "friction_faces": 1, "mean_radius_mm": 10},
    "fluid": "not named by its owner",
}
_AREA = math.pi / 4 * (0.021**2 - 0.001**2)
_RADIUS = 0.010


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def columns(*path: str) -> dict[str, FloatArray]:
    """The columns of numbers of a table."""
    rows = _rows(FOLDER.joinpath(*path))
    return {name: np.array([float(row[name]) for row in rows if row[name]]) for name in rows[0] if name != "step_type"}


def lasers() -> dict[int, tuple[FloatArray, FloatArray]]:
    """Of each laser the hours, and how far its current has risen, as a share."""
    data = columns("laser_degradation", "gaaslaser.csv")
    of_each = {int(unit): data["unit"] == unit for unit in np.unique(data["unit"])}
    return {unit: (data["hours"][here], data["increase"][here] / 100.0) for unit, here in of_each.items()}


def cells() -> dict[tuple[str, str], list[dict[str, str]]]:
    """The rows of each battery, by its kind and number."""
    found = defaultdict(list)
    for row in _rows(FOLDER / "battery_lives" / "battery_lives.csv"):
        found[row["group"], row["life"]].append(row)
    return found


def screw_drive_runs() -> dict[str, dict[str, Any]]:
    """Clutch name -> the stationary run of one drive in one direction, mirrored to positive speed; 1 bar in name only.

    The torque's deviation is that of the mean over the setpoint's samples, taken as independent.
    """
    found: dict[str, dict[str, Any]] = {}
    grouped = defaultdict(list)
    for row in _rows(SCREW_DRIVES):
        grouped[row["drive"], "forward" if float(row["speed_rpm"]) > 0 else "backward"].append(row)
    for (drive, direction), rows in grouped.items():
        mirror = 1 if direction == "forward" else -1
        found[f"{drive}-{direction}"] = {
            "run_id": f"{drive}-{direction}",
            "kind": "stationary_stribeck",
            "cycles": 0,
            "channels": {
                "pressure_bar": [1.0] * len(rows),
                "speed_rpm": [mirror * float(row["speed_rpm"]) for row in rows],
                "torque_nm": [mirror * float(row["torque_mNm"]) / 1000 for row in rows],
                "torque_sd_nm": [
                    abs(float(row["torque_mNm"]) / float(row["torque_pct"])) * float(row["torque_sd"]) / 1000
                    / math.sqrt(float(row["n"]))
                    for row in rows
                ],
            },
        }  # fmt: skip
    return found


def traction_runs() -> list[dict[str, Any]]:
    """Each sweep, down and up, as one stationary run; the sweep's number counts as cycles."""
    found = []
    for sweep, group in itertools.groupby(_rows(TRACTION_SWEEPS), key=lambda row: int(row["sweep"])):
        rows = list(group)
        load = [float(row["ball_load_n"]) for row in rows]
        found.append(
            {
                "run_id": f"sweep-{sweep:03d}",
                "kind": "stationary_stribeck",
                "cycles": sweep,
                "channels": {
                    "pressure_bar": [force / _AREA / 1e5 for force in load],
                    "speed_rpm": [abs(float(row["sliding_speed_mm_s"])) / 1000 / _RADIUS / _RPM for row in rows],
                    "torque_nm": [
                        float(row["traction_coefficient"]) * force * _RADIUS
                        for row, force in zip(rows, load, strict=True)
                    ],
                    "oil_temperature_c": [float(row["lube_temperature_c"]) for row in rows],
                },
            }
        )
    return found
