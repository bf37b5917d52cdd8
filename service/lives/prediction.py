"""A prediction in the public shape of `/remaining-useful-life`."""

from collections.abc import Sequence
from typing import Any

from models.prognosis.criteria import HORIZON, QUANTILES
from models.prognosis.first_passage import FirstPassage
from service.lives.assumptions import ALL_PRESSURES, MEAN_COF, Basis
from service.lives.history import Series
from service.lives.receipt import bar
from service.lives.run_analysis import Warned
from service.schemas.base import whole

INSUFFICIENT = "insufficient_data"


def unknown(basis: Basis, cycles: float | None, pressure: float, fraction: float) -> dict[str, Any]:
    """What is said where nothing can be: `insufficient_data`."""
    return {
        "as_of_cycles": None if cycles is None else whole(cycles),
        "runs_used": 0,
        "status": INSUFFICIENT,
        "criterion": _criterion(fraction, pressure, None, None),
        "current": {"mean_cof": None, "mean_cof_sd": None, "fraction_of_initial": None, "health": None},
        "remaining_cycles": _quantiles({}),
        "end_of_life_cycles": _quantiles({}),
        "probability_of_reaching": None,
        "horizon_cycles": whole(HORIZON),
        "warnings": [],
    } | named(basis)


def named(basis: Basis) -> dict[str, Any]:
    """The model, the prior and the severity behind an answer."""
    severity = {"basis": basis.severity.basis.value, "exponent": basis.severity.exponent}
    return {"model": dict(basis.model), "prior": dict(basis.prior), "severity": severity}


def foretold(
    passage: FirstPassage,
    basis: Basis,
    series: Series,
    cycles: float,
    fraction: float,
    *,
    runs: int,
    enough: bool,
    warnings: Sequence[Warned],
) -> dict[str, Any]:
    """What is said of a first passage in ζ, led back to cycles; without `enough` tests only where it stands."""
    mean, deviation = max(0.0, passage.current[0]), passage.current[1]
    left = mean / passage.initial if passage.initial > 0 else None
    known = {
        "runs_used": runs,
        "criterion": _criterion(fraction, series.pressure, passage.initial, passage.threshold),
        "current": {
            "mean_cof": mean,
            "mean_cof_sd": deviation,
            "fraction_of_initial": left,
            "health": None if left is None else min(1.0, max(0.0, (left - fraction) / (1 - fraction))),
        },
        "warnings": [{"code": each.code, "message": each.message} for each in warnings],
    }
    ends = {q: None if zeta is None else float(series.scale.cycles(zeta)) for q, zeta in passage.end_of_life.items()}
    future = {
        "status": passage.status.value,
        "remaining_cycles": _quantiles({q: None if end is None else max(0.0, end - cycles) for q, end in ends.items()}),
        "end_of_life_cycles": _quantiles(ends),
        "probability_of_reaching": passage.probability_of_reaching,
    }
    return unknown(basis, cycles, series.pressure, fraction) | known | (future if enough else {})


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
