"""Measured engagements: that of one run, evaluated in the public names and units, and those of a clutch over its lives.

The reference of a life is made of its first engagements after the run-in; those of another initial speed or pressure than
the very first are of another duty, and are neither part of it nor compared with it.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.engagements.comparison import Comparison, SpeedCourse, compared, reference_of, same_duty
from models.engagements.measured import EngagementIndicators, measured_engagement
from models.engagements.slip import Refusal, ValueWithError
from service.api.over_life import AllIndicators, MeasuredEngagement
from service.api.run import Evaluation, IndicatorEstimate, Indicators, ReceivedEngagement
from service.channels import CHANNELS, PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM
from service.clutch.incoming_run import IncomingRun, sampled_record
from service.errors import Notice

#: The indicators of a run's engagement, or why it has none.
EvaluatedEngagement: TypeAlias = EngagementIndicators | Refusal

#: Kinds of runs that may carry the record of an engagement.
DUTY_KINDS = ("duty_cycles", "run_in")
#: Where a run's own comparison course stands among what is kept beside its channels.
COURSE = "engagement_course"


@dataclass(frozen=True, slots=True, kw_only=True)
class Indicator:
    """An engagement indicator as sent to clients: public value = SI value / factor; `field`: its name in the models."""

    field: str
    unit: str = "1"
    factor: float = 1.0


#: The indicators of one engagement by public name.
INDICATORS: Mapping[str, Indicator] = {
    "stop_time_s": Indicator(field="stop_time", unit="s"),
    "engagement_energy_kj": Indicator(field="energy", unit="kJ", factor=1000.0),
    "peak_power_kw": Indicator(field="peak_power", unit="kW", factor=1000.0),
    "initial_cof": Indicator(field="initial_cof"),
    "midpoint_cof": Indicator(field="midpoint_cof"),
    "endpoint_cof": Indicator(field="endpoint_cof"),
    "breakaway_cof": Indicator(field="breakaway_cof"),
    "initial_cof_ratio": Indicator(field="initial_ratio"),
    "endpoint_cof_ratio": Indicator(field="endpoint_ratio"),
    "breakaway_cof_ratio": Indicator(field="breakaway_ratio"),
    "torque_rise": Indicator(field="torque_rise"),
}
#: The indicators of an engagement against the first ones of its life.
COMPARED: Mapping[str, Indicator] = {
    "normalised_duration": Indicator(field="normalised_duration"),
    "euclidean_distance": Indicator(field="euclidean_distance"),
    "spectral_angle_rad": Indicator(field="spectral_angle", unit="rad"),
}
#: All indicators by public name, in the order in which answers have them.
ALL_INDICATORS: Mapping[str, Indicator] = {**INDICATORS, **COMPARED}


def evaluated(run: IncomingRun, geometry: Geometry) -> EvaluatedEngagement | None:
    """The evaluated engagement of a block of duty; None for a run without one."""
    if run.kind not in DUTY_KINDS or not run.channels:
        return None
    return measured_engagement(sampled_record(run.channels), geometry)


def engagement_notices(engagement: EvaluatedEngagement | None) -> list[Notice]:
    """The warning of a sent record in which no engagement was found."""
    if not isinstance(engagement, Refusal):
        return []
    message = f"the engagement is stored but not evaluated: {engagement.message}"
    return [Notice(code="no_engagement", message=message)]


def engagement_item(engagement: EvaluatedEngagement) -> ReceivedEngagement:
    """An engagement as a receipt shows it; undetermined values are null."""
    if isinstance(engagement, Refusal):
        return ReceivedEngagement(
            status=engagement.status.value,
            message=engagement.message,
            start_s=None,
            end_s=None,
            initial_speed_rpm=None,
            maximum_pressure_bar=None,
            indicators=Indicators(**dict.fromkeys(INDICATORS)),
        )
    slip = engagement.slip
    return ReceivedEngagement(
        status="determined",
        message=f"The clutch slipped for {engagement.stop_time.value:.3g} s.",
        start_s=slip.start.value,
        end_s=slip.end.value,
        initial_speed_rpm=engagement.initial_speed.value / RADIANS_PER_SECOND_PER_RPM,
        maximum_pressure_bar=engagement.maximum_pressure / PASCALS_PER_BAR,
        indicators=Indicators(**_indicator_items(engagement, INDICATORS)),
    )


def _indicator_items(
    found: EngagementIndicators | Comparison, indicators: Mapping[str, Indicator]
) -> dict[str, IndicatorEstimate | None]:
    """Each indicator with its standard error in its public unit; null if undetermined."""
    items: dict[str, IndicatorEstimate | None] = {}
    for name, indicator in indicators.items():
        estimate: ValueWithError | None = getattr(found, indicator.field)
        factor = indicator.factor
        items[name] = (
            None if estimate is None else IndicatorEstimate(value=estimate.value / factor, sd=estimate.sd / factor)
        )
    return items


def course_item(engagement: EvaluatedEngagement | None) -> dict[str, object]:
    """The course of the sliding speed, to be stored with a run's channels; empty for a run without an engagement."""
    if not isinstance(engagement, EngagementIndicators):
        return {}
    course = engagement.course
    return {
        COURSE: {
            "duration_s": course.duration.value,
            "duration_sd_s": course.duration.sd,
            "speed_rpm": (course.speed / RADIANS_PER_SECOND_PER_RPM).round(3).tolist(),
            "noise_rpm": course.noise / RADIANS_PER_SECOND_PER_RPM,
        }
    }


