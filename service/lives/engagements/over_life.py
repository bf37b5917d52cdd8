"""The engagements of a clutch over its lives: each one's indicators, and how far it is from the first ones of its life.

The reference of a life is made of its first engagements after the run-in; those of another initial speed or pressure than
the very first are of another duty, and are neither part of it nor compared with it.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.engagements.comparison import Comparison, Reference, SpeedCourse, compared, reference_of, same_duty
from models.engagements.criteria import REFERENCES
from service.lives.engagements.evaluation import (
    COURSE,
    DUTY_KINDS,
    INDICATORS,
    Indicator,
    course_of,
    estimate_item,
)

#: The indicators of an engagement against the first ones of its life, by public name.
COMPARED: Mapping[str, Indicator] = {
    "normalised_duration": Indicator(unit="1"),
    "euclidean_distance": Indicator(unit="1"),
    "spectral_angle_rad": Indicator(unit="rad"),
}
#: All indicators by public name, in the order in which answers have them.
ALL_INDICATORS: Mapping[str, Indicator] = {**INDICATORS, **COMPARED}


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredEngagement:
    """What is stored of a run with an engagement: its receipt, and the course of speed where it was evaluated."""

    receipt: Mapping[str, Any]
    course: SpeedCourse | None

    @property
    def run_id(self) -> str:
        """The run's name."""
        return str(self.receipt["run_id"])

    @property
    def item(self) -> Mapping[str, Any]:
        """The engagement as the receipt has it."""
        item: Mapping[str, Any] = self.receipt["engagement"]
        return item

    def of_duty(self, other: "StoredEngagement") -> bool:
        """Whether it is of the same duty as another, both evaluated."""
        return all(
            same_duty(self.item[name], other.item[name]) for name in ("initial_speed_rpm", "maximum_pressure_bar")
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class IndicatorColumns:
    """One indicator over a clutch's runs [n]: cycles since new, value and standard error in the public unit."""

    unit: str
    run_ids: tuple[str, ...]
    cycles: FloatArray
    value: FloatArray
    sd: FloatArray


def stored_engagement(receipt: Mapping[str, Any], details: Mapping[str, Any]) -> StoredEngagement | None:
    """A stored run's engagement; None where it has none, or was evaluated by a release that knew of none."""
    if receipt.get("engagement") is None:
        return None
    return StoredEngagement(receipt=receipt, course=course_of(details[COURSE]) if COURSE in details else None)


def engagements_over_life(stored: Sequence[StoredEngagement], lives: Sequence[Collection[str]]) -> list[dict[str, Any]]:
    """The evaluated engagements in the order given, each with all indicators; `lives` are the run_ids of each life."""
    rows = []
    for life in lives:
        own = [engagement for engagement in stored if engagement.run_id in life and engagement.course is not None]
        first = [engagement for engagement in own if engagement.receipt["kind"] == DUTY_KINDS[0]]
        first = [engagement for engagement in first if engagement.of_duty(first[0])][:REFERENCES]
        courses = [engagement.course for engagement in first if engagement.course is not None]
        reference = reference_of(courses) if courses else None
        for engagement in own:
            basis = None if reference is None or not engagement.of_duty(first[0]) else reference
            rows.append(_row(engagement, basis))
    return rows


def indicator_columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, IndicatorColumns]:
    """The rows of `engagements_over_life` as columns by the indicator's public name, an indicator without values left out.

    This is what a track over life takes: a value and its standard error by cycles since new.
    """
    columns = {}
    for name, indicator in ALL_INDICATORS.items():
        values = [(row, row["indicators"][name]) for row in rows if row["indicators"][name] is not None]
        if values:
            columns[name] = IndicatorColumns(
                unit=indicator.unit,
                run_ids=tuple(row["run_id"] for row, _ in values),
                cycles=np.array([row["cycles"] for row, _ in values], dtype=np.float64),
                value=np.array([estimate["value"] for _, estimate in values]),
                sd=np.array([estimate["sd"] for _, estimate in values]),
            )
    return columns


def _row(engagement: StoredEngagement, reference: Reference | None) -> dict[str, Any]:
    head = {name: engagement.receipt[name] for name in ("run_id", "cycles", "kind")}
    item = {name: engagement.item[name] for name in ("initial_speed_rpm", "maximum_pressure_bar")}
    time = {"time": engagement.receipt["started_at"] or engagement.receipt["received_at"]}
    difference = None if reference is None or engagement.course is None else compared(engagement.course, reference)
    return head | time | item | {"indicators": engagement.item["indicators"] | _comparison_items(difference)}


def _comparison_items(comparison: Comparison | None) -> dict[str, dict[str, float] | None]:
    if comparison is None:
        return dict.fromkeys(COMPARED)
    values = (comparison.normalised_duration, comparison.euclidean_distance, comparison.spectral_angle)
    return {name: estimate_item(value) for name, value in zip(COMPARED, values, strict=True)}
