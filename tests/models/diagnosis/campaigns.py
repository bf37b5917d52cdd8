"""Campaigns for the tests of the diagnosis, and what was fitted to them.

Small ones have something planted where a test asks for it. Their clutch is the simulated rig's; loops follow the
attractor law in time, from rest, so that neither the periodic solution nor the phase bins of the diagnosis are used to
make what it is tested on.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Laws, Scene
from models.diagnosis.baseline.prediction import frame_of, predict
from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun, StationaryRun
from models.diagnosis.design.design import Design, build_design
from models.diagnosis.diagnose import diagnose
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import FROM_THE_START, Shape
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.pooled_fit.baseline_fit import Baseline, fit_baseline, starting_laws
from models.diagnosis.pooled_fit.gauss_newton import PooledFit, fit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.report.report import Report
from models.friction.stribeck import StribeckParameters, torque
from models.records.runs import Plateaus, Record
from models.relaxation import relax
from models.rig import campaign as rig
from models.rig.hidden import clutch_for, hidden_in
from models.rig.programme import RigProgramme
from models.rig.sampled import DynamicTest
from models.rig.simulated_runs import SimulatedRun
from models.rig.stationary import SHARP
from models.rig.truth import SimulatedClutch, draw

RPM = 2 * np.pi / 60
PRESSURES = np.linspace(4e5, 7e5, 5)
SPEEDS = np.linspace(20.0, 1970.0, 24) * RPM
CYCLES = (0.0, 1000.0, 3000.0, 6000.0, 10000.0, 15000.0)


@dataclass(frozen=True)
class Where:
    """Rows of a test, as a planted effect sees them: velocity [m/s], pressure [Pa], cycles, oil temperature [K], clock
    [s], acceleration [m/s²] (0 on plateaus), and the parameters there."""

    velocity: FloatArray
    pressure: FloatArray
    cycles: float
    temperature: FloatArray
    clock: FloatArray
    acceleration: FloatArray
    parameters: StribeckParameters
    dynamic: bool


Planted = Callable[[Where], FloatArray]
#: δ [n] of friction at velocity [n] m/s, pressure [n] Pa and cycles, which loops show with their lag.
Form = Callable[[FloatArray, FloatArray, float], FloatArray]


def exact(velocity: FloatArray, _pressure: FloatArray, _cycles: float) -> FloatArray:
    """Eq. 3."""
    return np.zeros_like(velocity)


def campaign(
    seed: int,
    planted: Planted | None = None,
    *,
    cycles: tuple[float, ...] = CYCLES,
    loops: bool = True,
    temperature: bool = True,
    noise: float = 0.01,
    gain: float = 0.002,
    form: Form = exact,
    both_ways: bool = False,
) -> Campaign:
    """A campaign with `planted` added to its torque, friction of another `form` than eq. 3, every second sweep downwards
    where speeds go `both_ways`; noise and gain 0: the bare truth."""
    rng = np.random.default_rng(seed)
    clutch = draw(rng)

    def torque_of(bare: FloatArray, where: Where) -> FloatArray:
        return bare if planted is None else bare + planted(where)

    stationary, dynamic = [], []
    for number, state in enumerate(cycles):
        head = {"cycles": state, "moment": 1e9 + 86400.0 * number}
        speeds = SPEEDS[::-1] if both_ways and number % 2 else SPEEDS
        plateaus = _plateaus(state, clutch, rng, torque_of, noise, gain, form, speeds)
        stationary.append(StationaryRun(run_id=f"stationary-{number}", **head, plateaus=plateaus))
        if loops:
            record = _record(state, clutch, rng, torque_of, noise, gain, form)
            head["moment"] += 2000.0
            dynamic.append(DynamicRun(run_id=f"dynamic-{number}", **head, record=record))
    given = Campaign(stationary=tuple(stationary), dynamic=tuple(dynamic))
    return given if temperature else without_temperature(given)


Columns = Callable[[Any], dict[str, FloatArray | None]]


def altered(given: Campaign, steady: Columns = lambda _: {}, moving: Columns = lambda _: {}) -> Campaign:
    """The campaign with columns of its plateaus and of its records changed: to what the functions make of each run."""
    stationary = [replace(run, plateaus=replace(run.plateaus, **steady(run))) for run in given.stationary]
    dynamic = [replace(run, record=replace(run.record, **moving(run))) for run in given.dynamic]
    return replace(given, stationary=tuple(stationary), dynamic=tuple(dynamic))


def without_temperature(given: Campaign) -> Campaign:
    """As rigs without a thermometer send it."""
    return altered(given, lambda _: {"oil_temperature": None}, lambda _: {"oil_temperature": None})


def _plateaus(
    state: float,
    clutch: SimulatedClutch,
    rng: np.random.Generator,
    torque_of: Callable[[FloatArray, Where], FloatArray],
    noise: float,
    gain: float,
    form: Form,
    speeds: FloatArray,
) -> Plateaus:
    pressure, speed = np.repeat(PRESSURES, speeds.size), np.tile(speeds, PRESSURES.size)
    clock = 5.0 * np.arange(speed.size) + 2.5
    swing = rng.uniform(2.0, 4.0) * np.sin(2 * np.pi * clock / rng.uniform(400.0, 900.0) + rng.uniform(0.0, 6.0))
    oil = 358.15 + swing
    parameters = clutch.parameters(pressure, state)
    velocity = clutch.geometry.sliding_velocity(speed)
    at = Where(velocity, pressure, state, oil, clock, np.zeros_like(velocity), parameters, dynamic=False)
    true = torque_of(torque(velocity, parameters) * (1.0 + form(velocity, pressure, state)), at)
    measured = true * (1 + gain * rng.standard_normal()) * (1 + noise * rng.standard_normal(true.size))
    return Plateaus(pressure=pressure, speed=speed, torque=measured, oil_temperature=oil)


def _record(
    state: float,
    clutch: SimulatedClutch,
    rng: np.random.Generator,
    torque_of: Callable[[FloatArray, Where], FloatArray],
    noise: float,
    gain: float,
    form: Form,
) -> Record:
    time = np.arange(0.0, 15.0, 0.02)
    speed = 1000 * RPM * (1 - np.cos(2 * np.pi * 0.1 * time))
    velocity = clutch.geometry.sliding_velocity(speed)
    acceleration = clutch.geometry.sliding_velocity(1000 * RPM * 2 * np.pi * 0.1 * np.sin(2 * np.pi * 0.1 * time))
    factor = 1 + gain * rng.standard_normal()
    oil = np.full_like(time, 358.15)
    parts = []
    for level, pressure in enumerate(PRESSURES):
        full, clock = np.full_like(time, pressure), time + 15 * level
        one = StribeckParameters.from_array(clutch.parameters(float(pressure), state).as_array())
        at = Where(velocity, full, state, oil, clock, acceleration, one, dynamic=True)
        sliding = np.maximum(velocity, 1e-4)
        curve = torque(sliding, one) * (1.0 + form(sliding, full, state))
        true = torque_of(relax(time, 250.0 / curve, curve, curve[0]), at)
        measured = true * factor * (1 + noise * rng.standard_normal(time.size))
        parts.append({"time": clock, "pressure": full, "speed": speed, "torque": measured, "oil_temperature": oil})
    return Record(**{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})


# --- As `clutchlife simulate` writes them, with or without --hide.


def rehearsal(
    seed: int,
    hidden: Mapping[str, float] | None = None,
    *,
    dynamic: bool = True,
    tests: int = 40,
    noise: float | None = None,
) -> Campaign:
    """A simulated campaign; without `hidden` (sizes by slug) the one of `clutchlife simulate --seed SEED`."""
    sizes = hidden or {}
    clutch = clutch_for(rig.simulated_clutch(seed), sizes)
    sensor = SHARP if noise is None else replace(SHARP, noise=noise)
    programme = RigProgramme(dynamic=DynamicTest() if dynamic else None, engagements=True)
    runs = rig.simulate(seed, clutch=clutch, sensor=sensor, programme=programme, most_tests=tests)
    return campaign_of(hidden_in(run, clutch, sizes) for run in runs)


def campaign_of(runs: Iterable[SimulatedRun]) -> Campaign:
    stationary, moving, duty = [], [], []
    for run in runs:
        head = {"run_id": run.run_id, "cycles": float(run.cycles)}
        if run.plateaus is not None:
            stationary.append(StationaryRun(**head, plateaus=run.plateaus))
        elif run.duty is not None:
            energy = run.duty.energy_per_cycle
            duty.append(DutyRun(cycles=float(run.cycles), engagements=run.duty.cycles, energy=energy))
        elif run.record is not None:
            moving.append(DynamicRun(**head, record=run.record))
    return Campaign(stationary=tuple(stationary), dynamic=tuple(moving), duty=tuple(duty))


# --- Fitted once for the tests of what follows from a fit: a baseline, and one or several extended models.


@dataclass(frozen=True)
class Study:
    """A campaign, its design and its baseline."""

    campaign: Campaign
    design: Design
    baseline: Baseline

    @property
    def problem(self) -> FitProblem:
        return self.baseline.problem

    def extended(self, *effects: tuple[str, float, Shape]) -> PooledFit:
        """The baseline with effects (slug, first amplitude, shape) fitted along."""
        start = [of_size(slug, first, shape) for slug, first, shape in effects]
        return fit(self.problem, self.baseline.fit.laws, start)


def of_size(slug: str, amplitude: float, shape: Shape) -> FittedEffect:
    """An effect as large and formed so, at work from the start where the shape does not say from when on."""
    effect = BY_SLUG[slug]
    missing = effect.has_onset and len(shape) < len(effect.shapes)
    return FittedEffect(effect=effect, amplitude=amplitude, shape=(*shape, FROM_THE_START) if missing else shape)


def study(campaign: Campaign) -> Study:
    design = build_design(campaign)
    return Study(campaign, design, fit_baseline(design))


def start_of(design: Design) -> Laws:
    """The laws that a fit of the baseline starts from."""
    return starting_laws(design, frame_of(design))


def with_theta(laws: Laws, place: Any, values: Any) -> Laws:
    theta = laws.theta.copy()
    theta[place] = values
    return replace(laws, theta=theta)


def scene_of(given: Campaign) -> Scene:
    """What effects see of a campaign, before any fit."""
    design = build_design(given)
    return predict(design, start_of(design)).scene


def look(given: Campaign, seed: int = 5, **options: bool) -> Report:
    return diagnose(given, rng=np.random.default_rng(seed), **options)


def warmth(at: Where) -> FloatArray:
    """Torque falls by 0.3 % of its viscous part a kelvin: no formula of viscosity."""
    viscous = at.parameters.viscous_coefficient * at.velocity**0.3
    return np.asarray(-0.03 * viscous * (at.temperature - 358.15), dtype=np.float64)


def bump(at: Where) -> FloatArray:
    """Three percent more torque about 3 m/s: outside of the catalogue."""
    level = at.pressure / 4e5 * 20
    return np.asarray(0.02 * level * np.exp(-0.5 * ((at.velocity - 3.0) / 0.8) ** 2), dtype=np.float64)