def public_channels(columns: Mapping[str, FloatArray]) -> dict[str, list[float]]:
    """A trace's channels [n], converted from SI to their public units, by public name."""
    return {
        name: ((column - CHANNELS[name].offset) / CHANNELS[name].factor).round(6).tolist()
        for name, column in columns.items()
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredEngagement:
    """A stored run with an engagement: its receipt, and the course of speed if it was evaluated."""

    receipt: Evaluation
    item: ReceivedEngagement
    course: SpeedCourse | None

    @property
    def run_id(self) -> str:
        return self.receipt.run_id

    @property
    def duty(self) -> tuple[float, float]:
        """Initial speed [rpm] and maximum pressure [bar] of an evaluated engagement."""
        return self.item.initial_speed_rpm or 0.0, self.item.maximum_pressure_bar or 0.0

    def has_duty_of(self, other: "StoredEngagement") -> bool:
        """Whether both engagements are evaluated and have the same duty."""
        return all(same_duty(own, its) for own, its in zip(self.duty, other.duty, strict=True))


def stored_engagement(receipt: Evaluation, details: Mapping[str, Any]) -> StoredEngagement | None:
    """A stored run's engagement; None for a run without one."""
    if receipt.engagement is None:
        return None
    if COURSE not in details:
        return StoredEngagement(receipt=receipt, item=receipt.engagement, course=None)
    kept = details[COURSE]
    course = SpeedCourse(
        duration=ValueWithError(value=kept["duration_s"], sd=kept["duration_sd_s"]),
        speed=np.array(kept["speed_rpm"]) * RADIANS_PER_SECOND_PER_RPM,
        noise=kept["noise_rpm"] * RADIANS_PER_SECOND_PER_RPM,
    )
    return StoredEngagement(receipt=receipt, item=receipt.engagement, course=course)


def engagements_over_life(
    stored: Sequence[StoredEngagement], lives: Sequence[Collection[str]]
) -> list[MeasuredEngagement]:
    """The evaluated engagements in the order given, each with all indicators; `lives` are the run_ids of each life."""
    rows = []
    for life in lives:
        of_life = [engagement for engagement in stored if engagement.run_id in life and engagement.course is not None]
        first = [engagement for engagement in of_life if engagement.receipt.kind == DUTY_KINDS[0]]
        first = [engagement for engagement in first if engagement.has_duty_of(first[0])][:3]  # three make the reference
        courses = [engagement.course for engagement in first if engagement.course is not None]
        reference = reference_of(courses) if courses else None
        for engagement in of_life:
            basis = None if reference is None or not engagement.has_duty_of(first[0]) else reference
            rows.append(_row(engagement, basis))
    return rows


def _row(engagement: StoredEngagement, reference: SpeedCourse | None) -> MeasuredEngagement:
    """An engagement with all its indicators; those of comparison are null without a reference."""
    if reference is None or engagement.course is None:
        comparison: dict[str, IndicatorEstimate | None] = dict.fromkeys(COMPARED)
    else:
        comparison = _indicator_items(compared(engagement.course, reference), COMPARED)
    receipt, (speed, pressure) = engagement.receipt, engagement.duty
    return MeasuredEngagement(
        run_id=receipt.run_id,
        cycles=receipt.cycles,
        kind=receipt.kind,
        time=receipt.started_at or receipt.received_at,
        initial_speed_rpm=speed,
        maximum_pressure_bar=pressure,
        indicators=AllIndicators(**dict(engagement.item.indicators), **comparison),
    )
