"""A report of the diagnosis in the public shape: names and units of the edge, every number finite or null."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from models.arrays import FloatArray
from service.columns import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS, bar

if TYPE_CHECKING:  # start-up time: they load the whole diagnosis
    from models.diagnosis.experiments.candidates import Step
    from models.diagnosis.report.report import Isolability, LoopTrace, Maps, Misfit, Report
    from models.diagnosis.validation.held_out import Gain

#: Maps and traces are looked at: more digits than these only weigh.
_DIGITS = 6


def empty() -> dict[str, Any]:
    """The report of a diagnosis that has none: nothing said, in the same shape."""
    return {
        "verdict": None,
        "causes": [],
        "summary": "",
        "explanations": [],
        "candidates": [],
        "baseline": _misfit(None),
        "extended": _misfit(None),
        "gain": _gain(None, {}, {}),
        "advice": [],
        "visible": [],
        "not_adoptable": None,
        "notes": [],
        "statistics": {},
        "maps": None,
        "loops": [],
        "isolability": None,
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
        "summary": " ".join(part for part in (report.summary, _remaining(report, before, after)) if part),
        "explanations": [
            {
                "effects": list(explanation.effects),
                "probability": finite(explanation.probability),
                "sign_probability": None
                if explanation.sign_probability is None
                else finite(explanation.sign_probability),
            }
            for explanation in report.explanations
        ],
        "candidates": [
            {
                "effect": candidate.effect,
                "title": candidate.title,
                "probability": finite(candidate.probability),
                "log_evidence_gain": finite(candidate.log_evidence_gain),
                "estimate": {
                    "name": candidate.estimate.name,
                    "value": finite(candidate.estimate.value),
                    "sd": finite(candidate.estimate.sd),
                    "unit": candidate.estimate.unit,
                    "interval": [finite(end) for end in candidate.estimate.interval],
                },
                "beside": list(candidate.beside),
                "fit": None if candidate.fit is None else candidate.fit.value,
            }
            for candidate in report.candidates
        ],
        "baseline": _misfit(report.baseline),
        "extended": _misfit(report.extended),
        "gain": _gain(report.gain, before, after),
        "advice": [
            {
                "key": test.key,
                "test": test.test,
                "separates": [test.effect, test.other],
                "nats": finite(test.nats),
                "probability": finite(test.probability),
                "narrows": finite(test.narrows) if test.narrows else None,
                "minutes": round(test.minutes, 1),
                "steps": [_step(step, origin) for step in test.steps],
            }
            for test in report.advice
        ],
        "visible": [
            {
                "effect": smallest.effect,
                "amplitude": finite(smallest.amplitude),
                "least": finite(smallest.least),
                "unit": smallest.unit,
            }
            for smallest in report.visible
        ],
        "not_adoptable": report.not_adoptable or None,
        "notes": [*notes, *report.notes],
        "statistics": {name: finite(value) for name, value in report.statistics.items()},
        "maps": None if report.maps is None else _maps(report.maps, origin),
        "loops": [_loop(loop, origin) for loop in report.loops],
        "isolability": None if report.isolability is None else _isolability(report.isolability),
    }


def _isolability(isolability: Isolability) -> dict[str, Any]:
    pairs = [
        {
            "effects": list(pair.effects),
            "probability": finite(pair.probability),
            "apart": pair.apart,
            "key": pair.trial or None,
            "test": pair.test or None,
            "with_test": finite(pair.with_trial),
        }
        for pair in isolability.pairs
    ]
    return {"pairs": pairs, "unseen": list(isolability.unseen)}


def _remaining(report: Report, before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    """What adopting the extension would do to the median of the remaining life, in a sentence; nothing without one.

    Two digits: a filter's draws move the third, and with them the clutch's name."""
    medians = [(forecast.get("remaining_cycles") or {}).get("0.5") for forecast in (before, after)]
    if report.extension is None or None in medians:
        return ""
    now, then = (f"{float(f'{median:.2g}'):,.0f}" for median in medians)
    if now == then == "0":
        return ""
    if now == then:
        return f"Adopting it leaves the median of the remaining life at about {now} cycles."
    return f"Adopting it changes the median of the remaining life from about {now} to about {then} cycles."


def _step(step: Step, origin: float) -> dict[str, Any]:
    return {
        "kind": step.kind,
        "pressures_bar": [round(bar(pressure), 4) for pressure in step.pressures],
        "speeds_rpm": [round(speed / RADIANS_PER_SECOND_PER_RPM, 2) for speed in step.speeds],
        "frequency_hz": step.frequency,
        "periods": step.periods,
        "oil_temperature_c": None if step.temperature is None else round(step.temperature - ZERO_CELSIUS, 2),
        "repeats": step.repeats,
        "cycles": step.cycles + origin,
        "pause_hours": step.pause / 3600.0,
        "minutes": round(step.minutes, 1),
    }


def finite(value: float) -> float | None:
    """The number where it is one that JSON can carry, else None."""
    number = float(value)
    return number if math.isfinite(number) else None


def _misfit(misfit: Misfit | None) -> dict[str, Any]:
    if misfit is None:
        return {"rmse_nm": None, "noise_nm": None, "unexplained_share": None, "where": []}
    return {
        "rmse_nm": finite(misfit.rmse),
        "noise_nm": finite(misfit.noise),
        "unexplained_share": finite(misfit.unexplained_share),
        "where": [
            {"axis": axis.axis, "strength": finite(axis.strength), "p_value": finite(axis.p_value)}
            for axis in misfit.where
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
    "prediction_log_score_gain": "forecast_log_score_gain",
}


def _gain(gain: Gain | None, before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "held_out_runs": [] if gain is None else list(gain.held_out_runs),
        **{public: None if gain is None else finite(getattr(gain, name)) for public, name in _GAIN.items()},
        "remaining_useful_life": {"before": dict(before), "after": dict(after)},
    }


def _maps(maps: Maps, origin: float) -> dict[str, Any]:
    return {
        "axes": {
            "pressure_bar": [bar(pressure) for pressure in maps.pressure.tolist()],
            "speed_rpm": _numbers(maps.speed / RADIANS_PER_SECOND_PER_RPM),
            "cycles": _numbers(maps.cycles + origin),
        },
        "before": {
            "speed_pressure": _numbers(maps.speed_pressure_before),
            "pressure_cycles": _numbers(maps.pressure_cycles_before),
        },
        "after": {
            "speed_pressure": _numbers(maps.speed_pressure_after),
            "pressure_cycles": _numbers(maps.pressure_cycles_after),
        },
    }


def _loop(loop: LoopTrace, origin: float) -> dict[str, Any]:
    return {
        "pressure_bar": loop.pressure / PASCALS_PER_BAR,
        "cycles": loop.cycles + origin,
        "frequency_hz": finite(loop.frequency),
        "speed_rpm": _numbers(loop.speed / RADIANS_PER_SECOND_PER_RPM),
        "measured_nm": _numbers(loop.measured),
        "baseline_nm": _numbers(loop.baseline),
        "extended_nm": _numbers(loop.extended),
    }


def _numbers(values: FloatArray) -> list[Any]:
    """An array of any shape as nested lists, rounded, with None where a number is not finite."""
    if values.ndim > 1:
        return [_numbers(row) for row in values]
    return [float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None for value in np.asarray(values).tolist()]
