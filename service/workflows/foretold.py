"""A prediction in the public shape of `/remaining-useful-life`."""

from typing import Any

from models.prognosis import HORIZON, QUANTILES, FirstPassage
from service.schemas.base import whole
from service.workflows.history import ALL_PRESSURES, MEAN_COF
from service.workflows.receipts import bar

BASELINE = {"name": "baseline", "effects": []}


def unknown(cycles: float | None, pressure: float, fraction: float) -> dict[str, Any]:
    """What is said where nothing can be: `insufficient_data`."""
    return {
        "as_of_cycles": None if cycles is None else whole(cycles),
        "runs_used": 0,
        "status": "insufficient_data",
        "criterion": _criterion(fraction, pressure, None, None),
        "current": {"mean_cof": None, "mean_cof_sd": None, "fraction_of_initial": None, "health": None},
        "remaining_cycles": _quantiles({}),
        "end_of_life_cycles": _quantiles({}),
        "probability_of_reaching": None,
        "horizon_cycles": whole(HORIZON),
        "model": BASELINE,
    }


def foretold(
    passage: FirstPassage, runs: int, origin: float, cycles: float, pressure: float, fraction: float, *, enough: bool
) -> dict[str, Any]:
    """What is said of a first passage, its cycles counted from `origin`; without `enough` tests only where it stands."""
    mean, deviation = max(0.0, passage.current[0]), passage.current[1]
    left = mean / passage.initial if passage.initial > 0 else None
    known = {
        "runs_used": runs,
        "criterion": _criterion(fraction, pressure, passage.initial, passage.threshold),
        "current": {
            "mean_cof": mean,
            "mean_cof_sd": deviation,
            "fraction_of_initial": left,
            "health": None if left is None else min(1.0, max(0.0, (left - fraction) / (1 - fraction))),
        },
    }
    future = {
        "status": passage.status.value,
        "remaining_cycles": _quantiles(passage.remaining),
        "end_of_life_cycles": _quantiles(
            {q: None if value is None else value + origin for q, value in passage.end_of_life.items()}
        ),
        "probability_of_reaching": passage.probability_of_reaching,
    }
    return unknown(cycles, pressure, fraction) | known | (future if enough else {})


def _criterion(fraction: float, pressure: float, initial: float | None, threshold: float | None) -> dict[str, Any]:
    return {
        "quantity": MEAN_COF,
        "fraction": fraction,
        "initial_mean_cof": initial,
        "threshold_mean_cof": threshold,
        "pressure_bar": None if pressure == ALL_PRESSURES else bar(pressure),
    }


def _quantiles(values: dict[float, float | None]) -> dict[str, float | None]:
    return {f"{quantile:g}": values.get(quantile) for quantile in QUANTILES}
