"""One trial: an effect is hidden, what the diagnosis offers is adopted, and remaining life is held against the truth.

Campaigns are those of the blind rig in its own forms (`tests.blind.rig`), lives end as in `tests.blind.lives`. What came of
a trial is stored, a file each, so that a run goes on where it ended.
"""

import json
import subprocess
import time
import zlib
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from tests.blind.lives import forecast_of, forecasts_of, passed_at
from tests.blind.rig.hide import Hidden, hide
from tests.blind.rig.loudness import UnreachableError
from tests.blind.rig.sent import runs
from tests.blind.rig.world import read
from tests.measuring import ROOT, kept

#: Artefacts that distort what is measured of a life, and what moves it.
ARTEFACTS = ("oil_temperature", "torque_zero_shift", "pressure_offset")
COURSES = ("running_in", "oil_change", "accelerated_wear", "load_severity")
#: How loud they are, and campaigns of each at each loudness with loops and as many without in the whole table; states.
LOUD, EACH, STATES = (80.0, 300.0), 20, 8
#: The end in lengths of what was measured; draws until one of them is the first passage of its own value.
SOONEST, LATEST, DRAWS = 1.3, 2.5, 20
STORE = ROOT / ".adoption"


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
class Campaign:
    """What is posted, the same runs without the artefact in the same noise (none of what moves a life), and the truth: the
    share of its first mean COF at which the clutch ends, its end [cycles], the artefact's size in the catalogue's unit and
    sense after the last state."""

    sent: list[dict[str, Any]]
    clean: list[dict[str, Any]]
    fraction: float
    end: float
    size: float


@dataclass(frozen=True)
class Adopted:
    """What came of a trial; `estimates` are by effect the value, its deviation and its 90 % interval, `before` and `after`
    the end's quantiles, `clean` those of the same runs with nothing hidden; all empty where no campaign could be made."""

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


def made(trial: Trial) -> Campaign | None:
    """The campaign of a trial; None where none of its draws can be made."""
    seed = (trial.seed, zlib.crc32(b"adoption"), zlib.crc32(trial.name.encode()))
    for k in range(DRAWS):
        try:
            hidden = hide((*seed, k), (trial.slug,), trial.lam, loops=trial.loops, states=STATES)
        except UnreachableError:
            continue
        end = float(np.random.default_rng([*seed, k]).uniform(SOONEST, LATEST) * hidden.plan.life.span)
        fraction = passed_at(hidden, end)
        if fraction is not None:
            clean = runs(without(hidden)) if trial.slug in ARTEFACTS else []
            return Campaign(runs(hidden), clean, fraction, end, size_of(hidden))
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
    campaign = made(trial)
    if campaign is None:
        return Adopted(trial, commit())
    began = time.monotonic()
    report, before, after = forecasts_of(campaign.sent, campaign.fraction)
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
        clean=forecast_of(campaign.clean, campaign.fraction)["end_of_life_cycles"] if campaign.clean else {},
        end=campaign.end,
        size=campaign.size,
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
