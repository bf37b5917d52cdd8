"""`/degradation`: eq. 6 of mean COF and of every Stribeck parameter, and mean COF computed back from the parameters."""

from collections.abc import Iterator, Mapping
from typing import Any

from service import records
from service.lives.parameter_tracks import parameter_tracks, posterior_of, tests_of, track_item
from service.lives.receipt import notice_items
from service.queries.cof_from_parameters import disagreements, rebuilt
from storage.engine.database import Database

_COEFFICIENTS = ("initial", "change", "scale_cycles", "exponent")
COLUMNS = (
    "quantity",
    "unit",
    "pressure_bar",
    *(f"{name}{part}" for name in _COEFFICIENTS for part in ("", "_sd")),
)


def degradation(database: Database, clutch_id: str) -> dict[str, Any]:
    """Eq. 6 over all pressures together and at every reference pressure, in the present life. Raises NotFoundError."""
    with database.reading() as connection:
        state = records.state(connection, clutch_id)
        levels = records.levels(connection, clutch_id)
    assumptions = state.assumptions()
    head = {"clutch_id": clutch_id, "revision": state.revision}
    life = state.lives[-1] if state.events else None
    if life is None or not life.reference:
        return head | {"items": [], "rebuilt": None, "warnings": []} | assumptions.named() | {"next": None}
    tests = tests_of(life, levels)
    direct = [life.pooled(assumptions), *(life.at(assumptions, level) for level in life.reference)]
    tracked = [(series, posterior_of(clutch_id, series, assumptions)) for series in direct if series.measurements]
    parameters = parameter_tracks(clutch_id, life, assumptions, tests)
    by_pressure = {series.pressure: (series, posterior) for series, posterior in tracked}
    again = rebuilt(clutch_id, life, assumptions, tests, parameters, by_pressure, state.geometry, state.fraction)
    return (
        head
        | {
            "items": [
                track_item(series, posterior, assumptions) for series, posterior in (*tracked, *parameters.values())
            ],
            "rebuilt": again,
            "warnings": notice_items(disagreements(again)),
        }
        | assumptions.named()
        | {"next": None}
    )


def rows(payload: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Eq. 6's coefficients as rows of a table, a row a quantity and pressure."""
    for item in payload["items"]:
        yield (
            {name: item[name] for name in COLUMNS[:3]}
            | {name: item["coefficients"][name]["value"] for name in _COEFFICIENTS}
            | {f"{name}_sd": item["coefficients"][name]["sd"] for name in _COEFFICIENTS}
        )
