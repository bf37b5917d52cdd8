"""A diagnosis report in the names and units of the API; every number is finite or null."""

from __future__ import annotations

import math
from enum import Enum
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from models.arrays import FloatArray
from service.api import diagnosis as shapes
from service.api.base import Answer
from service.api.life import LifePrediction
from service.channels import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS, bar

if TYPE_CHECKING:  # start-up time: they load the whole diagnosis
    from models.diagnosis.experiments.candidates import Step
    from models.diagnosis.report.friction_law import FrictionLaw, LawCurve
    from models.diagnosis.report.maps import LoopTrace, Maps
    from models.diagnosis.report.report import Isolability, Misfit, Report
    from models.diagnosis.validation.held_out import Gain

Shape = TypeVar("Shape", bound=Answer)
#: Maps and traces are looked at: more digits than these only weigh.
_DIGITS = 6


#: The numbers of a gain that have other names where they are found.
_GAIN = {"reduction_percent_sd": "reduction_sd", "prediction_log_score_gain": "forecast_log_score_gain"}


def finite(value: float) -> float | None:
    """The number if JSON can represent it, else None."""
    number = float(value)
    return number if math.isfinite(number) else None


def _misfit(misfit: Misfit | None) -> shapes.MisfitOut:
    """The error of the model as the report shows it."""
    if misfit is None:
        return shapes.MisfitOut(rmse_nm=None, noise_nm=None, unexplained_share=None, where=[])
    return _shaped(
        shapes.MisfitOut,
        misfit,
        rmse_nm=finite(misfit.rmse),
        noise_nm=finite(misfit.noise),
        where=[_shaped(shapes.WhereOut, axis) for axis in misfit.where],
    )


def _gain(gain: Gain | None, before: LifePrediction | None, after: LifePrediction | None) -> shapes.GainOut:
    """The gain of the extended model on held-out runs, with the remaining life before and after."""
    numbers = [name for name in shapes.GainOut.model_fields if name not in {"held_out_runs", "remaining_useful_life"}]
    attributes = {name: _GAIN.get(name, name.removesuffix("_nm")) for name in numbers}
    return shapes.GainOut(
        held_out_runs=[] if gain is None else list(gain.held_out_runs),
        **{name: None if gain is None else finite(getattr(gain, attribute)) for name, attribute in attributes.items()},
        remaining_useful_life=shapes.BeforeAndAfter(before=_stored(before), after=_stored(after)),
    )


def _stored(prediction: LifePrediction | None) -> dict[str, object]:
    """A prediction as the value of a JSON column; empty without one."""
    return {} if prediction is None else prediction.model_dump(mode="json", exclude_unset=True)


#: The report of a diagnosis that has none: nothing said, in the same shape.
EMPTY = shapes.ReportOut(
    verdict=None,
    causes=[],
    summary="",
    explanations=[],
    candidates=[],
    baseline=_misfit(None),
    extended=_misfit(None),
    gain=_gain(None, None, None),
    advice=[],
    visible=[],
    notes=[],
    statistics={},
    maps=None,
    loops=[],
)


def public(
    report: Report,
    *,
    origin: float,
    before: LifePrediction | None,
    after: LifePrediction | None,
    notes: tuple[str, ...],
) -> shapes.ReportOut:
    """The report as sent to clients, with its cycles from `origin` converted to cycles since new.

    `before` and `after` are the remaining useful life under the baseline and under the extension.
    """
    law = report.friction_law
    return shapes.ReportOut(
        verdict=report.verdict.value,
        causes=list(report.causes),
        summary=" ".join(part for part in (report.summary, _remaining(report, before, after)) if part),
        explanations=[_shaped(shapes.ExplanationOut, explanation) for explanation in report.explanations],
        candidates=[
            _shaped(shapes.CandidateOut, candidate, estimate=_shaped(shapes.Amplitude, candidate.estimate))
            for candidate in report.candidates
        ],
        baseline=_misfit(report.baseline),
        extended=_misfit(report.extended),
        gain=_gain(report.gain, before, after),
        friction_law=None if law is None else _friction_law(law),
        like_the_law=list(report.like_the_law),
        advice=[
            _shaped(
                shapes.AdviceOut,
                test,
                separates=[test.effect, test.other],
                narrows=finite(test.narrows) if test.narrows else None,
                minutes=round(test.minutes, 1),
                steps=[_step(step, origin) for step in test.steps],
            )
            for test in report.advice
        ],
        visible=[_shaped(shapes.VisibleOut, smallest) for smallest in report.visible],
        not_adoptable=report.not_adoptable or None,
        notes=[*notes, *report.notes],
        statistics={name: finite(value) for name, value in report.statistics.items()},
        maps=None if report.maps is None else _maps(report.maps, origin),
        loops=[_loop(loop, origin) for loop in report.loops],
        law_curves=[] if law is None else [_law_curve(curve, origin) for curve in law.curves],
        isolability=None if report.isolability is None else _isolability(report.isolability),
    )


def _isolability(isolability: Isolability) -> shapes.IsolabilityOut:
    """Which causes the tests could tell apart, as the report shows it."""
    pairs = [
        _shaped(
            shapes.PairOut,
            pair,
            key=pair.trial or None,
            test=pair.test or None,
            with_test=finite(pair.with_trial),
        )
        for pair in isolability.pairs
    ]
    return shapes.IsolabilityOut(pairs=pairs, unseen=list(isolability.unseen))


