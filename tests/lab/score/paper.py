"""What is said of slope, shudder, lag and severity on simulated lives whose truth is known, as the service has them."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from models.friction.criteria import Z90
from models.friction.stribeck import StribeckParameters, slope
from models.loops.lag_fit import StationaryCurve
from models.loops.loops import evaluate_loops
from models.prognosis.first_passage import weighted_quantiles
from models.rig.hysteresis import FrictionLag
from models.rig.sampled import DynamicTest, sampled_test
from models.rig.stationary import Sensor, stationary_test
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch, draw
from service.api.life import CriterionIn
from service.api.run import Evaluation
from service.channels import RADIANS_PER_SECOND_PER_RPM
from service.clutch.analysis import LevelFit, levels_of, mean_cofs
from service.clutch.assumptions import Assumptions
from service.clutch.criteria import SEVERITY_EXPONENTS
from service.clutch.items import loop_items
from service.clutch.quantities.ends import criterion_end
from service.clutch.quantities.measured import QUANTITIES, SLOPE_SPEEDS, MeasuredLife, posterior_of
from service.clutch.severity_estimate import severity_estimate
from service.clutch.timeline import DYNAMIC, STATIONARY, Event, Life, reference_velocities
from tests.lab.score.table import Scores, percents, written
from tests.service.clutch import test_assumptions as of_severity

#: The pressure level that is scored [bar], and its place among the protocol's.
LEVEL, PLACE = 5.0, 2
SHUDDER_RPM = 100.0
STAGES, TESTS = (0.4, 0.6, 0.8, 1.2), 18
_PRESSURE = float(PROTOCOL_PRESSURES[PLACE])
#: The energy of a cycle by stage of life [J]: what is said of large steps, and of small ones.
STEPS = {"10, 20, 40 kJ": (10e3, 20e3, 40e3), "20, 24 kJ": (20e3, 24e3)}


def measured_life(
    clutch: SimulatedClutch, cycles: Sequence[float], rng: np.random.Generator, dynamic: DynamicTest | None = None
) -> MeasuredLife:
    """A life with a stationary test, and a dynamic one where it is given, at each of `cycles`."""
    events: list[Event] = []
    levels, receipts = dict[str, list[LevelFit]](), dict[str, Evaluation]()
    for index, at in enumerate(cycles):
        plateaus = stationary_test(clutch, at, rng)
        fitted = levels_of(plateaus, clutch.geometry)
        speeds = float(plateaus.speed.min()), float(plateaus.speed.max())
        cofs = mean_cofs(fitted, reference_velocities(speeds, clutch.geometry), clutch.geometry)
        name = f"test-{index}"
        levels[name] = list(fitted)
        events.append(Event(run_id=name, kind=STATIONARY, cycles=at, moment=2.0 * index, speed_range=speeds, cofs=cofs))
        if dynamic is not None:
            record = sampled_test(clutch, at, dynamic, rng, Sensor())
            fit = fitted[PLACE].fit
            loops = evaluate_loops(record, clutch.geometry, {fit.pressure: StationaryCurve.of(fit)})
            receipts[f"loops-{index}"] = Evaluation.model_construct(loops=loop_items(loops))
            events.append(Event(run_id=f"loops-{index}", kind=DYNAMIC, cycles=at, moment=2.0 * index + 1.0))
    return MeasuredLife(
        life=Life(origin=0.0, events=tuple(events)),
        assumptions=Assumptions(),
        geometry=clutch.geometry,
        fraction=0.5,
        levels=levels,
        receipts=receipts,
    )


def until(measured: MeasuredLife, cycles: float) -> MeasuredLife:
    """The life as it was at so many cycles."""
    events = tuple(event for event in measured.life.events if event.cycles <= cycles * (1.0 + 1e-9))
    return replace(measured, life=replace(measured.life, events=events))


def slopes(count: int, seed: int) -> str:
    """How often the 90 % interval of one test's slope holds the truth, by speed and by stage of life."""
    states = (0.0, 1_000.0, 3_000.0, 6_000.0, 12_000.0)
    held: dict[float, list[list[bool]]] = {speed: [[] for _ in states] for speed in SLOPE_SPEEDS}
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        clutch = draw(rng)
        measured = measured_life(clutch, states, rng)
        for series in measured.series(QUANTITIES["slope"]):
            speed = series.speed_rpm or 0.0
            for test, event in zip(series.measurements, series.events, strict=True):
                truth = _slope(clutch, series.pressure, speed, test.progress)
                held[speed][event].append(abs(test.value - truth) <= Z90 * test.variance**0.5)
    rows = (
        (
            f"{speed:g}",
            f"{percents(float(np.mean(each)) for each in by_state)} %",
            f"{100 * np.mean(np.concatenate(by_state)):.1f} %",
        )
        for speed, by_state in held.items()
    )
    return written(
        f"{count} clutches, seed {seed}, 7 pressures, 1 % noise; 90 % intervals of dμ/dv of one test",
        "speed [rpm] | held at 0/1,000/3,000/6,000/12,000 cycles | held in all",
        rows,
    )


