"""Simulated runs -> what is posted: channels in their public units, labelled as simulated; and a diagnosis' plan as a file,
CSV or JSON as the service answers it -> the tests that the simulated rig is to make."""

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from models.arrays import FloatArray
from models.records.runs import Plateaus, Record
from models.rig.programme import PlannedTest
from models.rig.simulated_runs import DutyBlock, SimulatedRun
from models.rig.stationary import OIL_TEMPERATURE
from models.rig.truth import Surface
from service.api.base import rule_in_words
from service.api.diagnosis import PlanStep
from service.channels import CHANNELS, PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS

#: Significant digits of a value. Chosen: more than a rig's recorder writes.
_DIGITS = 9
_MICROMETRES_PER_METRE = 1e6
_POWERS = np.array([float(f"1e{exponent}") for exponent in range(23)])


def simulated_clutch_body(clutch_id: str) -> dict[str, object]:
    """The record of a simulated clutch: the reference's geometry and oil, origin simulated."""
    return {"clutch_id": clutch_id, "origin": "simulated"}


def simulated_head(run: SimulatedRun) -> dict[str, object]:
    """The fields of a simulated run beside its channels: name, kind, cycles, origin."""
    return {"run_id": run.run_id, "kind": run.kind.value, "cycles": run.cycles, "origin": "simulated"}


def simulated_channels(run: SimulatedRun) -> dict[str, FloatArray]:
    """The channels [n] of a simulated run by public name, in their units, to nine digits; empty for a run without
    channels."""
    data = run.record if run.record is not None else run.plateaus
    if data is None:
        return {}
    return {name: _from_si(name, column) for name, column in _columns(data).items() if column is not None}


def simulated_body(run: SimulatedRun) -> dict[str, object]:
    """The JSON body of a simulated run."""
    body = simulated_head(run)
    channels = simulated_channels(run)
    if channels:
        body["channels"] = {name: column.tolist() for name, column in channels.items()}
    if run.duty is not None:
        body["duty"] = _duty(run.duty)
    return body


def simulated_inspection(surface: Surface, cycles: float) -> dict[str, object]:
    """The JSON body of an inspection of a simulated clutch after this many cycles, to three digits as from a
    profilometer."""
    roughness = float(f"{surface.roughness * _MICROMETRES_PER_METRE:.3g}")
    return {
        "cycles": cycles,
        "roughness_um": roughness,
        "skewness": float(f"{surface.skewness:.3g}"),
        "origin": "simulated",
    }


def _columns(data: Plateaus | Record) -> dict[str, FloatArray | None]:
    """The measured columns by public channel name, in SI units; None if not measured."""
    columns = {
        "pressure_bar": data.pressure,
        "speed_rpm": data.speed,
        "torque_nm": data.torque,
        "oil_temperature_c": data.oil_temperature,
        "plate_temperature_front_c": data.plate_temperature,
    }
    if isinstance(data, Record):
        return {"time_s": data.time} | columns
    return columns | {"torque_sd_nm": data.torque_sd}


def _from_si(name: str, column: FloatArray) -> FloatArray:
    """Values converted to the channel's unit and rounded to nine digits, each the double nearest to its decimal."""
    channel = CHANNELS[name]
    values = (column - channel.offset) / channel.factor
    size = np.floor(np.log10(np.maximum(np.abs(values), 1e-9))).astype(np.int64)
    scale = _POWERS[np.clip(_DIGITS - 1 - size, 0, _POWERS.size - 1)]
    # exact powers of ten, and an integer over one is rounded once
    return np.asarray(np.round(values * scale) / scale + 0.0, dtype=np.float64)


def _duty(block: DutyBlock) -> dict[str, float]:
    return {
        "cycles": block.cycles,
        "energy_per_cycle_kj": round(block.energy_per_cycle / 1000, 6),
        "initial_speed_rpm": round(block.initial_speed / RADIANS_PER_SECOND_PER_RPM, 6),
        "maximum_pressure_bar": block.maximum_pressure / PASCALS_PER_BAR,
    }


_LISTS = ("pressures_bar", "speeds_rpm")


def planned_tests(path: Path, alternative: int) -> list[PlannedTest]:
    """The steps of one alternative of a plan, counted from 1. Raises ValueError naming the fault, OSError."""
    text = path.read_text(encoding="utf-8-sig")
    tests = _steps_from_json(path, text) if text.lstrip().startswith("{") else _steps_from_csv(text)
    if not tests:
        raise _no_plan(path, "it has no tests")
    if alternative not in tests:
        raise ValueError(f"--alternative must be 1 to {len(tests)}, as {path} has them, got {alternative}")
    return [_planned(f"{path}, step {number}", step) for number, step in enumerate(tests[alternative], start=1)]


def _steps_from_json(path: Path, text: str) -> dict[int, list[Any]]:
    try:
        return {number: test["steps"] for number, test in enumerate(json.loads(text)["tests"], start=1)}
    except (ValueError, KeyError, TypeError) as error:
        raise _no_plan(path, str(error)) from None


def _no_plan(path: Path, why: str) -> ValueError:
    return ValueError(f"{path} is not a plan of a diagnosis ({why}): save one with clutchlife diagnose ID --plan FILE")


def _steps_from_csv(text: str) -> dict[int, list[Any]]:
    tests: dict[int, list[Any]] = {}
    for row in csv.DictReader(text.splitlines()):
        cells = {name: cell or None for name, cell in row.items() if name in PlanStep.model_fields}
        lists = {name: (row.get(name) or "").split() for name in _LISTS}
        tests.setdefault(int(row.get("test") or 0), []).append(cells | lists)
    return tests


def _planned(place: str, given: Mapping[str, Any]) -> PlannedTest:
    """A step of a plan as a test of the simulated rig. Raises ValueError, which names the `place`."""
    try:
        step = PlanStep.model_validate(given)
    except ValidationError as error:
        wrong = error.errors()[0]
        rule = rule_in_words(wrong["type"], wrong["msg"])
        raise ValueError(f"{place}: {'.'.join(map(str, wrong['loc']))}: {rule}") from None
    if not step.pressures_bar or not step.speeds_rpm or step.cycles is None:
        raise ValueError(f"{place}: pressures_bar, speeds_rpm and cycles must be given")
    warm = step.oil_temperature_c
    return PlannedTest(
        pressures=tuple(PASCALS_PER_BAR * level for level in step.pressures_bar),
        speeds=tuple(RADIANS_PER_SECOND_PER_RPM * speed for speed in step.speeds_rpm),
        cycles=round(step.cycles),
        frequency=step.frequency_hz,
        periods=step.periods or 1,
        oil=OIL_TEMPERATURE if warm is None else warm + ZERO_CELSIUS,
        repeats=step.repeats,
    )
