"""How right the predictions were, once a clutch has reached its threshold: those that would have been made at each test.

The end of life that came is where straight lines between the tests first pass the threshold; the threshold is the
criterion's fraction of the initial mean COF, as the exact filter has it from all tests. Every test before it is a prediction
made of the tests up to then. Shares are of the whole life, from its origin to its end.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from models.prognosis import scoring
from models.prognosis.back_cast import BackCast
from models.prognosis.criteria import QUANTILES
from service import repository
from service.api.fleet import EndedLife, FleetScores, ScoredLife, ScoredPrediction, Scores, ScoreSummary, StageSummary
from service.api.life import LifePrediction, MethodName
from service.channels import whole
from service.clutch.assumptions import ALL_PRESSURES, Assumptions, severity_name
from service.clutch.items import INSUFFICIENT
from service.clutch.timeline import Life
from service.clutch.tracking import PREDICTED, predict_at
from service.tables import Cells, cells
from storage import results
from storage.engine.database import Database

#: α of the α-λ accuracy, of remaining life, and of the prognostic horizon, of the whole life.
ALPHA_LAMBDA, ALPHA_HORIZON = 0.2, 0.1
#: Stages of life, by their middles, and the half width of each.
STAGES, HALF_STAGE = (0.2, 0.4, 0.6, 0.8), 0.1
_LOW, _HIGH = "0.05", "0.95"


def scores_of_clutch(database: Database, clutch_id: str, method: MethodName) -> Scores:
    """The scores of predictions over a clutch's ended lives; NotFoundError for an unknown clutch."""
    with database.reading() as connection:
        state = repository.state(connection, clutch_id)
        rows = results.predictions_of(connection, clutch_id, method, ALL_PRESSURES)
    stored = {row.cycles: repository.prediction(row) for row in rows}
    assumptions = state.assumptions
    items = []
    for life in state.lives:
        end = end_of_life(life, assumptions, state.fraction)
        if end is not None:
            predictions = stored if method in PREDICTED else _predictions(life, assumptions, state.fraction, method)
            items.append(_scored(life, assumptions, end, predictions))
    return Scores(clutch_id=clutch_id, method=method, revision=state.revision, items=items, next=None)


def scores_of_fleet(scored: Iterable[Scores], *, method: MethodName) -> FleetScores:
    """The scores over all ended lives, overall and by stage of life, from each clutch's `scores_of_clutch`."""
    lives = [(clutch.clutch_id, life) for clutch in scored for life in clutch.items]
    tests = [test for _, life in lives for test in life.predictions]
    by_stage = {stage: [test for test in tests if abs(test.share_of_life - stage) <= HALF_STAGE] for stage in STAGES}
    return FleetScores(
        method=method,
        lives=[
            EndedLife(clutch_id=clutch_id, origin_cycles=life.origin_cycles, end_of_life_cycles=life.end_of_life_cycles)
            for clutch_id, life in lives
        ],
        overall=summary(tests),
        stages=[StageSummary(share_of_life=stage, **dict(summary(of_stage))) for stage, of_stage in by_stage.items()],
        pit_histogram=_histogram(tests),
    )


def end_of_life(life: Life, assumptions: Assumptions, fraction: float) -> float | None:
    """The cycles since new at which the tests passed the threshold; None if they have not."""
    series = life.pooled(assumptions)
    if not series.measurements:
        return None
    prediction = predict_at([life], assumptions, fraction, method="grid", back_cast=BackCast.nothing())
    threshold = prediction.criterion.threshold_mean_cof
    if prediction.status == INSUFFICIENT or threshold is None:
        return None
    cycles = np.array([life.events[index].cycles for index in series.events])
    values = np.array([measurement.value for measurement in series.measurements])
    values = values + assumptions.offset(series.quantity, series.pressure, cycles)
    return scoring.measured_end(cycles, values, threshold)