def shudder(count: int, seed: int) -> str:
    """How often the 90 % interval of the cycles until friction falls with speed holds the truth, by stage of that life."""
    scores, of_slope = Scores(), {stage: list[float]() for stage in STAGES}
    criterion = CriterionIn(quantity="slope", pressure_bar=LEVEL, speed_rpm=SHUDDER_RPM)
    for index, (clutch, end) in enumerate(_shuddering(count, seed)):
        rng = np.random.default_rng([seed, index])
        cycles = np.linspace(0.0, STAGES[-1] * end, TESTS).tolist()
        whole = measured_life(clutch, cycles, rng)
        for stage in STAGES:
            measured = until(whole, stage * end)
            found = criterion_end(measured, criterion, "grid")
            scores.add_sample("", stage, np.minimum(found.ends[0], 1e7), found.ends[1], end)
            truth = _slope(clutch, _PRESSURE, SHUDDER_RPM, measured.life.events[-1].cycles)
            of_slope[stage].append((found.current[0] - truth) / found.current[1])
    rows = []
    for stage, each in of_slope.items():
        off = np.array(each)
        shares = (f"{100 * scores.column('', stage, what).mean():.1f} %" for what in ("held", "late", "early"))
        middles = (f"{np.median(scores.column('', stage, what)):.2f}" for what in ("median", "width"))
        errors = f"{off.mean():+.2f}, {np.sqrt(np.mean(off**2)):.2f}"
        rows.append((f"{stage:.0%}", *shares, *middles, f"{100 * np.mean(np.abs(off) <= Z90):.1f} %", errors))
    return written(
        f"{count} lives, seed {seed}: dμ/dv < 0 at {SHUDDER_RPM:g} rpm and {LEVEL:g} bar, a test every 7 % of that life",
        "stage of life | held | begins after the end | ends before it | median over truth | width over life "
        "| slope then: held | error, deviations: mean, root mean square",
        rows,
    )


def lag(count: int, seed: int) -> str:
    """How often the 90 % bands of the tracks of film time and attractor hold the truth, by stage of life."""
    rows = []
    for name in ("film_time", "attractor"):
        held, valued = [], []
        for index in range(count):
            rng = np.random.default_rng([seed, index])
            drawn = draw(rng)
            attractor = float(np.exp(rng.uniform(np.log(60.0), np.log(300.0))))
            clutch = (
                drawn if name == "film_time" else replace(drawn, lag=FrictionLag(film_time=0.0, attractor=attractor))
            )
            end = clutch.end_of_life() or 15_000.0
            whole = measured_life(clutch, np.linspace(0.0, 1.2 * end, TESTS).tolist(), rng, DynamicTest())
            of_life = []
            for stage in STAGES:
                measured = until(whole, stage * end)
                series = next(s for s in measured.series(QUANTITIES[name]) if abs(s.pressure - _PRESSURE) < 1.0)
                posterior = posterior_of(series)
                place = series.measurements[-1].progress
                low, high = weighted_quantiles(
                    posterior.values(np.array([place]))[0], posterior.weight, (0.05, 0.95)
                ).tolist()
                truth = float(clutch.lag.film_time_at(np.array(_PRESSURE), place)) if name == "film_time" else attractor
                of_life.append(low <= truth <= high)
            held.append(of_life)
            valued.append(len(series.measurements) / TESTS)
        shares = percents(np.mean(held, axis=0).tolist())
        rows.append((name, f"{100 * np.mean(valued):.0f} %", f"{shares} %", f"{100 * np.mean(held):.1f} %"))
    return written(
        f"{count} lives a law, seed {seed}, {TESTS} dynamic tests of 0.1 Hz at {LEVEL:g} bar",
        "law | tests with a value | band of the track holds the truth at 40/60/80/120 % of life | held in all",
        rows,
    )


def severity(count: int, seed: int) -> str:
    """The exponent of severity from the tests of one life whose duty steps: by energies and true exponent, lives in which it
    is the most probable one, and its mean probability."""
    rows = []
    for name, steps in STEPS.items():
        for exponent in (0.0, 1.0, 2.0):
            lives = (of_severity.life(exponent, steps, seed + index) for index in range(count))
            known = [each for each in (severity_estimate(life, Assumptions()) for life in lives) if each is not None]
            right = np.mean([each.likeliest == exponent for each in known])
            believed = np.mean([each.probability[SEVERITY_EXPONENTS.index(exponent)] for each in known])
            off = np.mean([abs(each.mean - exponent) for each in known])
            rows.append((name, f"{exponent:g}", f"{right:.0%}", f"{believed:.2f}", f"{off:.2f}"))
    weighed = ", ".join(f"{exponent:g}" for exponent in SEVERITY_EXPONENTS)
    return written(
        f"{count} lives of eq. 6 each, seed {seed}, {of_severity.TESTS} tests, "
        f"scatter {of_severity.SCATTER:.1%} of the value; exponents weighed: {weighed}",
        "energy of a cycle | true exponent | found | its probability, mean | off by, mean",
        rows,
    )


def _slope(clutch: SimulatedClutch, pressure: float, speed_rpm: float, cycles: float) -> float:
    velocity = clutch.geometry.sliding_velocity(np.array(speed_rpm * RADIANS_PER_SECOND_PER_RPM))
    return float(slope(velocity, clutch.parameters(pressure, cycles))) / clutch.geometry.torque_per_cof(pressure)


def _shuddering(count: int, seed: int) -> Iterator[tuple[SimulatedClutch, float]]:
    """Clutches whose friction begins to fall with speed at 5 bar within the cycles of a life test, and when."""
    places = np.linspace(0.0, 20_000.0, 2_001)
    found = 0
    for index in range(100 * count):
        clutch = draw(np.random.default_rng([seed, index, 1]))
        parameters = clutch.parameters(np.full(places.size, _PRESSURE), places)
        velocity = clutch.geometry.sliding_velocity(np.array(SHUDDER_RPM * RADIANS_PER_SECOND_PER_RPM))
        course = slope(velocity, StribeckParameters.from_array(parameters.as_array()))
        below = np.flatnonzero(course < 0.0)
        if below.size and below[0] > 50:
            after = int(below[0])
            share = course[after - 1] / (course[after - 1] - course[after])
            yield clutch, float(places[after - 1] + share * (places[after] - places[after - 1]))
            found += 1
        if found == count:
            return
