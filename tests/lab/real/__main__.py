"""`make real`: post the real measurements to a service and print, as Markdown, what it says of them."""

import itertools
import statistics
import sys
from typing import Any

import httpx2

from tests.lab.measuring import show
from tests.lab.real import diagnosis, lag, lives, loaders, prognosis
from tests.support import served

#: Nm to mNm; at a mean radius of 1 m a velocity in m/s is a speed in rad/s.
_PARAMETERS = {
    "M_s [mNm]": ("static_torque_nm", 1e3),
    "M̄_c": ("coulomb_ratio", 1.0),
    "V_S [rad/s]": ("stribeck_velocity_m_s", 1.0),
    "C_v [mNm]": ("viscous_coefficient", 1e3),
}


def fits_of(http: httpx2.Client, clutch: dict[str, Any], runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The fits of a clutch's runs, which are posted."""
    http.post("/v1/clutches", json=clutch).raise_for_status()
    address = f"/v1/clutches/{clutch['clutch_id']}/runs"
    return [fit for run in runs for fit in http.post(address, json=run).raise_for_status().json()["fits"]]


def screw_drives(http: httpx2.Client) -> None:
    """Each drive and direction as a stationary run."""
    rows = []
    for name, run in loaders.screw_drive_runs().items():
        (fit,) = fits_of(http, {"clutch_id": name, "geometry": {"mean_radius_mm": 1000}}, [run])
        rows.append(
            {"run": name, "points": fit["points"]}
            | {title: _formatted(fit, parameter, scale) for title, (parameter, scale) in _PARAMETERS.items()}
            | {"RMSE [mNm]": f"{fit['rmse_nm'] * 1e3:.3f}", "MSE [%]": f"{fit['mse_percent']:.1f}"}
            | {"status": fit["status"]}
        )
    show("### Two screw drives at steady speeds", rows)


def _formatted(fit: dict[str, Any], name: str, scale: float) -> str:
    if name in fit["undetermined"]:
        return "undetermined"
    return f"{fit['parameters'][name] * scale:.3g} ± {fit['standard_errors'][name] * scale:.2g}"


def traction(http: httpx2.Client) -> None:
    """200 sweeps of one contact, and what is said of its remaining life."""
    fits = fits_of(http, loaders.TRACTION_CLUTCH, loaders.traction_runs())
    names = {"percentage MSE": "mse_percent", "RMSE [Nm]": "rmse_nm", "mean coefficient of traction": "mean_cof"}
    cuts = {title: statistics.quantiles([fit[name] for fit in fits], n=20) for title, name in names.items()}
    shares = {"5 %": 0, "median": 9, "95 %": 18}
    rows = ({"": title} | {at: f"{found[k]:.3g}" for at, k in shares.items()} for title, found in cuts.items())
    show("### 200 traction sweeps, down and up", rows)
    rows = []
    for at, method in itertools.product((20, 50, 100, 200), ("particle", "ukf", "grid")):
        params: dict[str, Any] = {"method": method, "at_cycles": at}
        said = http.get("/v1/clutches/traction/remaining-useful-life", params=params).json()
        row = {"after sweep": at, "method": method, "status": said["status"]}
        row["P(reached within 10⁶)"] = f"{said['probability_of_reaching']:.2f}"
        for title, q in (("remaining, 5 %", "0.05"), ("median", "0.5"), ("95 %", "0.95")):
            left = said["remaining_cycles"][q]
            row[title] = "beyond" if left is None else f"{left:.3g}"
        rows.append(row)
    show(f"{sum(fit['acceptable'] for fit in fits)} of {len(fits)} fits are acceptable.", rows)


def main() -> int:
    if not loaders.FOLDER.is_dir():
        print(f"the real measurements are not at {loaders.FOLDER}", file=sys.stderr)
        return 1
    with served() as (_, http):
        screw_drives(http)
        traction(http)
    for title, part in (("Lag: loops and transients", lag), ("The diagnosis", diagnosis), ("The prognosis", prognosis)):
        print(f"## {title}\n")
        part.main()
    lives.main()
    return 0


if __name__ == "__main__":
    sys.exit(main())
