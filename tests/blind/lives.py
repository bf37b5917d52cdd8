"""Remaining life before and after a diagnosis is adopted, held against the life that the rig's clutch really has.

A campaign is posted to the service, diagnosed, and what it found is adopted; remaining life is asked for before and after.
The clutch lives on with what is hidden in it under duty as usual; the end of life is registered as the share of its first
mean COF that it passes for the first time after a drawn number of cycles, so that every life has an end.
"""

import tempfile
import time
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
from fastapi.testclient import TestClient

from models.arrays import FloatArray
from models.prognosis.scoring import crps_of_quantiles
from service.app import create_app
from service.settings import Settings
from tests.blind.rig.hide import Hidden, hide
from tests.blind.rig.loudness import UnreachableError
from tests.blind.rig.makers import CATALOGUED
from tests.blind.rig.plan import Life, Site
from tests.blind.rig.sent import runs

#: What moves a life, and artefacts that distort what is measured of it; how loud; states; lives each in the whole table.
COURSES = ("running_in", "oil_change", "accelerated_wear", "load_severity")
ARTEFACTS = ("oil_temperature", "torque_zero_shift", "pressure_offset")
LOUD, STATES, LIVES = 50.0, 8, 12
#: The end in lengths of what was measured; draws until one of them is the first passage of its own value.
SOONEST, LATEST, DRAWS = 1.3, 2.5, 20
HORIZON = 1e6
CLUTCH, REMAINING = "/v1/clutches/blind/", "remaining-useful-life"


@dataclass(frozen=True)
class Lived:
    """A life: what was hidden, what was diagnosed, and CRPS of the end's logarithm before and after adoption.

    Where nothing was there to adopt, both are the same; they are None where no such life could be made.
    """

    slug: str
    seed: tuple[int, ...]
    verdict: str
    adopted: bool
    before: float | None
    after: float | None


def jobs(seed: int, size: float) -> list[tuple[str, tuple[int, ...]]]:
    """Slug and seed of each life of the table; `size` 1 is the whole, smaller takes that share, at least one each."""
    count = max(1, round(size * LIVES))
    return [
        (slug, (seed, zlib.crc32(b"lives"), zlib.crc32(slug.encode()), k))
        for slug in (*COURSES, *ARTEFACTS)
        for k in range(count)
    ]


def lived(job: tuple[str, tuple[int, ...]]) -> Lived:
    """Hide, post, diagnose, adopt; hold both forecasts against the true end."""
    slug, seed = job
    for k in range(DRAWS):
        try:
            hidden = hide((*seed, k), (slug,), LOUD, loops=False, states=STATES)
        except UnreachableError:
            break
        end = np.random.default_rng([*seed, k]).uniform(SOONEST, LATEST) * hidden.plan.life.span
        fraction = passed_at(hidden, end)
        if fraction is not None:
            report, *forecasts = forecasts_of(runs(hidden), fraction)
            before, after = (_crps(forecast, end) for forecast in forecasts)
            return Lived(slug, hidden.seed, report["verdict"], report["adoptable"], before, after)
    return Lived(slug, seed, "unreachable", False, None, None)


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


def _crps(forecast: dict[str, Any], end: float) -> float:
    """CRPS of the logarithm of the end of life; one beyond the horizon is scored as if it were at the horizon."""
    ends = {float(q): HORIZON if x is None else max(x, 1.0) for q, x in forecast["end_of_life_cycles"].items()}
    return crps_of_quantiles(list(ends), [float(np.log(x)) for x in ends.values()], float(np.log(end)))


def table(outcomes: Sequence[Lived]) -> list[str]:
    """Effect by effect CRPS before and after, how often it was better, the change with a paired 95 % interval."""
    rng = np.random.default_rng(5)
    lines = [
        "| remaining life with a hidden effect | lives | adopted | CRPS before | after | better/worse | change | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for slug in CATALOGUED:
        mine = [one for one in outcomes if one.slug == slug and one.before is not None]
        if not mine:
            continue
        before, after = (np.array([getattr(one, name) for one in mine], dtype=float) for name in ("before", "after"))
        change = after - before
        again = change[rng.integers(change.size, size=(2000, change.size))].mean(axis=1)
        low, high = np.quantile(again, [0.025, 0.975])
        cells = [str(len(mine)), str(sum(one.adopted for one in mine)), f"{before.mean():.3f}", f"{after.mean():.3f}"]
        cells += [f"{(change < 0).sum()}/{(change > 0).sum()}", f"{change.mean():+.3f} [{low:+.3f}, {high:+.3f}]"]
        cells += ["met" if change.mean() < 0 else "missed"]
        lines.append(f"| `{slug}` | " + " | ".join(cells) + " |")
    return lines


def meaning(outcomes: Sequence[Lived]) -> list[str]:
    """What the table of lives shows; nothing where no lives were asked for."""
    if not outcomes:
        return []
    unmade = sum(one.before is None for one in outcomes)
    return [
        f"Lives at λ = {LOUD:.0f}, {STATES} states, stationary tests: CRPS of the logarithm of the end of life before and "
        "after what the diagnosis found is adopted (where nothing can be adopted both are the same), its change with a "
        "paired 95 % interval; target: lower after than before. Each clutch lives on with its effect under its usual duty "
        f"until {SOONEST:.1f} to {LATEST:.1f} times the cycles that were measured; {unmade} of {len(outcomes)} lives could "
        "not be made."
    ]
