"""Bring a clutch's stored tracks, predictions and summary up to date with its history."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection

from models.prognosis.criteria import HORIZON
from models.tracking.filters.particle import ParticleState
from models.tracking.filters.ukf import UkfState
from service import records
from service.lives.assumptions import ALL_PRESSURES, Basis, basis_of
from service.lives.history import Event, Life, lives
from service.lives.prediction import INSUFFICIENT
from service.lives.recent import recent
from service.lives.tracks import CARRIED, Prediction, States, Tracked, follow
from service.settings import CODE_VERSION
from storage import clutches, filter_states, predictions
from storage.clutches import ClutchRow
from storage.filter_states import FilterStateRow
from storage.predictions import PredictionRow

#: What a list shows of a clutch, out of the particle filter's prediction.
SUMMARY = ("status", "as_of_cycles", "current", "remaining_cycles", "model")
#: A clutch of which nothing can be said comes after all others.
RANK_UNKNOWN = 2 * HORIZON
_STATES: dict[str, type[ParticleState] | type[UkfState]] = {"particle": ParticleState, "ukf": UkfState}


def retrack(
    connection: Connection, clutch: ClutchRow, events: Sequence[Event], *, newest: Event | None = None
) -> list[dict[str, Any]]:
    """Track anew what the ordered history asks for: one step where `newest` comes last, else all of it.

    Returns the warnings of what is foretold after the last event.
    """
    if not events:
        return []
    fraction = records.record(clutch).end_of_life.cof_fraction
    basis = basis_of(connection, clutch)
    found = lives(events)
    states = None if newest is None else _carried(connection, clutch.clutch_id, found[-1], basis, newest)
    walks: list[tuple[Life, States, int]]
    if states is None:
        predictions.clear(connection, clutch.clutch_id)
        walks = [(life, {}, 0) for life in found]
    else:
        walks = [(found[-1], states, len(found[-1].events) - 1)]
    said: dict[tuple[float, str], Prediction] = {}
    last: States = {}
    for life, start, first_event in walks:
        for states_then, foretold in follow(clutch.clutch_id, life, basis, fraction, start, first_event=first_event):
            last = states_then
            said |= {(each.cycles, each.method): each for each in foretold}
    _write(connection, clutch.clutch_id, list(said.values()), last)
    at_last = said[events[-1].cycles, "particle"].payload
    summary, rank = _summarise(at_last)
    summary |= {"runs": len(events), "recent": recent(events, found[-1].pooled(basis)), "life": found[-1].name}
    clutches.set_summary(connection, clutch.clutch_id, rank, summary)
    return list(at_last["warnings"])


def _carried(connection: Connection, clutch_id: str, life: Life, basis: Basis, newest: Event) -> States | None:
    """The stored states from before `newest`, or None where one step on from them would not give the whole truth."""
    last = life.events[-1]
    is_test = newest.speed_range is not None
    if newest.rebuild or newest not in life.events or (newest is not last and (is_test or newest.cycles < last.cycles)):
        return None
    if newest is not last and newest.shift:
        return None
    index = life.events.index(newest)
    before = sum(1 for event in life.pooled(basis).events if event != index)
    rows = {method: row for (method, _), row in filter_states.get(connection, clutch_id).items()}
    if rows.keys() != (set(CARRIED) if before else set()):
        return None
    if any(row.runs != before or row.code_version != CODE_VERSION for row in rows.values()):
        return None
    return {method: _tracked(method, row) for method, row in rows.items()}


def _tracked(method: str, row: FilterStateRow) -> Tracked:
    """A stored filter's states: the arrays of each are named after what was believed, as in `weak/mean`."""
    by_belief: dict[str, dict[str, NDArray[np.float64]]] = {}
    for name, array in row.arrays.items():
        belief, _, part = name.partition("/")
        by_belief.setdefault(belief, {})[part] = array
    return Tracked(
        runs=row.runs, states={belief: _STATES[method].from_arrays(arrays) for belief, arrays in by_belief.items()}
    )


def _write(connection: Connection, clutch_id: str, said: Sequence[Prediction], states: States) -> None:
    rows = [
        PredictionRow(
            cycles=each.cycles,
            method=each.method,
            pressure=ALL_PRESSURES,
            payload=each.payload,
            code_version=CODE_VERSION,
        )
        for each in said
    ]
    predictions.put(connection, clutch_id, rows)
    filter_states.clear(connection, clutch_id)
    carried = [
        FilterStateRow(
            method=method,
            pressure=ALL_PRESSURES,
            runs=tracked.runs,
            arrays={
                f"{belief}/{name}": array
                for belief, state in tracked.states.items()
                for name, array in state.to_arrays().items()
            },
            code_version=CODE_VERSION,
        )
        for method, tracked in states.items()
    ]
    filter_states.put(connection, clutch_id, carried)


def _summarise(payload: dict[str, Any]) -> tuple[dict[str, Any], float]:
    """What a list shows of a clutch, and its rank: the fewer cycles remain, the earlier in the list."""
    median = payload["remaining_cycles"]["0.5"]
    known = HORIZON if median is None else float(median)
    rank = RANK_UNKNOWN if payload["status"] == INSUFFICIENT else known
    return {name: payload[name] for name in SUMMARY}, rank
