"""Runs as files: one JSON file a run, holding what is posted, and `clutch.json` beside them for the clutch's record."""

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from models.arrays import FloatArray
from models.rig.campaign import DutyBlock, SimulatedRun
from models.runs import Plateaus
from service.formats.units import CHANNELS, PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM

CLUTCH_FILE = "clutch.json"
#: What claims more cycles than this is no run.
MOST_CYCLES = 1e15


def simulated_clutch_body(clutch_id: str) -> dict[str, Any]:
    """The record of a simulated clutch: the reference's geometry and oil, and that it is simulated."""
    return {"clutch_id": clutch_id, "origin": "simulated"}


def simulated_body(run: SimulatedRun) -> dict[str, Any]:
    """A simulated run as it is posted; it says that it is simulated."""
    body: dict[str, Any] = {
        "run_id": run.run_id,
        "kind": run.kind.value,
        "cycles": run.cycles,
        "origin": "simulated",
    }
    if run.plateaus is not None:
        body["channels"] = _channels(run.plateaus)
    if run.duty is not None:
        body["duty"] = _duty(run.duty)
    return body


def _channels(plateaus: Plateaus) -> dict[str, list[float]]:
    columns = {
        "pressure_bar": plateaus.pressure,
        "speed_rpm": plateaus.speed,
        "torque_nm": plateaus.torque,
        "torque_sd_nm": plateaus.torque_sd,
        "oil_temperature_c": plateaus.oil_temperature,
    }
    return {name: _from_si(name, column) for name, column in columns.items() if column is not None}


def _from_si(name: str, column: FloatArray) -> list[float]:
    """In the channel's unit, to nine digits: a rig's files are no wider."""
    channel = CHANNELS[name]
    return [float(f"{value:.9g}") for value in ((column - channel.offset) / channel.factor).tolist()]


def _duty(block: DutyBlock) -> dict[str, float]:
    return {
        "cycles": block.cycles,
        "energy_per_cycle_kj": block.energy_per_cycle / 1000,
        "initial_speed_rpm": round(block.initial_speed / RADIANS_PER_SECOND_PER_RPM, 6),
        "maximum_pressure_bar": block.maximum_pressure / PASCALS_PER_BAR,
    }


def write(path: Path, body: dict[str, Any]) -> None:
    """One body into one file, whole or not at all."""
    partial = path.with_suffix(path.suffix + ".part")
    partial.write_text(json.dumps(body, allow_nan=False, separators=(",", ":")) + "\n", encoding="utf-8")
    partial.replace(path)


def find(paths: Iterable[Path]) -> list[Path]:
    """The files named, and of folders the `.json` files in them, each folder's by cycles where the file tells them.

    Raises FileNotFoundError for a path that is not there.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = [each for each in path.glob("*.json") if each.name != CLUTCH_FILE]
            found += sorted(inside, key=lambda each: (_cycles(each), each.name))
        elif path.exists():
            found.append(path)
        else:
            raise FileNotFoundError(f"{path} is not there")
    return found


def _cycles(path: Path) -> float:
    """The cycles that a run file tells, for ordering alone; what is no run comes last and is refused by the service."""
    try:
        body = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return math.inf
    cycles = body.get("cycles") if isinstance(body, dict) else None
    return float(cycles) if isinstance(cycles, int | float) and abs(cycles) < MOST_CYCLES else math.inf
