"""Campaigns of the simulated rig, in every way in which honest people run one; plausibility was developed on these."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import numpy as np

from models.rig.campaign import simulate, simulated_clutch
from models.rig.programme import RigProgramme
from models.rig.sampled import DynamicTest, RawTest
from models.rig.simulated_runs import DutyBlock, RunKind, SimulatedRun
from models.rig.stationary import Sensor, stationary_test
from models.rig.truth import SimulatedClutch
from service.runs.simulated import simulated_body
from tests.lab.plausibility.bench import Body, with_gain

BEGUN = datetime(2026, 1, 5, 8, tzinfo=UTC)
SCHEDULES = ("rig", "even", "geometric", "bursts", "uneven", "pause")


@dataclass(frozen=True)
class Campaign:
    """Runs in the order in which they were made, the clutch's record, and where it is from."""

    source: str
    runs: list[Body]
    record: Body


def schedule(rng: np.random.Generator, style: str) -> list[int]:
    """Cycles of the tests, ascending."""
    count = int(rng.integers(6, 14))
    if style == "even":
        step = int(rng.choice([250, 500, 1000, 1200, 2000]))
        return [k * step for k in range(count)]
    if style == "geometric":
        factor = float(rng.choice([2.0, 3.0, 10.0]))
        first = 10 if factor > 5 else 100
        return [0, *(round(first * factor**k) for k in range(5 if factor > 5 else 8))]
    if style == "bursts":
        starts = np.cumsum(rng.integers(1500, 5000, 4))
        return [0, *sorted({int(start + k * 50) for start in starts for k in range(3)})]
    if style == "pause":  # a long one without tests, declared by its duty block
        early = [k * 500 for k in range(int(rng.integers(4, 8)))]
        return [*early, early[-1] + int(rng.integers(5_000, 40_000))]
    gaps = np.exp(rng.normal(np.log(1000), 0.8, count))
    return [0, *np.cumsum(np.round(gaps)).astype(int).tolist()]


def campaign(rng: np.random.Generator, *, style: str | None = None, dynamic: bool | None = None) -> Campaign:
    """A campaign drawn in every respect."""
    seed, style = int(rng.integers(1 << 31)), style or str(rng.choice(SCHEDULES))
    noise = Sensor(noise=0.01 * rng.uniform(0.5, 2.0), gain_scatter=0.002 * rng.uniform(0.5, 3.0))
    with_dynamic = bool(rng.random() < 0.3) if dynamic is None else dynamic
    raw = style == "rig" and not with_dynamic and rng.random() < 0.1
    if style == "rig":
        programme = RigProgramme(
            dynamic=DynamicTest(rate=20.0) if with_dynamic else None,
            raw=RawTest(rate=10.0) if raw else None,
            engagements=bool(rng.random() < 0.3),
        )
        made = list(simulate(seed, sensor=noise, programme=programme, most_tests=4 if raw else 16))
    else:
        made = _made(rng, seed, schedule(rng, style), noise)
    runs = [simulated_body(run) | {"run_id": f"{number:03d}-{run.kind}"} for number, run in enumerate(made)]
    if style != "pause" and rng.random() < 0.3:  # no duty blocks are sent
        runs = [run for run in runs if "duty" not in run]
    if rng.random() < 0.4:
        runs = _maintained(rng, runs)
    if rng.random() < 0.15 and style != "rig":
        runs = _rebuilt(rng, runs, seed, noise)
    if rng.random() < 0.4:
        runs = _dated(rng, runs)
    return Campaign(source=f"simulated rig, {style}", runs=runs, record={"origin": "simulated"})


def _made(rng: np.random.Generator, seed: int, cycles: list[int], sensor: Sensor) -> list[SimulatedRun]:
    clutch = simulated_clutch(seed)
    runs, before = [], 0
    for at in cycles:
        if at > before:
            block = DutyBlock(cycles=at - before, energy_per_cycle=18e3, initial_speed=200.0, maximum_pressure=8e5)
            runs.append(SimulatedRun(run_id=f"sim-d{at}", kind=RunKind.DUTY_CYCLES, cycles=at, duty=block))
        runs.append(_test(clutch, at, at, rng, sensor))
        before = at
    return runs


