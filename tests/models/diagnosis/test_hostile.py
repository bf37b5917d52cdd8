"""Whatever a rig may send, a diagnosis is a report and never an exception."""

import math
from dataclasses import dataclass

import numpy as np
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun, EventKind, MaintenanceEvent, StationaryRun
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.report.report import Report
from models.records.runs import Plateaus, Record
from tests.models.diagnosis.campaigns import look


@dataclass(frozen=True)
class Recipe:
    """What makes a campaign, small enough to be printed."""

    seed: int
    scale: float
    shape: str
    rows: tuple[int, ...]
    loops: tuple[int, ...]
    temperature: bool
    blocks: int
    events: tuple[EventKind, ...]

    def campaign(self) -> Campaign:
        rng = np.random.default_rng(self.seed)
        steady = [
            _stationary(rng, k, rows, self.scale, self.shape, self.temperature) for k, rows in enumerate(self.rows)
        ]
        moving = [_dynamic(rng, k, rows, self.scale, self.shape) for k, rows in enumerate(self.loops)]
        duty = [
            DutyRun(cycles=100.0 * k, engagements=100.0, energy=float(rng.choice([1.0, 1e4])))
            for k in range(self.blocks)
        ]
        events = [
            MaintenanceEvent(cycles=float(rng.integers(0, 300)), event=kind) for k, kind in enumerate(self.events)
        ]
        return Campaign(stationary=tuple(steady), dynamic=tuple(moving), duty=tuple(duty), maintenance=tuple(events))


RECIPES = st.builds(
    Recipe,
    seed=st.integers(0, 10**6),
    scale=st.sampled_from([1e-9, 1e-3, 1.0, 20.0, 1e6, 1e150]),
    shape=st.sampled_from(["flat", "noise", "falling", "zero", "signs", "repeated"]),
    rows=st.lists(st.integers(1, 60), max_size=4).map(tuple),
    loops=st.lists(st.sampled_from([4, 60, 900]), max_size=2).map(tuple),
    temperature=st.booleans(),
    blocks=st.integers(0, 3),
    events=st.lists(st.sampled_from(list(EventKind)), max_size=3).map(tuple),
)

#: Columns of smooth structure that hardly differ: rounding leaves their information below zero.
BEYOND_ROUNDING = Recipe(
    seed=408,
    scale=0.001,
    shape="noise",
    rows=(55,),
    loops=(60, 900),
    temperature=False,
    blocks=1,
    events=(EventKind.REST,),
)

#: What is left is to measure the oil's temperature.
WITHOUT_THERMOMETER = Recipe(
    seed=341, scale=1.0, shape="noise", rows=(9, 26, 1, 1), loops=(), temperature=False, blocks=0, events=()
)

#: Two effects that change the same rows in the same way, beside no noise at all.
TWO_THAT_ARE_ONE = Recipe(
    seed=916920, scale=1.0, shape="falling", rows=(58, 46, 21), loops=(900, 4), temperature=False, blocks=2, events=()
)


def _torque(rng: np.random.Generator, speed: np.ndarray, scale: float, shape: str) -> np.ndarray:
    base = {
        "flat": np.ones(speed.size),
        "noise": rng.standard_normal(speed.size),
        "falling": 2 - np.tanh(np.abs(speed) / 50),
        "zero": np.zeros(speed.size),
        "signs": np.sign(speed) * (1 + 0.1 * rng.standard_normal(speed.size)),
        "repeated": np.round(rng.standard_normal(speed.size)),
    }[shape]
    return np.asarray(scale * base, dtype=np.float64)


def _stationary(
    rng: np.random.Generator, number: int, rows: int, scale: float, shape: str, temperature: bool
) -> StationaryRun:
    speed = (
        rng.choice([-200.0, 0.0, 1e-6, 2.0, 50.0, 100.0, 205.0, 1e4], rows)
        if shape == "repeated"
        else (np.linspace(2.0, 206.0, rows))
    )
    pressure = rng.choice([1e-3, 4e5, 5e5, 7e5, 1e9], rows) if shape == "noise" else np.full(rows, 5e5)
    return StationaryRun(
        run_id=f"s{number}",
        cycles=float(rng.choice([0.0, 0.0, 100.0, 1e9])),
        moment=None if number % 2 else float(rng.integers(0, 10**9)),
        plateaus=Plateaus(
            pressure=pressure,
            speed=speed,
            torque=_torque(rng, speed, scale, shape),
            oil_temperature=np.full(rows, 350.0) + rng.standard_normal(rows) if temperature else None,
        ),
    )


def _dynamic(rng: np.random.Generator, number: int, rows: int, scale: float, shape: str) -> DynamicRun:
    time = np.sort(rng.uniform(0, 15, rows)) if shape == "noise" else np.linspace(0, 15, rows)
    speed = 100 * (1 - np.cos(2 * math.pi * 0.1 * time)) if shape != "signs" else 100 * np.cos(time)
    return DynamicRun(
        run_id=f"d{number}",
        cycles=float(rng.choice([0.0, 100.0])),
        record=Record(time=time, pressure=np.full(rows, 5e5), speed=speed, torque=_torque(rng, speed, scale, shape)),
    )


def _finite(report: Report) -> bool:
    numbers = list(report.statistics.values())
    for each in report.candidates:
        numbers += [each.probability, each.log_evidence_gain, each.estimate.value, each.estimate.sd]
    if report.baseline is not None:
        numbers += [report.baseline.rmse, report.baseline.noise, report.baseline.unexplained_share]
    return all(math.isfinite(number) for number in numbers)


@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(recipe=RECIPES)
@example(recipe=BEYOND_ROUNDING)
@example(recipe=WITHOUT_THERMOMETER)
@example(recipe=TWO_THAT_ARE_ONE)
def test_a_diagnosis_is_a_report(recipe: Recipe) -> None:
    report = look(recipe.campaign(), 0)
    assert report.summary
    assert _finite(report)
    assert all(0 <= each.probability <= 1 + 1e-9 for each in report.candidates)
    if report.verdict in {Verdict.MODEL_ADEQUATE, Verdict.INSUFFICIENT_DATA, Verdict.UNEXPLAINED_STRUCTURE}:
        assert not report.causes
