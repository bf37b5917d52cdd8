"""`/remaining-useful-life`: a stored prediction, or one computed from the clutch's state where none is stored."""

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

from service import measured_lives, records, stored_runs
from service.errors import NotFoundError
from service.lives.assumptions import ALL_PRESSURES
from service.lives.condition import beside_held
from service.lives.outlook import with_held
from service.lives.prediction_at import predict_at
from service.lives.recomputation import ClutchState
from service.lives.tracks import CARRIED
from storage import clutches, results
from storage.engine.database import Database

#: What `criteria_of` says of a clutch whose life ends by mean COF alone.
NO_CRITERIA = b"[]"
#: What a criterion says of itself.
_GIVEN = ("quantity", "pressure_bar", "speed_rpm", "frequency_hz", "fraction", "below", "above")


def criteria_of(database: Database, clutch_id: str) -> bytes:
    """The criteria of a clutch's record as a JSON array, empty where mean COF alone counts. Raises NotFoundError."""
    with database.reading() as connection:
        row = clutches.get(connection, clutch_id)
    if row is None:
        raise NotFoundError(f"no clutch is known as {clutch_id!r}")
    return json.dumps(row.record["end_of_life"].get("criteria", [])).encode()


def remaining_life(
    database: Database, clutch_id: str, method: str, pressure_bar: float | None, at_cycles: float | None
) -> dict[str, Any]:
    """The remaining useful life as it is now, or as it would have been predicted at `at_cycles`.

    The carried filters' predictions over all pressures are stored; those of the exact filter and at one pressure are
    computed. Raises NotFoundError for an unknown clutch or a pressure that its first stationary test did not measure.
    """
    with database.reading() as connection:
        row = clutches.get(connection, clutch_id)
        if row is None:
            raise NotFoundError(f"no clutch is known as {clutch_id!r}")
        stored = (
            results.prediction_at(connection, clutch_id, method, ALL_PRESSURES, at_cycles)
            if pressure_bar is None
            else None
        )
        carried_on = pressure_bar is None and at_cycles is None
        state = records.state(connection, clutch_id, carried=carried_on) if stored is None else None
    head = {
        "clutch_id": clutch_id,
        "method": method,
        "revision": row.revision,
        "origin": row.record.get("origin", "measured"),  # earlier releases stored none
    }
    now = at_cycles is None or at_cycles >= row.summary.get("as_of_cycles", math.inf)
    summary = row.summary if now else {}
    if stored is not None:
        payload, among = stored.payload, (summary.get("with_held") or {}).get(method)
    elif state is None:
        raise AssertionError("a prediction is stored, or the state was loaded")
    else:
        payload = _predicted(state, method, pressure_bar, at_cycles)
        among = _with_held(database, state, method, pressure_bar) if state.held and now else None
    answer = head | payload | beside_held(payload, summary, among)
    return answer | {"criteria": _criteria(payload)}


def _predicted(state: ClutchState, method: str, pressure_bar: float | None, at_cycles: float | None) -> dict[str, Any]:
    carried = (state.filters or {}).get(CARRIED[0])
    return predict_at(
        state.clutch_id,
        state.events,
        state.assumptions(),
        state.fraction,
        method=method,
        pressure_bar=pressure_bar,
        at_cycles=at_cycles,
        back_cast=None if carried is None else carried.back_cast,
    )


def _with_held(database: Database, state: ClutchState, method: str, pressure_bar: float | None) -> dict[str, Any]:
    """The same with the held runs, where it is not stored."""
    evidence = measured_lives.evidence_for(database, state, stored_runs.run_reader(database, state.clutch_id))
    if evidence is None:
        raise AssertionError("runs are held: the evidence was loaded")
    return _predicted(with_held(state, evidence), method, pressure_bar, None)


def _criteria(payload: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The one criterion of a stored prediction, as `criteria` lists it: mean COF, which is surely the first."""
    criterion, current = payload["criterion"], payload["current"]
    given = {name: criterion.get(name) for name in _GIVEN}
    return [
        given
        | {"initial": criterion["initial_mean_cof"], "limit": criterion["threshold_mean_cof"]}
        | {name: payload[name] for name in ("end_of_life_cycles", "remaining_cycles", "probability_of_reaching")}
        | {"current": {"value": current["mean_cof"], "sd": current["mean_cof_sd"]}}
        | {"probability_first": 1.0, "tests": payload["runs_used"]}
    ]


def rows(payload: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The quantiles as rows of a table."""
    held = payload["held_runs"]
    for quantile, remaining in payload["remaining_cycles"].items():
        yield {
            "as_of_cycles": payload["as_of_cycles"],
            "status": payload["status"],
            "quantile": quantile,
            "remaining_cycles": remaining,
            "end_of_life_cycles": payload["end_of_life_cycles"][quantile],
            "at_least": payload["at_least"],
            "held_runs": 0 if held is None else held["count"],
            "remaining_cycles_with_held": None if held is None else held["remaining_cycles"][quantile],
        }


COLUMNS = (
    "as_of_cycles",
    "status",
    "quantile",
    "remaining_cycles",
    "end_of_life_cycles",
    "at_least",
    "held_runs",
    "remaining_cycles_with_held",
)
