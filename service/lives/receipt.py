"""Receipts: what the service made of a run, in the public names and units."""

from collections.abc import Sequence
from typing import Any

from models.friction.identification import StribeckFit
from models.loops.dynamic_test import Loop
from service.lives.history import ByPressure
from service.lives.incoming_run import IncomingRun
from service.lives.run_analysis import LevelFit, Notice, Value
from service.readers.units import PASCALS_PER_BAR
from service.schemas.base import whole
from service.settings import CODE_VERSION

#: Public name and unit of each Stribeck parameter.
PARAMETER_UNITS = {
    "static_torque": ("static_torque_nm", "Nm"),
    "coulomb_ratio": ("coulomb_ratio", "1"),
    "stribeck_velocity": ("stribeck_velocity_m_s", "m/s"),
    "viscous_coefficient": ("viscous_coefficient", "Nm/(m/s)^0.3"),
}


def receipt(
    clutch_id: str,
    run: IncomingRun,
    *,
    received_at: str,
    levels: Sequence[LevelFit],
    cofs: ByPressure,
    loops: Sequence[Loop] = (),
    warnings: Sequence[Notice],
) -> dict[str, Any]:
    """The receipt of a run."""
    return {
        "clutch_id": clutch_id,
        "run_id": run.run_id,
        "kind": run.kind,
        "cycles": whole(run.cycles),
        "started_at": run.started_at,
        "origin": run.origin,
        "received_at": received_at,
        "content_sha256": run.content_sha256,
        "duplicate": False,
        "warnings": notice_items(warnings),
        "fits": fit_items(levels, cofs),
        "loops": loop_items(loops),
        "duty": run.details.get("duty"),
        "event": run.details.get("event"),
        "note": run.details.get("note"),
        "code_version": CODE_VERSION,
    }


def fit_items(levels: Sequence[LevelFit], cofs: ByPressure) -> list[dict[str, Any]]:
    """The fits of a test as a receipt shows them, each with its mean COF where it determines one."""
    return [_fit_item(level.fit, cofs.get(level.fit.pressure)) for level in levels]


def loop_items(loops: Sequence[Loop]) -> list[dict[str, Any]]:
    """The loops of a dynamic test as a receipt shows them; what the record does not determine is null."""
    return [_loop_item(loop) for loop in loops]


def notice_items(notices: Sequence[Notice]) -> list[dict[str, str]]:
    """Warnings in the public shape."""
    return [{"code": notice.code, "message": notice.message} for notice in notices]


def bar(pressure: float) -> float:
    """Pa to bar, free of the last bits' noise."""
    return round(pressure / PASCALS_PER_BAR, 9)


def _fit_item(fit: StribeckFit, cof: Value | None) -> dict[str, Any]:
    names = [public for public, _ in PARAMETER_UNITS.values()]
    return {
        "pressure_bar": bar(fit.pressure),
        "parameters": dict(zip(names, map(float, fit.parameters.as_array()), strict=True)),
        "standard_errors": dict(zip(names, map(float, fit.covariance.diagonal() ** 0.5), strict=True)),
        "mse_percent": fit.mse_percent,
        "rmse_nm": fit.rmse,
        "noise_nm": fit.noise,
        "acceptable": fit.acceptable,
        "mean_cof": None if cof is None else cof[0],
        "mean_cof_sd": None if cof is None else cof[1],
        "points": fit.points,
        "status": fit.status.value,
        "undetermined": [PARAMETER_UNITS[name][0] for name in fit.undetermined],
        "message": fit.message,
    }


def _loop_item(loop: Loop) -> dict[str, Any]:
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
