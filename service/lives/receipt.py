"""Receipts: what the service made of a run, in the public names and units."""

from collections.abc import Sequence
from typing import Any

from models.friction.identification import StribeckFit
from service.lives.incoming_run import IncomingRun
from service.lives.run_analysis import Value, Warned
from service.readers.units import PASCALS_PER_BAR
from service.schemas.base import whole
from service.settings import CODE_VERSION

PARAMETER_UNITS = {
    "static_torque": ("static_torque_nm", "Nm"),
    "coulomb_ratio": ("coulomb_ratio", "1"),
    "stribeck_velocity": ("stribeck_velocity_m_s", "m/s"),
    "viscous_coefficient": ("viscous_coefficient", "Nm/(m/s)^0.3"),
}


def fit_receipt(fit: StribeckFit, cof: Value | None) -> dict[str, Any]:
    """One fit as a receipt shows it, with its mean COF where it can say it."""
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


def bar(pressure: float) -> float:
    """Pa to bar, free of the last bits' noise."""
    return round(pressure / PASCALS_PER_BAR, 9)


def receipt(
    clutch_id: str,
    run: IncomingRun,
    *,
    received_at: str,
    fits: Sequence[dict[str, Any]],
    loops: Sequence[dict[str, Any]] = (),
    warnings: Sequence[Warned],
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
        "warnings": [{"code": each.code, "message": each.message} for each in warnings],
        "fits": list(fits),
        "loops": list(loops),
        "duty": run.details.get("duty"),
        "event": run.details.get("event"),
        "note": run.details.get("note"),
        "code_version": CODE_VERSION,
    }
