"""What is said of slope, shudder and lag on simulated lives of the rig, whose truth is known."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from models.friction.criteria import Z90
from models.friction.stribeck import StribeckParameters, slope
from models.prognosis.first_passage import weighted_quantiles
from models.rig.hysteresis import FrictionLag
from models.rig.sampled import DynamicTest
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch, draw
from service.columns import RADIANS_PER_SECOND_PER_RPM
from service.lives.quantities.ends import criterion_end
from service.lives.quantities.measured import QUANTITIES, SLOPE_SPEEDS, posterior_of
from service.schemas.life import CriterionIn
from tests.score.measured_lives import LEVEL, PLACE, measured_life, until

SHUDDER_RPM = 100.0
STAGES, TESTS = (0.4, 0.6, 0.8, 1.2), 18
_PRESSURE = float(PROTOCOL_PRESSURES[PLACE])


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
    lines = [
        f"{count} clutches, seed {seed}, 7 pressures, 1 % noise; 90 % intervals of dμ/dv of one test\n",
        "| speed [rpm] | held at 0/1,000/3,000/6,000/12,000 cycles | held in all |",
        "|---|---|---|",
    ]
    for speed, by_state in held.items():
        shares = "/".join(f"{100 * np.mean(each):.0f}" for each in by_state)
        lines.append(f"| {speed:g} | {shares} % | {100 * np.mean(np.concatenate(by_state)):.1f} % |")
    return "\n".join(lines)


def shudder(count: int, seed: int) -> str:
    """How often the 90 % interval of the cycles until friction falls with speed holds the truth, by stage of that life."""
    rows: dict[float, list[tuple[float, ...]]] = {stage: [] for stage in STAGES}
    criterion = CriterionIn(quantity="slope", pressure_bar=LEVEL, speed_rpm=SHUDDER_RPM)
    for index, (clutch, end) in enumerate(_shuddering(count, seed)):
        rng = np.random.default_rng([seed, index])
        cycles = np.linspace(0.0, STAGES[-1] * end, TESTS).tolist()
        whole = measured_life(clutch, cycles, rng)
        for stage in STAGES:
            measured = until(whole, stage * end * (1.0 + 1e-9))
            found = criterion_end(measured, criterion, "grid")
            if found.ends is None or found.current is None:
                raise AssertionError("there are tests enough at every stage")
            capped = np.minimum(found.ends[0], 1e7)
            low, middle, high = weighted_quantiles(capped, found.ends[1], (0.05, 0.5, 0.95)).tolist()
            truth = _slope(clutch, _PRESSURE, SHUDDER_RPM, measured.life.events[-1].cycles)
            off = (found.current[0] - truth) / found.current[1]
            ended = (low <= end <= high, low > end, high < end)
            rows[stage].append((*ended, abs(off) <= Z90, off, middle / end, (high - low) / end))
    lines = [
        f"{count} lives, seed {seed}: dμ/dv < 0 at {SHUDDER_RPM:g} rpm and {LEVEL:g} bar, a test every 7 % of that life\n",
        "| stage of life | held | begins after the end | ends before it | median over truth | width over life "
        "| slope then: held | error, deviations: mean, root mean square |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for stage, each in rows.items():
        held, late, early, now = (100 * np.mean(column) for column in np.array(each).T[:4])
        off = np.array(each)[:, 4]
        ratio, width = np.median(np.array(each)[:, 5:], axis=0).tolist()
        ends = f"{held:.1f} % | {late:.1f} % | {early:.1f} % | {ratio:.2f} | {width:.2f}"
        lines.append(f"| {stage:.0%} | {ends} | {now:.1f} % | {off.mean():+.2f}, {np.sqrt(np.mean(off**2)):.2f} |")
    return "\n".join(lines)


def lag(count: int, seed: int) -> str:
    """How often the 90 % bands of the tracks of film time and attractor hold the truth, by stage of life."""
    lines = [
        f"{count} lives a law, seed {seed}, {TESTS} dynamic tests of 0.1 Hz at {LEVEL:g} bar\n",
        "| law | tests with a value | band of the track holds the truth at 40/60/80/120 % of life | held in all |",
        "|---|---|---|---|",
    ]
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
                at = stage * end * (1.0 + 1e-9)
                measured = until(whole, at)
                series = next(s for s in measured.series(QUANTITIES[name]) if abs(s.pressure - _PRESSURE) < 1.0)
                posterior = posterior_of(series, measured.assumptions)
                place = series.measurements[-1].progress
                low, high = weighted_quantiles(
                    posterior.values(np.array([place]))[0], posterior.weight, (0.05, 0.95)
                ).tolist()
                truth = float(clutch.lag.film_time_at(np.array(_PRESSURE), place)) if name == "film_time" else attractor
                of_life.append(low <= truth <= high)
            held.append(of_life)
            valued.append(len(series.measurements) / TESTS)
        shares = "/".join(f"{100 * share:.0f}" for share in np.mean(held, axis=0).tolist())
        lines.append(f"| {name} | {100 * np.mean(valued):.0f} % | {shares} % | {100 * np.mean(held):.1f} % |")
    return "\n".join(lines)


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