def _test(clutch: SimulatedClutch, cycles: int, wear: float, rng: np.random.Generator, sensor: Sensor) -> SimulatedRun:
    plateaus = stationary_test(clutch, wear, rng, sensor)
    return SimulatedRun(run_id=f"sim-s{cycles}", kind=RunKind.STATIONARY_STRIBECK, cycles=cycles, plateaus=plateaus)


def _maintained(rng: np.random.Generator, runs: list[Body]) -> list[Body]:
    """Oil is changed, the level shifts by a few per cent from there on; rests, which change nothing."""
    kept = list(runs)
    latest = max(run["cycles"] for run in runs)
    for kind in rng.choice(["oil_change", "rest", "sensor_zero", "other"], int(rng.integers(1, 3))):
        at = int(rng.integers(0, latest + 1)) if rng.random() < 0.5 else int(rng.choice([r["cycles"] for r in runs]))
        shift = 1.0 + (0.04 * rng.standard_normal() if kind == "oil_change" else 0.0)
        kept = [with_gain(run, shift) if run["cycles"] > at and "channels" in run else run for run in kept]
        index = next((k for k, run in enumerate(kept) if run["cycles"] > at), len(kept))
        if index < len(kept) and "duty" in kept[index]:  # within a block, which began before
            index += 1
        kept.insert(index, {"run_id": f"m-{kind}-{at}", "kind": "maintenance", "event": str(kind), "cycles": at})
    return kept


def _rebuilt(rng: np.random.Generator, runs: list[Body], seed: int, sensor: Sensor) -> list[Body]:
    """A new lining after the campaign: COF is back where it was, cycles go on."""
    latest = max(int(run["cycles"]) for run in runs)
    after: list[Body] = [{"run_id": "rebuild", "kind": "maintenance", "event": "rebuild", "cycles": latest}]
    clutch, before = simulated_clutch(seed + 1), 0
    for since in schedule(rng, "even")[:5]:
        if since > before:
            duty = {"cycles": since - before, "energy_per_cycle_kj": 18.0}
            after.append({"run_id": f"rd{since}", "kind": "duty_cycles", "cycles": latest + since, "duty": duty})
        body = simulated_body(_test(clutch, latest + since, since, rng, sensor))
        after.append(body | {"run_id": f"rs{since}", "cycles": latest + since})
        before = since
    return [*runs, *after]


def _dated(rng: np.random.Generator, runs: list[Body]) -> list[Body]:
    """When each run was started; the rig idles at times."""
    dated, now, before = [], BEGUN, 0.0
    for run in runs:
        begun = now
        now += timedelta(seconds=20.0 * max(run["cycles"] - before, 0.0) + 1500.0)
        if rng.random() < 0.1:
            now += timedelta(days=float(rng.exponential(5.0)))
        before = run["cycles"]
        dated.append(run | {"started_at": begun.isoformat()})
    return dated


def shuffled(rng: np.random.Generator, made: Campaign) -> Campaign:
    """The same runs as they may arrive: in any order, or with one late. What follows a rebuild arrives after it."""
    rebuilt = next((k for k, run in enumerate(made.runs) if run.get("event") == "rebuild"), len(made.runs))
    first, rest = list(made.runs[:rebuilt]), list(made.runs[rebuilt:])
    if rng.random() < 0.5:
        first = [first[k] for k in rng.permutation(len(first))]
        rest = [*rest[:1], *(rest[1:][k] for k in rng.permutation(len(rest[1:])))]
        return replace(made, runs=first + rest, source=f"{made.source}, shuffled")
    late = first.pop(int(rng.integers(len(first))))
    first.insert(int(rng.integers(len(first) + 1)), late)
    return replace(made, runs=first + rest, source=f"{made.source}, one late")
