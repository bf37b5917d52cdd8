"""`/stribeck`: the curves of the stationary tests, and the pressure laws through them (fig. 9). `/surfaces` (figs. 10, 11):
the parameters as their tracks have them over cycles, the pressure laws going through them, and torque over speed."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.criteria import FEWEST_PRESSURES
from models.friction.pressure_laws import (
    LinearPressureLaw,
    PressureLaws,
    fit_pressure_laws,
    law_covariances,
    over_pressure,
)
from models.friction.stribeck import PARAMETER_NAMES, StribeckParameters, torque
from models.prognosis.criteria import FEWEST_TESTS
from service import repository
from service.channels import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, bar, whole
from service.clutch.analysis import LevelFit
from service.clutch.assumptions import Assumptions
from service.clutch.condition import held_runs_left_out
from service.clutch.items import PARAMETER_UNITS
from service.clutch.quantities.measured import parameter_medians
from service.clutch.timeline import Event, lives_of
from service.errors import NotFoundError
from service.paging import Part, by_cycles
from storage import runs
from storage.engine.database import Database
from storage.runs import RunRow


def curves(database: Database, clutch_id: str, part: Part) -> dict[str, Any]:
    """Stationary tests by cycles with their fits and pressure laws, of the open clutch neither. Raises NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, limit=part.most, after=part.after, fitted=True, state=runs.ACCEPTED)
        levels = repository.levels(connection, clutch_id)
        held_count = runs.held(connection, [clutch_id]).get(clutch_id, 0)
    tests = part.of(rows, by_cycles("run_id"), lambda row: _item(row, levels.get(row.run_id, [])))
    return held_runs_left_out(held_count) | tests  # the next page last, where it is found


def rows(payload: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for item in payload["items"]:
        for fit in item["fits"]:
            plain = {name: fit[name] for name in fit if name not in ("parameters", "standard_errors", "undetermined")}
            errors = {f"{name}_se": value for name, value in fit["standard_errors"].items()}
            yield {"run_id": item["run_id"], "cycles": item["cycles"], **plain, **fit["parameters"], **errors} | {
                "held_runs": payload["held_runs"]
            }


def _item(row: RunRow, levels: Sequence[LevelFit]) -> dict[str, Any]:
    fits = [level.fit for level in levels]
    laws = fit_pressure_laws(fits)
    return {
        "run_id": row.run_id,
        "cycles": whole(row.cycles),
        "fits": row.receipt["fits"],
        "pressure_laws": None if laws is None else _laws(laws, law_covariances(fits, laws)),
    }


def _laws(laws: PressureLaws, covariances: Mapping[str, FloatArray]) -> dict[str, Any]:
    """The pressure laws in bar, by public name."""
    items: dict[str, Any] = {}
    for name, (public, _) in PARAMETER_UNITS.items():
        law = getattr(laws, name)
        if isinstance(law, LinearPressureLaw):
            items[public] = {"intercept": law.intercept, "slope_per_bar": law.slope * PASCALS_PER_BAR}
            in_bar = np.array([1.0, PASCALS_PER_BAR])
        else:
            items[public] = {"asymptote": law.asymptote, "excess": law.excess, "decay_bar": law.decay / PASCALS_PER_BAR}
            in_bar = np.array([1.0, 1.0, 1.0 / PASCALS_PER_BAR])
        items[public]["covariance"] = (covariances[name] * np.outer(in_bar, in_bar)).tolist()
    return items


#: Places along cycles, pressure and speed.
CYCLES, PRESSURES, SPEEDS = 15, 13, 20


def surface(database: Database, clutch_id: str) -> dict[str, Any]:
    """`/surfaces` of a clutch as it is now. Raises NotFoundError."""
    with database.reading() as connection:
        state, levels = repository.state(connection, clutch_id), repository.levels(connection, clutch_id)
    assumptions = state.assumptions()
    grids = surfaces(state.events, assumptions, levels, state.geometry)
    head = {"clutch_id": clutch_id, "revision": state.revision}
    return head | held_runs_left_out(len(state.held)) | grids | assumptions.named()


def surfaces(
    events: Sequence[Event], assumptions: Assumptions, fits: Mapping[str, Sequence[LevelFit]], geometry: Geometry
) -> dict[str, Any]:
    """Parameters over cycles [k] by pressure [p], torque over cycles, pressure and speed [v], of the present life; with too
    few tests for a track at the cycles of these alone. Raises NotFoundError before a test determines all parameters."""
    history = lives_of(events)
    speed_range = history[-1].speed_range if history else None
    if speed_range is None:
        raise NotFoundError("there are no surfaces, because this life has no stationary test: send one")
    life = history[-1]
    tested = np.unique([event.cycles for event in life.events if event.cofs])
    enough = tested.size >= FEWEST_TESTS  # fewer say nothing of what lies between or behind them
    cycles = np.linspace(life.origin, life.events[-1].cycles, CYCLES) if enough else tested
    levels, tracked = parameter_medians(life, assumptions, fits, cycles)
    if not levels:
        raise NotFoundError(
            "there are no surfaces, because no test determines all four Stribeck parameters: send one over more speeds"
        )
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


def surface_rows(grids: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The surfaces as rows of a table, a row a count of cycles, a pressure and a speed."""
    return [
        {"cycles": cycles, "pressure_bar": pressure, "speed_rpm": speed}
        | {name: grid[i][j] for name, grid in grids["parameters"].items()}
        | {"torque_nm": grids["torque_nm"][i][j][k], "held_runs": grids["held_runs"]}
        for i, cycles in enumerate(grids["cycles"])
        for j, pressure in enumerate(grids["pressure_bar"])
        for k, speed in enumerate(grids["speed_rpm"])
    ]
