"""The friction loops of dynamic tests, each against the stationary curves of the clutch's state at that time."""

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import Connection

from models.arrays import FloatArray
from models.clutch import Geometry
from models.loops.dynamic_test import Loop, evaluate_loops
from models.loops.lag_fit import StationaryCurve
from service import records
from service.lives.history import Event, lives
from service.lives.incoming_run import sampled_record
from service.lives.receipt import bar
from service.lives.run_analysis import FEWEST_SPEEDS
from storage import channels, runs

DYNAMIC = "dynamic_stribeck"


def loops_of(
    connection: Connection,
    clutch_id: str,
    events: Sequence[Event],
    event: Event,
    columns: Mapping[str, FloatArray],
    geometry: Geometry,
) -> list[dict[str, Any]]:
    """A dynamic test's loops as its receipt shows them, with the lag against its stationary test's curves.

    A curve of which some parameter is undetermined is one all the same: what its covariance leaves open makes the lag
    less certain, or unresolved.
    """
    test = stationary_test_of(events, event)
    levels = [] if test is None else records.levels(connection, clutch_id).get(test.run_id, [])
    curves = {
        level.fit.pressure: StationaryCurve(parameters=level.fit.parameters, covariance=level.fit.covariance)
        for level in levels
        if level.speeds >= FEWEST_SPEEDS
    }
    return [loop_receipt(loop) for loop in evaluate_loops(sampled_record(columns), geometry, curves or None)]


def stationary_test_of(events: Sequence[Event], event: Event) -> Event | None:
    """The stationary test that shows the clutch's state at a dynamic test: the last one up to its cycles, else the next."""
    life = next(life for life in lives(events) if event in life.events)
    tests = [each for each in life.events if each.speed_range is not None]
    before = [each for each in tests if each.cycles <= event.cycles]
    return before[-1] if before else (tests[0] if tests else None)


def refresh_loops(
    connection: Connection, clutch_id: str, events: Sequence[Event], geometry: Geometry, *, since: Event | None = None
) -> None:
    """Evaluate stored dynamic tests anew: all, or those whose stationary test is `since`."""
    for event in events:
        if event.kind != DYNAMIC or (since is not None and stationary_test_of(events, event) is not since):
            continue
        row = records.run(connection, clutch_id, event.run_id)
        found = loops_of(connection, clutch_id, events, event, channels.read(connection, row.run_key), geometry)
        runs.set_results(connection, row.run_key, row.details, row.receipt | {"loops": found}, row.code_version)


def loop_receipt(loop: Loop) -> dict[str, Any]:
    """One loop as a receipt shows it; what the record cannot tell is null."""
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
