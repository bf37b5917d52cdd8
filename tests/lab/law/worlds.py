"""Campaigns whose friction law is not eq. 3, with what is hidden in them: measured surfaces of friction, eq. 3 with a share
of their misfit, and other formulas on the blind rig.

Measured curves lie beside the project (`../shared/data/real_friction_curves`), not in it: where they are missing, so are
those campaigns.
"""

import importlib.util
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign
from service.api.clutch import ClutchIn
from service.clutch.diagnosis.campaign import campaign_of, run_of
from service.runs.json_run import read_run
from tests.lab.blind.rig import clutch as rig
from tests.lab.blind.rig.hide import hide
from tests.lab.blind.rig.sent import campaign
from tests.lab.measuring import ROOT

CURVES = Path("data/real_friction_curves/real_curves.py")
#: e^{-1/u} = 1/2 at u = 1.44: each form has fallen by half at the speed at which eq. 3 has.
_HALF = 1.0 / np.log(2.0)


@dataclass(frozen=True)
class World:
    """A campaign and what is true of it."""

    campaign: Campaign
    cause: str | None  # what is hidden, by its name in the catalogue
    size: float  # [unit of the catalogue], its sign at least


def measured() -> Path | None:
    """Where the measured curves are, if they are."""
    path = ROOT.parent / "shared" / CURVES
    return path if path.exists() else None


@cache
def _curves() -> ModuleType:
    path = measured()
    if path is None:
        raise FileNotFoundError(f"the measured curves are not here: {CURVES}")
    spec = importlib.util.spec_from_file_location("real_curves", path)
    if spec is None or spec.loader is None:
        raise FileNotFoundError(path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def of_curves(kind: str, seed: int) -> World:
    """A campaign of measured curves: `none`, `zero`, `oil`, `offset_late`, or one of these after `mild-` (eq. 3 with a share
    of a measured curve's misfit) or `control-` (eq. 3)."""
    clutch, runs, truth = _curves().one(kind, seed)
    record = ClutchIn.model_validate(clutch)
    taken = [run_of(read_run(json.dumps(run).encode()), origin=0.0) for run in runs]
    return World(campaign_of(record, taken), truth["expected"], truth["size"])


def sent_of_curves(kind: str, seed: int) -> tuple[dict[str, Any], list[dict[str, Any]], float]:
    """The same as it is sent, a clutch and its runs, and the cycles at which its true mean COF is half of the first."""
    clutch, runs, truth = _curves().one(kind, seed)
    return clutch | {"clutch_id": "measured"}, runs, float(truth["end"])


#: Shares of the fall g(u) of other Stribeck forms, u = v/V_S, each half fallen where eq. 3 is.
_FALLS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "tanh": lambda u: np.tanh(u / _HALF * np.arctanh(0.5)),
    "exponential": lambda u: -np.expm1(-u / _HALF * np.log(2.0)),
    "rational": lambda u: (u / _HALF) ** 2 / (1.0 + (u / _HALF) ** 2),
}
#: Forms on which nothing was chosen: a fall with a level start, one that never ends, one that is steepest at rest, and one
#: after a rise by a fifteenth of the fall.
_FURTHER_FALLS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "gaussian": lambda u: -np.expm1(-((u / _HALF) ** 2) * np.log(2.0)),
    "logarithm": lambda u: 0.5 * np.log2(1.0 + u / _HALF),
    "root": lambda u: -np.expm1(-np.sqrt(u / _HALF) * np.log(2.0)),
    "hump": lambda u: -np.expm1(-u / _HALF * np.log(2.0)) - 0.07 * np.exp(-(np.log(5.0 * u / _HALF + 1e-9) ** 2)),
}
#: Straight pressure laws bow by this share of a bar's change for each bar from 5 bar on.
_BOW = 0.04
#: From the middle of the life on every cycle counts so much more, with a corner of this width (a share of the life): a knee
#: in all four laws.
_KNEE, _CORNER = 1.5, 0.05
FORMULAS = (*_FALLS, "bowed", *_FURTHER_FALLS, "knee")


@contextmanager
def _formula(name: str) -> Iterator[None]:
    """While it lasts the blind rig's clutches have another law: a form of the fall, bowed laws over pressure, or laws with a
    knee over life."""
    torque, law, fall = rig.Law.torque, rig.Clutch.law, (_FALLS | _FURTHER_FALLS).get(name)

    def other(self: rig.Law, v: FloatArray, *, film: FloatArray | None = None, gamma: float = rig.GAMMA) -> FloatArray:
        w = np.maximum(v if film is None else film, 1e-9)
        return self.static * (1.0 + (self.ratio - 1.0) * fall(w / self.stribeck)) + self.viscous * v**gamma

    def bowed(self: rig.Clutch, bar: FloatArray, cycles: FloatArray) -> rig.Law:
        return law(self, bar - _BOW * (bar - 5.0) ** 2, cycles)

    def knee(self: rig.Clutch, bar: FloatArray, cycles: FloatArray) -> rig.Law:
        corner = _CORNER * self.span
        return law(self, bar, cycles + _KNEE * corner * np.logaddexp(0.0, (cycles - 0.5 * self.span) / corner))

    try:
        if fall is None:
            rig.Clutch.law = {"bowed": bowed, "knee": knee}[name]  # type: ignore[method-assign]
        else:
            rig.Law.torque = other  # type: ignore[method-assign]
        yield
    finally:
        rig.Law.torque, rig.Clutch.law = torque, law  # type: ignore[method-assign]


def of_formula(name: str, seed: int) -> World:
    """A campaign of the blind rig of another formula than eq. 3, nothing hidden but the wear of a knee; every second one
    has loops, every second pair a tenth of a percent of noise in place of a third."""
    with _formula(name):
        hidden = hide((seed, 2026, FORMULAS.index(name)), (), 0.0, loops=seed % 2 == 0, noise=(1.0, 0.3)[seed // 2 % 2])
        return World(campaign(hidden), *(("accelerated_wear", 1.0) if name == "knee" else (None, 0.0)))
