"""Simulated runs as they are posted: in the channels' public units, and labelled as simulated."""

from typing import Any

from models.arrays import FloatArray
from models.rig.campaign import DutyBlock, SimulatedRun
from models.runs import Plateaus
from service.formats.units import CHANNELS, PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM


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
