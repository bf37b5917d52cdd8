"""One trial: an effect is hidden, what the diagnosis offers is adopted, and remaining life is held against the truth.

Campaigns are those of the blind rig in its own forms (`tests.lab.blind.rig`). A campaign is posted to the service,
diagnosed, and what it found is adopted; remaining life is asked for before and after. The clutch lives on with what is
hidden in it under duty as usual; the end of life is registered as the share of its first mean COF that it passes for the
first time after a drawn number of cycles, so that every life has an end. What came of a trial is stored, a file each, so
that a run goes on where it ended.
"""

import json
import subprocess
import tempfile
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
from fastapi.testclient import TestClient

from models.arrays import FloatArray
from tests.lab.blind.rig.hide import Hidden, hide
from tests.lab.blind.rig.loudness import UnreachableError
from tests.lab.blind.rig.plan import Life, Site
from tests.lab.blind.rig.sent import runs
from tests.lab.blind.rig.world import read
from tests.lab.measuring import ROOT, kept
from tests.service.clients import client_on

#: Artefacts that distort what is measured of a life, and what moves it.
ARTEFACTS = ("oil_temperature", "torque_zero_shift", "pressure_offset")
COURSES = ("running_in", "oil_change", "accelerated_wear", "load_severity")
#: How loud they are, and campaigns of each at each loudness with loops and as many without in the whole table; states.
LOUD, EACH, STATES = (80.0, 300.0), 20, 8
#: The end in lengths of what was measured; draws until one of them is the first passage of its own value.
SOONEST, LATEST, DRAWS = 1.3, 2.5, 20
STORE = ROOT / ".adoption"
CLUTCH, REMAINING = "/v1/clutches/blind/", "remaining-useful-life"


@dataclass(frozen=True)
class Trial:
    slug: str
    lam: float
    loops: bool
    seed: int
    number: int

    @property
    def name(self) -> str:
        return f"{self.slug}-{self.lam:.0f}-{'loops' if self.loops else 'plateaus'}-{self.seed}-{self.number}"


@dataclass(frozen=True)
class Adopted:
    """What came of a trial; `estimates` are by effect the value, its deviation and its 90 % interval, `before` and `after`
    the end's quantiles, `clean` those of the same runs in the same noise without the artefact (none of what moves a life),
    `end` [cycles] and `size` the truth, in the catalogue's unit and sense; all empty where no campaign could be made."""

    trial: Trial
    commit: str
    verdict: str = "unreachable"
    causes: list[str] = field(default_factory=list)
    adoptable: bool = False
    reason: str = ""
    estimates: dict[str, list[float]] = field(default_factory=dict)
    before: dict[str, float | None] = field(default_factory=dict)
    after: dict[str, float | None] = field(default_factory=dict)
    clean: dict[str, float | None] = field(default_factory=dict)
    end: float = 0.0
    size: float = 0.0
    seconds: float = 0.0

    @property
    def made(self) -> bool:
        return self.verdict != "unreachable"

    @property
    def named_right(self) -> bool:
        return self.verdict == "cause_named" and self.causes == [self.trial.slug]


def trials(seed: int, size: float) -> list[Trial]:
    """All trials; `size` 1 is the whole table, smaller takes that share, at least one of each."""
    count = max(1, round(size * EACH))
    return [
        Trial(slug, lam, loops, seed, number)
        for number in range(count)
        for slug in (*ARTEFACTS, *COURSES)
        for lam in LOUD
        for loops in (False, True)
    ]


def made(trial: Trial) -> tuple[Hidden, float, float] | None:
    """The campaign of a trial, its end [cycles], and the share of its first mean COF that the clutch passes then; None where
    none of its draws can be made."""
    seed = (trial.seed, zlib.crc32(b"adoption"), zlib.crc32(trial.name.encode()))
    for k in range(DRAWS):
        try:
            hidden = hide((*seed, k), (trial.slug,), trial.lam, loops=trial.loops, states=STATES)
        except UnreachableError:
            continue
        end = float(np.random.default_rng([*seed, k]).uniform(SOONEST, LATEST) * hidden.plan.life.span)
        fraction = passed_at(hidden, end)
        if fraction is not None:
            return hidden, end, fraction
    return None


