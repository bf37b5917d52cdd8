"""Real measurements, where they lie beside the project: posted, fitted, and no confident number where there is none."""

import httpx2
import pytest

from tests.lab.real import loaders

pytestmark = pytest.mark.skipif(not loaders.FOLDER.is_dir(), reason=f"the measurements are not at {loaders.FOLDER}")


def test_screw_drives_are_fitted(http: httpx2.Client) -> None:
    """Steady torques of two drives in two directions: each curve within a tenth of a millinewtonmetre."""
    runs = loaders.screw_drive_runs()
    assert len(runs) == 4
    for name, run in runs.items():
        http.post("/v1/clutches", json={"clutch_id": name, "geometry": {"mean_radius_mm": 1000}})
        answer = http.post(f"/v1/clutches/{name}/runs", json=run)
        assert answer.status_code == 201
        fit = answer.json()["fits"][0]
        assert fit["rmse_nm"] < 1e-4
        assert min(fit["parameters"].values()) >= 0
        # the measured deviations are those of many samples: what is left over is more, and the errors say so
        assert fit["noise_nm"] > 0


@pytest.mark.slow
def test_traction_sweeps_get_no_confident_number(http: httpx2.Client) -> None:
    """A contact that does not wear out as eq. 6 says: the answer is no number of cycles that one could plan with."""
    http.post("/v1/clutches", json=loaders.TRACTION_CLUTCH)
    runs = loaders.traction_runs()
    assert len(runs) == 200
    for run in runs[::4]:
        assert http.post("/v1/clutches/traction/runs", json=run).status_code == 201
    for method in ("particle", "ukf", "grid"):
        prediction = http.get("/v1/clutches/traction/remaining-useful-life", params={"method": method}).json()
        low, high = (prediction["remaining_cycles"][quantile] for quantile in ("0.05", "0.95"))
        assert high is None or high > 50.0 * low
        assert "not_eq6" in [warning["code"] for warning in prediction["warnings"]]
        assert prediction["current"]["mean_cof"] == pytest.approx(0.05, rel=0.2)
