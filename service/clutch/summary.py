"""The summary of a clutch's condition: what is stored with the clutch after every run, and what lists, alarms and answers
read. It is the JSON of a row, with typed fields; none of them is there before the first run.
"""

from collections.abc import Mapping
from typing import Any, TypedDict


class Outlook(TypedDict, total=False):
    """A prediction in its shortest form, as it is stored with the held runs counted."""

    status: str
    as_of_cycles: float | None
    remaining_cycles: dict[str, float | None]
    at_least: float | None


class MeasuredState(TypedDict):
    """The present state, as `Current` of the API."""

    mean_cof: float | None
    mean_cof_sd: float | None
    measured_at_cycles: float | None
    fraction_of_initial: float | None
    health: float | None


class StatedLifeEnd(TypedDict):
    """The declared end of a life, as `DeclaredEnd` of the API."""

    cycles: float
    reason: str
    run_id: str


class PredictionInShort(Outlook, total=False):
    """What is stored of a prediction in the summary."""

    runs_used: int
    current: MeasuredState
    criterion: Mapping[str, Any]
    probability_of_reaching: float | None
    model: Mapping[str, Any]
    ended: StatedLifeEnd | None
    horizon_cycles: float
    end_of_life_cycles: dict[str, float | None]


class Pace(TypedDict):
    """The pace of the dated runs, and the moment [s since 1970] from which it counts on."""

    cycles_per_second: float
    moment: float


class StoredSummary(PredictionInShort, total=False):
    """The summary: the prediction, the present life, its tests, and the same with the held runs counted, by filter.
    `damaged`: why there is no other field."""

    runs: int
    new_levels: list[str]
    recent: Mapping[str, Any]
    life: str
    from_cycles: float
    tests: int
    corrected: list[str]
    oil_question: str | None
    rig_question: str | None
    places: int
    pace: Pace | None
    held: int
    with_held: Mapping[str, Outlook] | None
    damaged: str
