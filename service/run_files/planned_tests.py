"""A diagnosis' plan as a file, CSV or JSON as the service answers it -> the tests that the simulated rig is to make."""

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from models.rig.programme import PlannedTest
from models.rig.stationary import OIL_TEMPERATURE
from service.columns import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS
from service.schemas.base import rule_in_words
from service.schemas.diagnosis import PlanStep

_LISTS = ("pressures_bar", "speeds_rpm")


def planned_tests(path: Path, alternative: int) -> list[PlannedTest]:
    """The steps of one of a plan's alternatives, from 1. Raises ValueError that names what is wrong, OSError."""
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
