"""Remaining life before and after a diagnosis is adopted, and the life that the rig's clutch really has.

A campaign is posted to the service, diagnosed, and what it found is adopted; remaining life is asked for before and after.
The clutch lives on with what is hidden in it under duty as usual; the end of life is registered as the share of its first
mean COF that it passes for the first time after a drawn number of cycles, so that every life has an end.
"""

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
from fastapi.testclient import TestClient

from models.arrays import FloatArray
from service.app import create_app
from service.settings import Settings
from tests.blind.rig.hide import Hidden
from tests.blind.rig.plan import Life, Site

CLUTCH, REMAINING = "/v1/clutches/blind/", "remaining-useful-life"


def passed_at(hidden: Hidden, end: float) -> float | None:
    """The share of its first mean COF that the clutch passes first at `end` cycles, None where it was passed before."""
    cycles = np.linspace(0.0, end, 201)
    course = mean_cof(hidden, cycles)
    share = course / course[0]
    return float(share[-1]) if 0.05 < share[-1] < share[:-1].min() - 1e-4 else None


def mean_cof(hidden: Hidden, cycles: FloatArray) -> FloatArray:
    """The true mean over pressures and the reference's speeds, up to a factor, at ascending cycles [m] from 0.

    Duty after the last state is as usual; only effects that move a life are in it.
    """
    old = hidden.plan.life
    all_cycles = np.union1d(cycles, old.cycles)
    energy = np.append(old.energy, old.usual_energy)[np.searchsorted(old.cycles, all_cycles)]
    still = np.zeros(all_cycles.size)
    life = Life(all_cycles, old.moment[0] + 20 * all_cycles, still, energy, old.usual_energy, old.events)
    pressures, speeds = hidden.plan.pressures, np.linspace(20.0, 1970.0, 40)
    rows = np.stack([each.ravel() for each in np.meshgrid(pressures, speeds, indexing="ij")])
    bar, rpm = (np.repeat(row[None], all_cycles.size, axis=0) for row in rows)
    site = Site("stationary", np.arange(all_cycles.size), bar, rpm, 0 * bar, 0 * bar + 85.0, life, 5.0)
    law = hidden.clutch.law(site.bar, site.cycles)
    torque = law.torque(site.v)
    for effect, amplitude in hidden.effects:
        if effect.moves_life and effect.friction is not None:
            torque = torque + effect.friction(amplitude, site, law)
    return np.asarray((torque / bar).mean(axis=1)[np.searchsorted(all_cycles, cycles)])


def forecasts_of(
    sent: Sequence[dict[str, Any]], fraction: float
) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """The report on runs that are posted, and the forecast of the end of life before and after adoption; the same twice
    where nothing is there to adopt."""
    with _posted(sent, fraction) as http:
        report = asked(http, "POST", "diagnoses", json={"adopt": False}, headers={"Prefer": "wait=120"})
        while report["status"] == "running":
            time.sleep(1.0)
            report = asked(http, "GET", f"diagnoses/{report['diagnosis_id']}")
        if report["status"] != "finished":
            raise RuntimeError(f"a diagnosis ended without a report: {report['problem']}")
        before = after = asked(http, "GET", REMAINING)
        if report["adoptable"]:
            asked(http, "PUT", "model", json={"diagnosis_id": report["diagnosis_id"]})
            after = asked(http, "GET", REMAINING)
    return report, before, after


def asked(http: httpx2.Client, method: str, path: str, **sent: Any) -> dict[str, Any]:
    """The service's answer; while it is busy, as beside other work on the machine, it is asked again when it says."""
    while (answer := http.request(method, path, **sent)).status_code == 503:
        time.sleep(float(answer.headers["Retry-After"]))
    return dict(answer.raise_for_status().json())


def forecast_of(sent: Sequence[dict[str, Any]], fraction: float) -> dict[str, Any]:
    """The forecast of the end of life from runs that are posted."""
    with _posted(sent, fraction) as http:
        return asked(http, "GET", REMAINING)


@contextmanager
def _posted(sent: Sequence[dict[str, Any]], fraction: float) -> Iterator[TestClient]:
    """A service that has the runs of a clutch, whose addresses are relative to that clutch."""
    with tempfile.TemporaryDirectory() as folder:
        app = create_app(Settings(workers=0, database=f"sqlite:///{Path(folder) / 'a.db'}"))
        with TestClient(app, base_url=f"http://127.0.0.1{CLUTCH}", client=("127.0.0.1", 50000)) as http:
            clutch = {"clutch_id": "blind", "origin": "simulated", "end_of_life": {"cof_fraction": fraction}}
            asked(http, "POST", "http://127.0.0.1/v1/clutches", json=clutch)
            for run in sent:
                asked(http, "POST", "runs", json=run | {"origin": "simulated"})
            yield http
