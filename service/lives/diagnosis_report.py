"""A report of the diagnosis in the public shape: names and units of the edge, every number finite or null."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.detection.lack_of_fit import Misfit
from models.diagnosis.report.report import LoopTrace, Maps, Report
from models.diagnosis.validation.held_out import Gain
from service.columns import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, bar

#: Maps and traces are looked at: more digits than these only weigh.
_DIGITS = 6


def empty() -> dict[str, Any]:
    """The report of a diagnosis that has none: nothing said, in the same shape."""
    return {
        "verdict": None,
        "causes": [],
        "summary": "",
        "candidates": [],
        "baseline": _misfit(None),
        "extended": _misfit(None),
        "gain": _gain(None, {}, {}),
        "advice": [],
        "visible": [],
        "notes": [],
        "statistics": {},
        "maps": None,
        "loops": [],
    }


def public(
    report: Report, *, origin: float, before: Mapping[str, Any], after: Mapping[str, Any], notes: tuple[str, ...]
) -> dict[str, Any]:
    """The report as it is answered; its cycles counted from `origin` become cycles since new.

    `before` and `after` are the remaining useful life under the baseline and under the extension.
    """
    return {
        "verdict": report.verdict.value,
        "causes": list(report.causes),
        "summary": report.summary,
        "candidates": [
            {
                "effect": each.effect,
                "title": each.title,
                "probability": finite(each.probability),
                "log_evidence_gain": finite(each.log_evidence_gain),
                "estimate": {
                    "name": each.estimate.name,
                    "value": finite(each.estimate.value),
                    "sd": finite(each.estimate.sd),
                    "unit": each.estimate.unit,
                },
                "beside": list(each.beside),
            }
            for each in report.candidates
        ],
        "baseline": _misfit(report.baseline),
        "extended": _misfit(report.extended),
        "gain": _gain(report.gain, before, after),
        "advice": [
            {"key": each.key, "test": each.test, "separates": [each.effect, each.other], "nats": finite(each.nats)}
            for each in report.advice
        ],
        "visible": [
            {"effect": each.effect, "amplitude": finite(each.amplitude), "unit": each.unit} for each in report.visible
        ],
        "notes": [*notes, *report.notes],
        "statistics": {name: finite(value) for name, value in report.statistics.items()},
        "maps": None if report.maps is None else _maps(report.maps, origin),
        "loops": [_loop(each, origin) for each in report.loops],
    }


def finite(value: float) -> float | None:
    """The number where it is one that JSON can carry, else None."""
    found = float(value)
    return found if math.isfinite(found) else None


def _misfit(found: Misfit | None) -> dict[str, Any]:
    if found is None:
        return {"rmse_nm": None, "noise_nm": None, "unexplained_share": None, "where": []}
    return {
        "rmse_nm": finite(found.rmse),
        "noise_nm": finite(found.noise),
        "unexplained_share": finite(found.unexplained_share),
        "where": [
            {"axis": each.axis, "strength": finite(each.strength), "p_value": finite(each.p_value)}
            for each in found.where
        ],
    }


#: The public names of a gain's numbers.
_GAIN = {
    "rmse_before_nm": "rmse_before",
    "rmse_after_nm": "rmse_after",
    "reduction_percent": "reduction_percent",
    "reduction_percent_sd": "reduction_sd",
    "excess_before_nm": "excess_before",
    "excess_after_nm": "excess_after",
    "mse_percent_before": "mse_percent_before",
    "mse_percent_after": "mse_percent_after",
    "log_score_gain": "log_score_gain",
    "foretelling_log_score_gain": "forecast_log_score_gain",
}


def _gain(found: Gain | None, before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "held_out_runs": [] if found is None else list(found.held_out_runs),
        **{public: None if found is None else finite(getattr(found, name)) for public, name in _GAIN.items()},
        "remaining_useful_life": {"before": dict(before), "after": dict(after)},
    }


def _maps(found: Maps, origin: float) -> dict[str, Any]:
    return {
        "axes": {
            "pressure_bar": [bar(each) for each in found.pressure.tolist()],
            "speed_rpm": _numbers(found.speed / RADIANS_PER_SECOND_PER_RPM),
            "cycles": _numbers(found.cycles + origin),
        },
        "before": {
            "speed_pressure": _numbers(found.speed_pressure_before),
            "pressure_cycles": _numbers(found.pressure_cycles_before),
        },
        "after": {
            "speed_pressure": _numbers(found.speed_pressure_after),
            "pressure_cycles": _numbers(found.pressure_cycles_after),
        },
    }


def _loop(found: LoopTrace, origin: float) -> dict[str, Any]:
    return {
        "pressure_bar": found.pressure / PASCALS_PER_BAR,
        "cycles": found.cycles + origin,
        "frequency_hz": finite(found.frequency),
        "speed_rpm": _numbers(found.speed / RADIANS_PER_SECOND_PER_RPM),
        "measured_nm": _numbers(found.measured),
        "baseline_nm": _numbers(found.baseline),
        "extended_nm": _numbers(found.extended),
    }


def _numbers(values: FloatArray) -> list[Any]:
    """An array of any shape as nested lists, rounded, with None where a number is not finite."""
    if values.ndim > 1:
        return [_numbers(row) for row in values]
    return [float(f"{each:.{_DIGITS}g}") if math.isfinite(each) else None for each in np.asarray(values).tolist()]