def _predictions(life: Life, assumptions: Assumptions, fraction: float, method: str) -> dict[float, LifePrediction]:
    """The predictions at each test, by cycles, of a method whose predictions are not stored."""
    predictions = {}
    for index, event in enumerate(life.events):
        if event.cofs:
            predictions[event.cycles] = predict_at([life.until(index)], assumptions, fraction, method=method)
    return predictions


def _scored(life: Life, assumptions: Assumptions, end: float, made: Mapping[float, LifePrediction]) -> ScoredLife:
    """The score of the predictions made during an ended life, compared with its known end."""
    at = sorted({event.cycles for event in life.events if event.cofs and event.cycles < end})
    tests = [_test(made[cycles], cycles, life.origin, end) for cycles in at if made[cycles].status != INSUFFICIENT]
    horizon = scoring.prognostic_horizon(
        [test.cycles - life.origin for test in tests],
        [test.remaining_cycles["0.5"] for test in tests],
        end - life.origin,
        ALPHA_HORIZON,
    )
    return ScoredLife(
        origin_cycles=whole(life.origin),
        end_of_life_cycles=end,
        prognostic_horizon_cycles=horizon,
        summary=summary(tests),
        pit_histogram=_histogram(tests),
        predictions=tests,
        model=assumptions.model.name,
        prior=assumptions.prior.name,
        severity=severity_name(assumptions.severity),
    )


def _test(prediction: LifePrediction, cycles: float, origin: float, end: float) -> ScoredPrediction:
    """One prediction with its errors; a quantile beyond the horizon is scored as if it were at the horizon."""
    remaining, length = prediction.remaining_cycles, end - origin
    horizon = origin + prediction.horizon_cycles
    ends = [horizon if value is None else value for value in prediction.end_of_life_cycles.values()]
    crps = scoring.crps_of_quantiles(QUANTILES, ends, end)
    low, high = (prediction.end_of_life_cycles[quantile] for quantile in (_LOW, _HIGH))
    return ScoredPrediction(
        cycles=whole(cycles),
        runs_used=prediction.runs_used,
        share_of_life=(cycles - origin) / length,
        true_remaining_cycles=end - cycles,
        remaining_cycles=remaining,
        crps_cycles=crps,
        crps_share=crps / length,
        interval_share=(ends[-1] - ends[0]) / length,
        covered=scoring.covered(low, high, end),
        pit=scoring.pit_of_quantiles(QUANTILES, ends, end),
        alpha_lambda=scoring.alpha_lambda(remaining["0.5"], cycles, end, ALPHA_LAMBDA),
    )


def summary(tests: Sequence[ScoredPrediction]) -> ScoreSummary:
    """Mean scores over predictions; null if there are none."""

    def mean(name: str) -> float | None:
        return math.fsum(getattr(test, name) for test in tests) / len(tests) if tests else None

    return ScoreSummary(
        predictions=len(tests),
        crps_share=mean("crps_share"),
        interval_share=mean("interval_share"),
        coverage=mean("covered"),
        alpha_lambda=mean("alpha_lambda"),
    )


def _histogram(tests: Sequence[ScoredPrediction]) -> list[float]:
    return scoring.pit_histogram([test.pit for test in tests]).tolist() if tests else []


def stage_rows(fleet: FleetScores) -> Iterator[Cells]:
    """Mean scores by stage of life as rows of a table; the last row is over all predictions."""
    for stage in fleet.stages:
        yield {"share_of_life": stage.share_of_life} | dict(stage)
    yield {"share_of_life": None} | dict(fleet.overall)


def rows(answer: Scores) -> list[Cells]:
    """Scored predictions as rows of a table."""
    names = (
        "cycles", "runs_used", "share_of_life", "true_remaining_cycles", "crps_cycles", "crps_share", "interval_share",
    )  # fmt: skip
    judged = ("covered", "pit", "alpha_lambda")
    return [
        {"end_of_life_cycles": item.end_of_life_cycles}
        | cells(test, names)
        | {f"remaining_cycles_{quantile}": value for quantile, value in test.remaining_cycles.items()}
        | cells(test, judged)
        for item in answer.items
        for test in item.predictions
    ]
