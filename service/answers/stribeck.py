"""`/stribeck`: the curves of the stationary tests, and the pressure laws through them (fig. 9). `/surfaces` (figs. 10, 11):
the parameters as their tracks have them over cycles, the pressure laws going through them, and torque over speed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.criteria import FEWEST_PRESSURES
from models.friction.pressure_laws import (
    AsymptoticPressureLaw,
    LinearPressureLaw,
    PressureLaws,
    fit_pressure_laws,
    law_covariances,
    over_pressure,
)
from models.friction.stribeck import PARAMETER_NAMES, StribeckParameters, torque
from models.prognosis.criteria import FEWEST_TESTS
from service import repository
from service.api.over_life import (
    AsymptoticLaw,
    LinearLaw,
    PressureLawsOut,
    StribeckItem,
    StribeckPage,
    SurfaceParameters,
    Surfaces,
)
from service.api.run import Fit
from service.channels import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, bar, whole
from service.clutch.analysis import LevelFit
from service.clutch.assumptions import Assumptions, severity_name
from service.clutch.condition import held_runs_left_out
from service.clutch.items import PARAMETER_UNITS
from service.clutch.quantities.measured import parameter_medians
from service.clutch.timeline import Life
from service.errors import NotFoundError
from service.paging import Part, by_cycles, to_cursor
from service.tables import Cells, cells
from storage import runs
from storage.engine.database import Database
from storage.runs import RunRow


def curves(database: Database, clutch_id: str, part: Part) -> StribeckPage:
    """A page of stationary tests by cycles with fits and pressure laws; tests of the open clutch have neither. Raises
    NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, limit=part.most, after=part.after, fitted=True, state=runs.ACCEPTED)
        levels = repository.levels(connection, clutch_id)
        held_count = runs.held(connection, [clutch_id]).get(clutch_id, 0)
    return StribeckPage(
        held_runs=held_count,
        warnings=held_runs_left_out(held_count),
        items=[_item(row, levels.get(row.run_id, [])) for row in rows[: part.limit]],
        next=to_cursor(part.next(rows, by_cycles("run_id"))),
    )


def rows(page: StribeckPage) -> Iterator[Cells]:
    """Fitted curves as rows of a table, one row per test and pressure."""
    names = [name for name in Fit.model_fields if name not in ("parameters", "standard_errors", "undetermined")]
    for item in page.items:
        for fit in item.fits:
            errors = {f"{name}_se": value for name, value in fit.standard_errors}
            own = cells(fit, names) | dict(fit.parameters) | errors
            yield {"run_id": item.run_id, "cycles": item.cycles} | own | {"held_runs": page.held_runs}


def _item(row: RunRow, levels: Sequence[LevelFit]) -> StribeckItem:
    """The fitted curves of one test, with the pressure laws through them."""
    fits = [level.fit for level in levels]
    laws = fit_pressure_laws(fits)
    return StribeckItem(
        run_id=row.run_id,
        cycles=whole(row.cycles),
        fits=row.receipt["fits"],
        pressure_laws=None if laws is None else _laws(laws, law_covariances(fits, laws)),
    )


def _laws(laws: PressureLaws, covariances: Mapping[str, FloatArray]) -> PressureLawsOut:
    """The pressure laws in bar, by their names in the answer."""
    return PressureLawsOut.model_validate(
        {public: _law(getattr(laws, name), covariances[name]) for name, (public, _) in PARAMETER_UNITS.items()}
    )


def _law(law: LinearPressureLaw | AsymptoticPressureLaw, covariance: FloatArray) -> LinearLaw | AsymptoticLaw:
    """A pressure law in bar, with the covariance of its coefficients."""
    if isinstance(law, LinearPressureLaw):
        in_bar = np.array([1.0, PASCALS_PER_BAR])
        own = (covariance * np.outer(in_bar, in_bar)).tolist()
        return LinearLaw(intercept=law.intercept, slope_per_bar=law.slope * PASCALS_PER_BAR, covariance=own)
    in_bar = np.array([1.0, 1.0, 1.0 / PASCALS_PER_BAR])
    own = (covariance * np.outer(in_bar, in_bar)).tolist()
    return AsymptoticLaw(
        asymptote=law.asymptote, excess=law.excess, decay_bar=law.decay / PASCALS_PER_BAR, covariance=own
    )


#: Places along cycles, pressure and speed.
CYCLES, PRESSURES, SPEEDS = 15, 13, 20


def surface(database: Database, clutch_id: str) -> Surfaces:
    """The answer to `/surfaces` of the present life. Raises NotFoundError."""
    with database.reading() as connection:
        state, levels = repository.state(connection, clutch_id), repository.levels(connection, clutch_id)
    assumptions = state.assumptions
    grids = surface_grids(state.lives, assumptions, levels, state.geometry)
    return Surfaces(
        clutch_id=clutch_id,
        revision=state.revision,
        held_runs=len(state.held),
        warnings=held_runs_left_out(len(state.held)),
        cycles=[whole(round(cycle, 3)) for cycle in grids.cycles.tolist()],
        pressure_bar=[bar(pressure) for pressure in grids.pressure.tolist()],
        speed_rpm=(grids.speed / RADIANS_PER_SECOND_PER_RPM).round(6).tolist(),
        parameters=SurfaceParameters(
            **{
                PARAMETER_UNITS[name][0]: grid.tolist()
                for name, grid in zip(PARAMETER_NAMES, grids.parameters, strict=True)
            }
        ),
        torque_nm=grids.torque.tolist(),
        model=assumptions.model.name,
        prior=assumptions.prior.name,
        severity=severity_name(assumptions.severity),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceGrids:
    """Grids of parameters [4, k, p] over cycles [k] and pressure [p, Pa], and of torque [k, p, v, Nm], also over speed
    [v, rad/s]."""

    cycles: FloatArray
    pressure: FloatArray
    speed: FloatArray
    parameters: FloatArray
    torque: FloatArray


def surface_grids(
    lives: Sequence[Life], assumptions: Assumptions, fits: Mapping[str, Sequence[LevelFit]], geometry: Geometry
) -> SurfaceGrids:
    """Parameters over cycles [k] and pressure [p], and torque also over speed [v], of the present life; with too few
    tests for a track, at the tests' own cycles. Raises NotFoundError before a test determines all parameters."""
    speed_range = lives[-1].speed_range if lives else None
    if speed_range is None:
        raise NotFoundError("there are no surfaces, because this life has no stationary test: send one")
    life = lives[-1]
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
    return SurfaceGrids(cycles=cycles, pressure=pressures, speed=speed, parameters=surface, torque=torques)


def surface_rows(answer: Surfaces) -> Iterator[Cells]:
    """The surfaces as rows of a table, one row per cycles, pressure and speed."""
    for i, cycles in enumerate(answer.cycles):
        for j, pressure in enumerate(answer.pressure_bar):
            for k, speed in enumerate(answer.speed_rpm):
                place = {"cycles": cycles, "pressure_bar": pressure, "speed_rpm": speed}
                parameters = {name: grid[i][j] for name, grid in answer.parameters}
                yield place | parameters | {"torque_nm": answer.torque_nm[i][j][k], "held_runs": answer.held_runs}
