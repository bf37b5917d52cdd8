"""What goes out of runs and lives, in the public names and units: receipts, predictions, a list's summary, warnings."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from models.friction.identification import StribeckFit
from models.loops.loops import Loop
from models.prognosis.back_cast import BackCast
from models.prognosis.course_shares import CourseShare
from models.prognosis.criteria import HORIZON, QUANTILES
from models.prognosis.first_passage import FirstPassage
from service.columns import bar, whole
from service.lives.assumptions import ALL_PRESSURES, MEAN_COF, Assumptions
from service.lives.criteria import LOW_HEALTH, MOST_LINE_POINTS
from service.lives.engagements.evaluation import Engagement, engagement_item
from service.lives.history import ByPressure, Event, Life, Series, latest_before
from service.lives.incoming_run import IncomingRun
from service.lives.prediction_notices import OF_HISTORY, late_arrival, missed, not_eq_6, other_oil, other_pressures
from service.lives.run_analysis import LevelFit, Notice, Value
from service.settings import CODE_VERSION

#: Public name and unit of each Stribeck parameter.
PARAMETER_UNITS = {
    "static_torque": ("static_torque_nm", "Nm"),
    "coulomb_ratio": ("coulomb_ratio", "1"),
    "stribeck_velocity": ("stribeck_velocity_m_s", "m/s"),
    "viscous_coefficient": ("viscous_coefficient", "Nm/(m/s)^0.3"),
}
INSUFFICIENT = "insufficient_data"
#: What a list shows of a clutch, out of the particle filter's prediction.
SUMMARY = ("status", "as_of_cycles", "current", "remaining_cycles", "model")
#: The states of a clutch after NAMUR NE 107, the worst first.
STATES = FAILURE, OUT_OF_SPECIFICATION, MAINTENANCE, CHECK, NORMAL = (
    "failure",
    "out_of_specification",
    "maintenance",
    "check",
    "normal",
)
#: A clutch without a prediction comes after all others in a list.
RANK_UNKNOWN = 2 * HORIZON


#: What a receipt says of the file that a run was read from.
_OF_A_FILE = ("filename", "sha256", "bytes", "rig")


def receipt(
    clutch_id: str,
    run: IncomingRun,
    *,
    received_at: str,
    levels: Sequence[LevelFit],
    cofs: ByPressure,
    loops: Sequence[Loop] = (),
    warnings: Sequence[Notice],
    engagement: Engagement | None = None,
) -> dict[str, Any]:
    """The receipt of a run."""
    return {
        "clutch_id": clutch_id,
        "run_id": run.run_id,
        "kind": run.kind,
        "cycles": whole(run.cycles),
        "started_at": run.started_at,
        "origin": run.origin,
        "received_at": received_at,
        "content_sha256": run.content_sha256,
        "duplicate": False,
        "file": None if run.file is None else {name: run.file[name] for name in _OF_A_FILE},
        "warnings": [*(run.file or {}).get("warnings", ()), *notice_items(warnings)],
        "fits": fit_items(levels, cofs),
        "loops": loop_items(loops),
        "engagement": None if engagement is None else engagement_item(engagement),
        "duty": run.details.get("duty"),
        "event": run.details.get("event"),
        "note": run.details.get("note"),
        "code_version": CODE_VERSION,
    }


def fit_items(levels: Sequence[LevelFit], cofs: ByPressure) -> list[dict[str, Any]]:
    """The fits of a test as a receipt shows them, each with its mean COF where it determines one."""
    return [_fit_item(level.fit, cofs.get(level.fit.pressure)) for level in levels]


def loop_items(loops: Sequence[Loop]) -> list[dict[str, Any]]:
    """The loops of a dynamic test as a receipt shows them; what the record does not determine is null."""
    return [_loop_item(loop) for loop in loops]


def notice_items(notices: Sequence[Notice]) -> list[dict[str, str]]:
    """Warnings in the public shape."""
    return [{"code": notice.code, "message": notice.message} for notice in notices]


def _fit_item(fit: StribeckFit, cof: Value | None) -> dict[str, Any]:
    names = [public for public, _ in PARAMETER_UNITS.values()]
    return {
        "pressure_bar": bar(fit.pressure),
        "parameters": dict(zip(names, map(float, fit.parameters.as_array()), strict=True)),
        "standard_errors": dict(zip(names, map(float, fit.covariance.diagonal() ** 0.5), strict=True)),
        "mse_percent": fit.mse_percent,
        "rmse_nm": fit.rmse,
        "noise_nm": fit.noise,
        "acceptable": fit.acceptable,
        "mean_cof": None if cof is None else cof[0],
        "mean_cof_sd": None if cof is None else cof[1],
        "points": fit.points,
        "status": fit.status.value,
        "undetermined": [PARAMETER_UNITS[name][0] for name in fit.undetermined],
        "message": fit.message,
    }


def _loop_item(loop: Loop) -> dict[str, Any]:
    return {
        "pressure_bar": bar(loop.pressure),
        "loop_area_nm_m_s": loop.area,
        "loop_area_sd_nm_m_s": loop.area_sd,
        "attractor_nm_s": loop.attractor,
        "attractor_sd_nm_s": loop.attractor_sd,
        "film_time_s": loop.film_time,
        "film_time_sd_s": loop.film_time_sd,
        "frequency_hz": loop.frequency,
        "periods": loop.periods,
        "direction": str(loop.direction.value),
        "better_law": loop.better_law,
        "status": loop.status.value,
        "message": loop.message,
    }


def insufficient(assumptions: Assumptions, cycles: float | None, pressure: float, fraction: float) -> dict[str, Any]:
    """The answer where nothing can be predicted: `insufficient_data`."""
    return {
        "as_of_cycles": None if cycles is None else whole(cycles),
        "runs_used": 0,
        "status": INSUFFICIENT,
        "criterion": _criterion(fraction, pressure, None, None),
        "current": {"mean_cof": None, "mean_cof_sd": None, "fraction_of_initial": None, "health": None},
        "remaining_cycles": by_quantile({}),
        "end_of_life_cycles": by_quantile({}),
        "probability_of_reaching": None,
        "course": None,
        "back_cast": {"held": 0, "of": 0, "widening": 1.0},
        "ended_lives": 0,
        "sample": None,
        "horizon_cycles": whole(HORIZON),
        "warnings": [],
    } | assumptions.named()


def predicted(
    passage: FirstPassage,
    assumptions: Assumptions,
    series: Series,
    cycles: float,
    fraction: float,
    *,
    runs: int,
    enough: bool,
    courses: Sequence[CourseShare],
    back_cast: BackCast,
    ended_lives: int,
    sample: Mapping[str, Any],
    warnings: Sequence[Notice],
) -> dict[str, Any]:
    """A first passage in ζ, led back to cycles; without `enough` tests only where the clutch stands."""
    mean, deviation = max(0.0, passage.current[0]), passage.current[1]
    left = mean / passage.initial if passage.initial > 0 else None
    present = {
        "runs_used": runs,
        "criterion": _criterion(fraction, series.pressure, passage.initial, passage.threshold),
        "current": {
            "mean_cof": mean,
            "mean_cof_sd": deviation,
            "fraction_of_initial": left,
            "health": None if left is None else min(1.0, max(0.0, (left - fraction) / (1 - fraction))),
        },
        "warnings": notice_items([*warnings, *((*not_eq_6(courses), *missed(back_cast)) if enough else ())]),
    }
    ends = {q: None if zeta is None else float(series.scale.cycles(zeta)) for q, zeta in passage.end_of_life.items()}
    future = {
        "status": passage.status.value,
        "remaining_cycles": by_quantile(
            {q: None if end is None else max(0.0, end - cycles) for q, end in ends.items()}
        ),
        "end_of_life_cycles": by_quantile(ends),
        "probability_of_reaching": passage.probability_of_reaching,
        "back_cast": {"held": back_cast.held, "of": back_cast.misses.size, "widening": back_cast.widening},
        "ended_lives": ended_lives,
        "sample": sample,
        "course": _course_item(courses[0]) | {"alternatives": [_course_item(share) for share in courses[1:]]},
    }
    return insufficient(assumptions, cycles, series.pressure, fraction) | present | (future if enough else {})


def _course_item(share: CourseShare) -> dict[str, Any]:
    return {"name": share.name.value, "probability": share.probability, "order": share.order}


def history_warnings(
    lives: Sequence[Life], off_track: Mapping[str, list[dict[str, str]]], *, run_id: str | None = None
) -> dict[str, list[dict[str, str]]]:
    """run_id -> the warnings of every run in its history, or of one; `off_track` are those of predictions after tests."""
    latest = latest_before([event for life in lives for event in life.events])
    return {
        event.run_id: [
            *notice_items(late_arrival(event.cycles, latest[event.run_id])),
            *notice_items(other_pressures(life.reference, event.cofs)),
            *notice_items(other_oil(life, event)),
            *off_track.get(event.run_id, ()),
        ]
        for life in lives
        for event in life.events
        if run_id is None or event.run_id == run_id
    }


def warned_anew(
    lives: Sequence[Life], off_track: Mapping[str, list[dict[str, str]]], receipts: Mapping[str, dict[str, Any]]
) -> dict[str, dict[str, Any]]:
    """The receipts whose warnings of the history change."""
    changed = {}
    for run_id, noticed in history_warnings(lives, off_track).items():
        before = receipts[run_id]["warnings"]
        after = [warning for warning in before if warning["code"] not in OF_HISTORY] + noticed
        if after != before:
            changed[run_id] = receipts[run_id] | {"warnings": after}
    return changed


def summary_of(payload: dict[str, Any]) -> tuple[dict[str, Any], float]:
    """What a list shows of a clutch, and its rank: the fewer cycles remain, the earlier in the list."""
    median = payload["remaining_cycles"]["0.5"]
    remaining = HORIZON if median is None else float(median)
    rank = RANK_UNKNOWN if payload["status"] == INSUFFICIENT else remaining
    return {name: payload[name] for name in SUMMARY}, rank


def state_of(summary: Mapping[str, Any], *, disputed: bool) -> dict[str, str]:
    """A clutch's state after NAMUR NE 107 by its summary, and why; `disputed`: its newest diagnosis found that data and
    model disagree, and nobody has acted on it. Its name is stored: another rule here needs a step of storage/migrations."""
    if summary.get("status", INSUFFICIENT) == INSUFFICIENT:
        return {"name": CHECK, "why": "fewer than three tests: no prognosis yet"}
    if summary["status"] == "reached":
        return {"name": FAILURE, "why": "end of life reached"}
    if disputed:
        return {"name": OUT_OF_SPECIFICATION, "why": "data and model disagree: see the diagnosis"}
    health = summary["current"]["health"]
    if health is not None and health < LOW_HEALTH:
        return {"name": MAINTENANCE, "why": "near the end of its life"}
    never = summary["status"] == "may_never_reach"
    return {"name": NORMAL, "why": "may never reach end of life" if never else "ageing as modelled"}


def recent(events: Sequence[Event], series: Series) -> dict[str, Any]:
    """The run that was made last, and mean COF [-] of the present life as a short line, thinned evenly, its last value kept.

    `events` is not empty; `series` is mean COF over the reference pressures, ordered by cycles.
    """
    last = max(events, key=lambda event: event.moment)
    values = [measurement.value for measurement in series.measurements]
    step = -(-len(values) // MOST_LINE_POINTS)  # rounded up
    return {
        "last_run": {
            "run_id": last.run_id,
            "kind": last.kind,
            "cycles": whole(last.cycles),
            "at": datetime.fromtimestamp(last.moment, UTC).isoformat(timespec="seconds"),
        },
        "mean_cof": [round(value, 6) for value in values[::-1][:: step or 1]][::-1],
    }


def _criterion(fraction: float, pressure: float, initial: float | None, threshold: float | None) -> dict[str, Any]:
    return {
        "quantity": MEAN_COF,
        "fraction": fraction,
        "initial_mean_cof": initial,
        "threshold_mean_cof": threshold,
        "pressure_bar": None if pressure == ALL_PRESSURES else bar(pressure),
    }


def by_quantile(values: Mapping[float, float | None]) -> dict[str, float | None]:
    """A number by quantile, in the public shape; null where there is none."""
    return {f"{quantile:g}": values.get(quantile) for quantile in QUANTILES}
