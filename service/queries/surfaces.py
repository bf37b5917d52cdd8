"""Surfaces over pressure and cycles (figs. 10, 11): Stribeck parameters as their tracks have them, torque over speed.

At every count of cycles each parameter's eq. 6 gives its median at the reference pressures, and the pressure laws of fig. 9
go through them; with fewer than three pressures the surface is at the measured ones alone.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.criteria import FEWEST_PRESSURES
from models.friction.pressure_laws import over_pressure
from models.friction.stribeck import PARAMETER_NAMES, StribeckParameters, torque
from models.prognosis.criteria import FEWEST_TESTS
from models.prognosis.first_passage import weighted_quantiles
from service import records
from service.columns import RADIANS_PER_SECOND_PER_RPM, bar, whole
from service.errors import NotFoundError
from service.lives.assumptions import Assumptions
from service.lives.condition import held_runs_left_out
from service.lives.history import Event, lives_of
from service.lives.payloads import PARAMETER_UNITS
from service.lives.quantities.measured import Track, parameter_tracks, tests_of
from service.lives.run_analysis import LevelFit
from storage.engine.database import Database

#: Places along cycles, pressure and speed.
CYCLES, PRESSURES, SPEEDS = 15, 13, 20


def surface(database: Database, clutch_id: str) -> dict[str, Any]:
    """`/surfaces` of a clutch as it is now. Raises NotFoundError."""
    with database.reading() as connection:
        state, levels = records.state(connection, clutch_id), records.levels(connection, clutch_id)
    assumptions = state.assumptions()
    grids = surfaces(state.events, assumptions, levels, state.geometry)
    head = {"clutch_id": clutch_id, "revision": state.revision}
    return head | held_runs_left_out(len(state.held)) | grids | assumptions.named()


def surfaces(
    events: Sequence[Event], assumptions: Assumptions, fits: Mapping[str, Sequence[LevelFit]], geometry: Geometry
) -> dict[str, Any]:
    """Parameters over cycles [k] by pressure [p], torque over cycles, pressure and speed [v], of the present life; with too
    few tests for a track at the cycles of these alone.

    Raises NotFoundError before the first stationary test that determines all four parameters.
    """
    history = lives_of(events)
    speed_range = history[-1].speed_range if history else None
    if speed_range is None:
        raise NotFoundError("there are no surfaces, because this life has no stationary test: send one")
    life = history[-1]
    tracks = parameter_tracks(life, assumptions, tests_of(life, fits))
    levels = sorted(level for level in life.reference if all((name, level) in tracks for name in PARAMETER_NAMES))
    if not levels:
        raise NotFoundError(
            "there are no surfaces, because no test determines all four Stribeck parameters: send one over more speeds"
        )
    tested = np.unique([event.cycles for event in life.events if event.cofs])
    enough = tested.size >= FEWEST_TESTS  # fewer say nothing of what lies between or behind them
    cycles = np.linspace(life.origin, life.events[-1].cycles, CYCLES) if enough else tested
    tracked = np.array([[_medians(tracks[name, level], cycles) for level in levels] for name in PARAMETER_NAMES])
    pressures = np.array(levels)
    if len(levels) >= FEWEST_PRESSURES:
        pressures = np.linspace(levels[0], levels[-1], PRESSURES)
        tracked = np.array(
            [
                over_pressure(name, np.array(levels), row, pressures)
                for name, row in zip(PARAMETER_NAMES, tracked, strict=True)
            ]
        )
    surface = np.maximum(np.swapaxes(tracked, 1, 2), 0.0)
    speed = np.linspace(*speed_range, SPEEDS)
    parameters = StribeckParameters.from_array(surface[..., None])
    torques = torque(geometry.sliding_velocity(speed), parameters)
    return {
        "cycles": [whole(round(cycle, 3)) for cycle in cycles.tolist()],
        "pressure_bar": [bar(pressure) for pressure in pressures.tolist()],
        "speed_rpm": (speed / RADIANS_PER_SECOND_PER_RPM).round(6).tolist(),
        "parameters": {
            PARAMETER_UNITS[name][0]: grid.tolist() for name, grid in zip(PARAMETER_NAMES, surface, strict=True)
        },
        "torque_nm": torques.tolist(),
    }


def rows(grids: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The surfaces as rows of a table, a row a count of cycles, a pressure and a speed."""
    return [
        {"cycles": cycles, "pressure_bar": pressure, "speed_rpm": speed}
        | {name: grid[i][j] for name, grid in grids["parameters"].items()}
        | {"torque_nm": grids["torque_nm"][i][j][k], "held_runs": grids["held_runs"]}
        for i, cycles in enumerate(grids["cycles"])
        for j, pressure in enumerate(grids["pressure_bar"])
        for k, speed in enumerate(grids["speed_rpm"])
    ]


def _medians(track: Track, cycles: FloatArray) -> list[float]:
    series, posterior = track
    values = posterior.values(series.scale.progress(cycles))
    return [float(weighted_quantiles(row, posterior.weight, (0.5,))[0]) for row in values]