def without(hidden: Hidden) -> Hidden:
    """The same readings with the same noise, nothing hidden in them."""
    true, plain = (read(hidden.plan, hidden.clutch, effects) for effects in (hidden.effects, ()))
    triples = zip(hidden.measured, true, plain, strict=True)
    return replace(hidden, effects=(), measured=[measured - mine + own for measured, mine, own in triples])


def size_of(hidden: Hidden) -> float:
    """An artefact's size after the last state: a zero [Nm] or an offset [bar] with its sign, the oil's exponent [-]."""
    effect, amplitude = hidden.effects[0]
    site = hidden.plan.sites[0]
    last = np.flatnonzero(site.state == site.state.max())
    if effect.reading is not None:
        return float(effect.reading(amplitude, site, site.bar)[last].mean())
    if effect.slug == "pressure_offset":
        change = effect.friction(amplitude, site, hidden.clutch.law(site.bar, site.cycles))
        return float(np.sign(change[last].mean()) * amplitude)
    return amplitude


def adopted(trial: Trial) -> Adopted:
    """What comes of a trial, computed or read."""
    path = STORE / f"{trial.name}.json"
    stored = json.loads(kept(path, lambda: json.dumps(asdict(_adopted(trial))).encode()))
    return Adopted(**(stored | {"trial": Trial(**stored["trial"])}))


def _adopted(trial: Trial) -> Adopted:
    found = made(trial)
    if found is None:
        return Adopted(trial, commit())
    hidden, end, fraction = found
    began = time.monotonic()
    with _posted(hidden, fraction) as http:
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
    clean = {}
    if trial.slug in ARTEFACTS:  # what moves a life stays in it
        with _posted(without(hidden), fraction) as http:
            clean = asked(http, "GET", REMAINING)["end_of_life_cycles"]
    return Adopted(
        trial=trial,
        commit=commit(),
        verdict=report["verdict"],
        causes=report["causes"],
        adoptable=report["adoptable"],
        reason=report.get("not_adoptable") or "",
        estimates={candidate["effect"]: _estimate(candidate["estimate"]) for candidate in report["candidates"]},
        before=before["end_of_life_cycles"],
        after=after["end_of_life_cycles"],
        clean=clean,
        end=end,
        size=size_of(hidden),
        seconds=time.monotonic() - began,
    )


def _estimate(estimate: dict[str, Any]) -> list[float]:
    """Value, deviation, and the 90 % interval."""
    value, sd = estimate["value"], estimate["sd"]
    return [value, sd, *estimate.get("interval", (value - 1.645 * sd, value + 1.645 * sd))]


def commit() -> str:
    asked = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    said = subprocess.run(asked, capture_output=True, text=True, check=False)
    return said.stdout.strip() or "unknown"


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


def asked(http: httpx2.Client, method: str, path: str, **sent: Any) -> dict[str, Any]:
    """The service's answer; while it is busy, as beside other work on the machine, it is asked again when it says."""
    while (answer := http.request(method, path, **sent)).status_code == 503:
        time.sleep(float(answer.headers["Retry-After"]))
    return dict(answer.raise_for_status().json())


@contextmanager
def _posted(hidden: Hidden, fraction: float) -> Iterator[TestClient]:
    """A service that has the runs of a clutch, whose addresses are relative to that clutch."""
    with (
        tempfile.TemporaryDirectory() as folder,
        client_on(f"sqlite:///{Path(folder) / 'a.db'}", max_body_mb=64) as http,
    ):
        clutch = {"clutch_id": "blind", "origin": "simulated", "end_of_life": {"cof_fraction": fraction}}
        asked(http, "POST", "/v1/clutches", json=clutch)
        http.base_url = http.base_url.join(CLUTCH)
        for run in runs(hidden):
            asked(http, "POST", "runs", json=run | {"origin": "simulated"})
        yield http