def _shaped(shape: type[Shape], found: object, **others: Any) -> Shape:
    """An answer of this type with the fields of the same names of `found`, or those given in `others`."""
    fields = shape.model_fields
    return shape(**{name: others[name] if name in others else _plain(getattr(found, name)) for name in fields})


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return finite(value) if isinstance(value, float) else value


def _remaining(report: Report, before: LifePrediction | None, after: LifePrediction | None) -> str:
    """The effect of adopting the extension on the median of the remaining life, in a sentence; empty without an
    extension.

    Two digits: a filter's draws move the third, and with them the clutch's name."""
    medians = [None if prediction is None else prediction.remaining_cycles.get("0.5") for prediction in (before, after)]
    if report.extension is None:
        return ""
    rounded = [f"{float(f'{median:.2g}'):,.0f}" for median in medians if median is not None]
    if len(rounded) < 2:
        return ""
    now, then = rounded
    if now == then == "0":
        return ""
    if now == "0":
        return f"If you adopt it, the end is not reached any more: a median of about {then} cycles remains."
    if then == "0":
        return f"If you adopt it, the end is reached; without it, a median of about {now} cycles remains."
    if now == then:
        return f"If you adopt it, the median of the remaining life stays at about {now} cycles."
    return f"If you adopt it, the median of the remaining life changes from about {now} to about {then} cycles."


def _step(step: Step, origin: float) -> shapes.PlanStep:
    """A step of the test plan in public units."""
    return _shaped(
        shapes.PlanStep,
        step,
        pressures_bar=[round(bar(pressure), 4) for pressure in step.pressures],
        speeds_rpm=[round(speed / RADIANS_PER_SECOND_PER_RPM, 2) for speed in step.speeds],
        frequency_hz=step.frequency,
        oil_temperature_c=None if step.temperature is None else round(step.temperature - ZERO_CELSIUS, 2),
        cycles=step.cycles + origin,
        pause_hours=step.pause / 3600.0,
        minutes=round(step.minutes, 1),
    )


def _friction_law(law: FrictionLaw) -> shapes.FrictionLawOut:
    """The friction law's difference from eq. 3 as the report shows it."""
    gain = law.gain
    effect = law.effect_on_remaining_cycles_percent
    return _shaped(
        shapes.FrictionLawOut,
        law,
        where=[
            shapes.LawBandOut(
                axis="speed",
                from_rpm=_rounded(band.low / RADIANS_PER_SECOND_PER_RPM),
                to_rpm=_rounded(band.high / RADIANS_PER_SECOND_PER_RPM),
                share=_rounded(band.share),
            )
            for band in law.where
        ],
        effect_on_remaining_cycles_percent=None if effect is None else finite(effect),
        gain=None
        if gain is None
        else _shaped(
            shapes.LawGainOut,
            gain,
            rmse_before_nm=finite(gain.rmse_before),
            rmse_after_nm=finite(gain.rmse_after),
            reduction_percent_sd=finite(gain.reduction_sd),
        ),
    )


def _law_curve(curve: LawCurve, origin: float) -> shapes.LawCurveOut:
    """A friction curve as measured, by eq. 3 and by the law, in public units."""
    return shapes.LawCurveOut(
        pressure_bar=curve.pressure / PASCALS_PER_BAR,
        cycles=curve.cycles + origin,
        speed_rpm=_numbers(curve.speed / RADIANS_PER_SECOND_PER_RPM),
        measured_nm=_numbers(curve.measured),
        eq3_nm=_numbers(curve.eq3),
        law_nm=_numbers(curve.law),
        law_sd_nm=_numbers(curve.sd),
    )


def _maps(maps: Maps, origin: float) -> shapes.MapsOut:
    """The residual maps in public units."""
    return shapes.MapsOut(
        axes=shapes.Axes(
            pressure_bar=[bar(pressure) for pressure in maps.pressure.tolist()],
            speed_rpm=_numbers(maps.speed / RADIANS_PER_SECOND_PER_RPM),
            cycles=_numbers(maps.cycles + origin),
        ),
        before=shapes.ResidualMap(
            speed_pressure=_numbers(maps.speed_pressure_before),
            pressure_cycles=_numbers(maps.pressure_cycles_before),
        ),
        after=shapes.ResidualMap(
            speed_pressure=_numbers(maps.speed_pressure_after),
            pressure_cycles=_numbers(maps.pressure_cycles_after),
        ),
    )


def _loop(loop: LoopTrace, origin: float) -> shapes.LoopTraceOut:
    """A friction loop as measured and by both models, in public units."""
    return shapes.LoopTraceOut(
        pressure_bar=loop.pressure / PASCALS_PER_BAR,
        cycles=loop.cycles + origin,
        frequency_hz=finite(loop.frequency),
        speed_rpm=_numbers(loop.speed / RADIANS_PER_SECOND_PER_RPM),
        measured_nm=_numbers(loop.measured),
        baseline_nm=_numbers(loop.baseline),
        extended_nm=_numbers(loop.extended),
    )


def _numbers(values: FloatArray) -> list[Any]:
    """An array of any shape as nested lists, rounded, with None where a number is not finite."""
    if values.ndim > 1:
        return [_numbers(row) for row in values]
    return [_rounded(value) if math.isfinite(value) else None for value in np.asarray(values).tolist()]


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
