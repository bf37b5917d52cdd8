"""`make real`: post the real measurements to a service and print, as Markdown, what it says of them."""

import statistics
import sys
from typing import Any

import httpx2

from tests.measuring import table
from tests.real import diagnosis, lag, lives, loaders, prognosis
from tests.support import served


def screw_drives(http: httpx2.Client) -> None:
    """Each drive and direction as a stationary run."""
    rows = []
    for name, run in loaders.screw_drive_runs().items():
        record = {"clutch_id": name, "geometry": {"mean_radius_mm": 1000}}
        http.post("/v1/clutches", json=record).raise_for_status()
        answer = http.post(f"/v1/clutches/{name}/runs", json=run)
        answer.raise_for_status()
        fit = answer.json()["fits"][0]
        parameters = (_formatted(fit, name, scale) for name, scale in _SCALES.items())
        errors = (f"{fit['rmse_nm'] * 1e3:.3f}", f"{fit['mse_percent']:.1f}")
        rows.append((name, fit["points"], *parameters, *errors, fit["status"]))
    titles = "run | points | M_s [mNm] | M̄_c | V_S [rad/s] | C_v [mNm] | RMSE [mNm] | MSE [%] | status"
    print("### Two screw drives at steady speeds\n", *table(titles.split(" | "), rows), sep="\n")


#: Nm to mNm; at a mean radius of 1 m a velocity in m/s is a speed in rad/s.
_SCALES = {"static_torque_nm": 1e3, "coulomb_ratio": 1.0, "stribeck_velocity_m_s": 1.0, "viscous_coefficient": 1e3}


def _formatted(fit: dict[str, Any], name: str, scale: float) -> str:
    if name in fit["undetermined"]:
        return "undetermined"
    return f"{fit['parameters'][name] * scale:.3g} ± {fit['standard_errors'][name] * scale:.2g}"


def traction(http: httpx2.Client) -> None:
    """200 sweeps of one contact, and what is said of its remaining life."""
    http.post("/v1/clutches", json=loaders.TRACTION_CLUTCH).raise_for_status()
    fits = []
    for run in loaders.traction_runs():
        answer = http.post("/v1/clutches/traction/runs", json=run)
        answer.raise_for_status()
        fits += answer.json()["fits"]
    names = {"percentage MSE": "mse_percent", "RMSE [Nm]": "rmse_nm", "mean coefficient of traction": "mean_cof"}
    cuts = {title: statistics.quantiles([fit[name] for fit in fits], n=20) for title, name in names.items()}
    rows = [(title, *(f"{found[k]:.3g}" for k in (0, 9, 18))) for title, found in cuts.items()]
    print("\n### 200 traction sweeps, down and up\n", *table(("", "5 %", "median", "95 %"), rows), sep="\n")
    print(f"\n{sum(fit['acceptable'] for fit in fits)} of {len(fits)} fits are acceptable (MSE below 5 %).\n")
    rows = []
    for at in (20, 50, 100, 200):
        for method in ("particle", "ukf", "grid"):
            params: dict[str, Any] = {"method": method, "at_cycles": at}
            said = http.get("/v1/clutches/traction/remaining-useful-life", params=params).json()
            left = (said["remaining_cycles"][q] for q in ("0.05", "0.5", "0.95"))
            cycles = ("beyond" if value is None else f"{value:.3g}" for value in left)
            rows.append((str(at), method, said["status"], f"{said['probability_of_reaching']:.2f}", *cycles))
    titles = "after sweep | method | status | P(reached within 10⁶) | remaining, 5 % | median | 95 %"
    print(*table(titles.split(" | "), rows), sep="\n")


def main() -> int:
    if not loaders.FOLDER.is_dir():
        print(f"the real measurements are not at {loaders.FOLDER}", file=sys.stderr)
        return 1
    with served() as (_, http):
        screw_drives(http)
        traction(http)
    print("\n## Lag: loops and transients\n")
    lag.main()
    print("\n## The diagnosis\n")
    diagnosis.main()
    print("\n## The prognosis\n")
    prognosis.main()
    lives.main()
    return 0


if __name__ == "__main__":
    sys.exit(main())
