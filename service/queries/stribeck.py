"""`/stribeck`: the curves of the stationary tests, and the pressure laws through them (fig. 9)."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.friction.pressure_laws import LinearLaw, PressureLaws, fit_pressure_laws, law_covariances
from service import records
from service.columns import PASCALS_PER_BAR, whole
from service.lists import Part, by_cycles
from service.lives.condition import held_runs_left_out
from service.lives.payloads import PARAMETER_UNITS
from service.lives.run_analysis import LevelFit
from storage import runs
from storage.engine.database import Database
from storage.runs import RunRow


def curves(database: Database, clutch_id: str, part: Part) -> dict[str, Any]:
    """Stationary tests by cycles with their fits and pressure laws. Raises NotFoundError.

    A test of the open clutch has neither fits nor laws.
    """
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, limit=part.most, after=part.after, fitted=True, state=runs.ACCEPTED)
        levels = records.levels(connection, clutch_id)
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
        if isinstance(law, LinearLaw):
            items[public] = {"intercept": law.intercept, "slope_per_bar": law.slope * PASCALS_PER_BAR}
            in_bar = np.array([1.0, PASCALS_PER_BAR])
        else:
            items[public] = {"asymptote": law.asymptote, "excess": law.excess, "decay_bar": law.decay / PASCALS_PER_BAR}
            in_bar = np.array([1.0, 1.0, 1.0 / PASCALS_PER_BAR])
        items[public]["covariance"] = (covariances[name] * np.outer(in_bar, in_bar)).tolist()
    return items
