"""What the readings are wrong by: the torque's zero, the pressure's gauge, too short plateaus, channels apart in time.

A zero moved at once, along the test or along the life. A gauge is off: the pressure at the clutch is not the recorded one.
Plateaus are too short: each reading still contains a share of the plateau before. The torque channel lags the speed
channel.
"""

import math
from collections.abc import Sequence

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import (
    CREEPS,
    Discrepancy,
    Effect,
    EffectKind,
    Measure,
    Shape,
    ShapeParameter,
    Tried,
    by_loop,
    flattening,
    within,
)
from models.relaxation import recursion

#: Courses of the zero: one offset from a cycle on, along the test's clock (straight, or settling), along the life by cycles
#: or by the days that it took.
STEP, CLOCK, SETTLING, LIFE, DAYS, *_BETWEEN = map(float, range(9))
#: Between these too a size is averaged: x^q and x (1 + s)/(x + s) along the life, without knots that may be off, by cycles
#: or by days; their powers q, and s (chosen: so close that the size moves by about its own deviation from one to the next).
EVEN, EVEN_DAYS, FLATTENING, FLATTENING_DAYS = _BETWEEN
POWERS, FLATTENED = (0.5, 0.7, 1.0, 1.4, 2.0), (0.1, 0.3, 1.0)
#: Times [s] after which a zero has settled to 1/e, each refined by the factor e^x, x the first of the knots below.
TIMES = (120.0, 400.0)
#: Knots over life at which a zero may be off its straight course, in amplitudes; on a straight course it is off by none.
KNOTS: FloatArray = np.linspace(0.0, 1.0, 4)
STRAIGHT = (0.0,) * (KNOTS.size - 2)


def _torque_zero_shift_grid(facts: Facts) -> tuple[Tried, ...]:
    """Shapes (course, value, deviations from the course) of a shifted zero for the search: constant, with the test's
    clock, settling, a step at each possible onset, creeping over cycles or days."""
    zeroed = facts.sensor_zeros
    tried = [Tried(shape=(STEP, -1.0, *STRAIGHT), log_weight=-1.0), Tried(shape=(CLOCK, 0.0, *STRAIGHT))]
    weight = -float(np.log(len(TIMES)))
    tried += [Tried(shape=(SETTLING, tau, *STRAIGHT), log_weight=weight) for tau in TIMES]
    for low, onset, high in facts.onsets:
        logged = any(low <= cycles <= high for cycles in zeroed)
        weight = 0.0 if logged else -float(np.log(len(facts.onsets)))
        tried.append(Tried(shape=(STEP, onset, *STRAIGHT), log_weight=weight))
    if facts.states.size > 2:
        courses = (LIFE,) if facts.first_moment is None else (LIFE, DAYS)
        weight = -0.7 - float(np.log(len(courses)))
        tried += [Tried(shape=(course, power, *STRAIGHT), log_weight=weight) for course in courses for power in CREEPS]
    return tuple(tried)


def _torque_zero_shift_courses(facts: Facts) -> tuple[Tried, ...]:
    """Shapes of the search with finer ones over life, under which a size is estimated: even and flattening courses
    over cycles, and over days if the tests were timed."""
    tried = list(_torque_zero_shift_grid(facts))
    if facts.states.size > 2:
        timed = facts.first_moment is not None
        weight = -0.7 - float(np.log((len(POWERS) + len(FLATTENED)) * (1 + timed)))
        courses = [(EVEN, POWERS), (FLATTENING, FLATTENED), (EVEN_DAYS, POWERS), (FLATTENING_DAYS, FLATTENED)]
        for course, values in courses if timed else courses[:2]:
            tried += [Tried(shape=(course, value, *STRAIGHT), log_weight=weight) for value in values]
    return tuple(tried)


def _torque_zero_shift_change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque [P] Nm, a · direction · course: a shifted zero keeps its sign when the clutch turns the other
    way."""
    course, value, *off = shape
    clock, cycles = scene.points.clock, scene.points.cycles
    if course == STEP:
        share = np.where(cycles > value, 1.0, 0.0)
    elif course == CLOCK:
        share = clock / 3600.0 * 2.0
    elif course == SETTLING:
        share = -np.expm1(-np.maximum(clock, 0.0) / (value * np.exp(off[0])))
    else:
        life = _days_of(scene) if course in {DAYS, EVEN_DAYS, FLATTENING_DAYS} else scene.life
        share = flattening(life, value) if course in {FLATTENING, FLATTENING_DAYS} else life**value
        if course in {LIFE, DAYS}:
            share = share + np.interp(life, KNOTS, [0.0, *off, 0.0])
    return np.asarray(amplitude * scene.points.sign * share, dtype=np.float64)


def _days_of(scene: Scene) -> FloatArray:
    """Share [P] of the campaign's days that has passed; where a test was not timed, of its cycles."""
    facts, moment = scene.facts, scene.points.moment
    if facts.first_moment is None or facts.last_moment is None:
        return scene.life
    gone = np.maximum((moment - facts.first_moment) / (facts.last_moment - facts.first_moment), 0.0)
    return np.where(np.isnan(moment), scene.life, gone)


TORQUE_ZERO_SHIFT = Effect(
    slug="torque_zero_shift",
    title="The torque sensor's zero has shifted",
    article="a",
    physics="Even unloaded, the sensor shows a torque; it adds this at every speed and pressure.",
    check="read the torque with the shaft unloaded, before and after a test",
    repair="zero the torque sensor before each test",
    formula="a · step(ζ > ζ_k), a · t/30 min, a (1 - e^{-t/τ}), or a · (ζ/ζ_last)^q or the same in days, with the sensor's "
    "sign",
    source="strain-gauge transducers: ISO 376, zero drift and creep",
    kind=EffectKind.ARTEFACT,
    channels=("oil_temperature_c",),
    amplitude="zero shift",
    states="The torque sensor reads {} too much.",
    states_below="The torque sensor reads {} too little.",
    unit="Nm",
    prior_sd=0.5,
    shapes=(
        ShapeParameter(name="course", unit="-"),
        ShapeParameter(name="onset or settling time", unit="cycles or s"),
        *(
            ShapeParameter(
                name=f"off its course at {share:.0%} of life, or log of the settling time's factor",
                unit="-",
                lowest=-0.8,
                highest=0.8,
                smooth=True,
            )
            for share in KNOTS[1:-1]
        ),
    ),
    grid=_torque_zero_shift_grid,
    courses=_torque_zero_shift_courses,
    change=_torque_zero_shift_change,
    grows_with=Measure.TORQUE,
    before_lag=False,
    discrepancies=(Discrepancy.LIFE, Discrepancy.CLOCK),
)


#: Courses of the offset over life x = ζ/ζ_last, 1 at its end: constant, x^q, from a cycle on, or x (1 + s)/(x + s).
OFFSET_CONSTANT, OFFSET_GROWING, OFFSET_STEP, OFFSET_SETTLING = map(float, range(4))
#: Powers q between which a size is averaged (chosen as those of a zero).
OFFSET_POWERS = (0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0, 2.8)


def _pressure_offset_grid(facts: Facts) -> tuple[Tried, ...]:
    """Shapes of an offset for the search: those of `_offsets`, and growing with a power of the life."""
    return _offsets(facts, [(OFFSET_GROWING, 0.0, math.log(power)) for power in CREEPS])


def _pressure_offset_courses(facts: Facts) -> tuple[Tried, ...]:
    """Shapes under which an offset's size is estimated: with more powers, and with courses that flatten."""
    growing = [(OFFSET_GROWING, 0.0, math.log(power)) for power in OFFSET_POWERS]
    return _offsets(facts, [*growing, *((OFFSET_SETTLING, share, 0.0) for share in FLATTENED)])


def _offsets(facts: Facts, growing: Sequence[Shape]) -> tuple[Tried, ...]:
    """The shape grid of an offset: constant; growing along the life, together as probable as the starts; from a cycle
    on."""
    tried = [Tried(shape=(OFFSET_CONSTANT, 0.0, 0.0))]
    if facts.states.size > 2:
        tried += [Tried(shape=shape, log_weight=math.log(len(CREEPS) / len(growing))) for shape in growing]
        weight = -math.log(len(facts.onsets))
        tried += [Tried(shape=(OFFSET_STEP, onset, 0.0), log_weight=weight) for _, onset, _ in facts.onsets]
    return tuple(tried)


def _pressure_offset_changes(scene: Scene, settings: Sequence[tuple[float, Shape]]) -> FloatArray:
    """Changes of torque [P, s] Nm by offsets of the pressure at s settings (amplitude, shape): the curve at the offset
    pressure less that at the pressure read."""
    as_read = scene.curve_with(pressure=scene.points.pressure)  # by the same law below the lowest level
    changes = np.empty((as_read.size, len(settings)))
    for place, (amplitude, shape) in enumerate(settings):
        offset = amplitude * _pressure_offset_share(scene, shape)
        pressed = np.maximum(scene.points.pressure + offset, 0.0)  # nothing pulls the plates apart
        changes[:, place] = scene.curve_with(pressure=pressed) - as_read
    return changes


def _pressure_offset_share(scene: Scene, shape: Shape) -> FloatArray:
    """Share [P] of the final pressure offset that is present at each point."""
    course, value, log_power = shape
    if course == OFFSET_CONSTANT:
        return np.ones_like(scene.points.cycles)
    if course == OFFSET_STEP:
        return np.where(scene.points.cycles > value, 1.0, 0.0)
    life = scene.life
    return np.asarray(life ** math.exp(log_power) if course == OFFSET_GROWING else flattening(life, value))


PRESSURE_OFFSET = Effect(
    slug="pressure_offset",
    title="The pressure reading is off",
    article="a",
    physics="The gauge does not read the pressure that presses the plates.",
    check="compare the pressure reading with a second gauge at the piston",
    repair="repair the gauge",
    formula="S(p + a) - S(p), a constant, growing as (ζ/ζ_last)^q or towards an end, or from a cycle on",
    source="Ompusunggu et al. 2013, fig. 1: one gauge in the line, none at the piston",
    kind=EffectKind.ARTEFACT,
    amplitude="pressure offset",
    states="The clutch gets {} more than the gauge reads.",
    states_below="The clutch gets {} less than the gauge reads.",
    unit="bar",
    prior_sd=0.15e5,
    scale=1e-5,
    between=lambda facts: within(facts.lowest_pressure),
    shapes=(
        ShapeParameter(name="course", unit="-"),
        ShapeParameter(name="onset or s", unit="cycles or -"),
        ShapeParameter(
            name="log of the power q", unit="-", lowest=math.log(0.3), highest=math.log(3.0), smooth=True, held=True
        ),
    ),
    grid=_pressure_offset_grid,
    courses=_pressure_offset_courses,
    change=lambda scene, amplitude, shape: _pressure_offset_changes(scene, [(amplitude, shape)])[:, 0],
    several=_pressure_offset_changes,
    grows_with=Measure.PRESSURE,
    before_lag=True,
    discrepancies=(Discrepancy.LIFE,),
)


#: What a plateau starts from: the torque before, or the speed before (the film's), at the same pressure or across a change
#: too.
TORQUE, TORQUE_WITHIN, SPEED = map(float, range(3))


def _unsettled_dwell_change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque [P] Nm of plateaus that still carry a share of the plateau before: of its difference in speed,
    or in settled torque."""
    start, carried = shape
    points = scene.points
    previous = points.previous
    follows = previous >= 0
    before = np.where(follows, previous, 0)
    if start != TORQUE:
        follows = follows & (np.abs(points.pressure[before] - points.pressure) < 0.02 * points.pressure)
    # an open clutch's drag is not carried over as friction
    follows = follows & (points.engaged * points.engaged[before] > 0)
    if start == SPEED:
        difference = scene.by_velocity * (points.velocity[before] - points.velocity)
        limit = np.abs(scene.curve)
        difference = np.clip(difference, -limit, limit)
    else:
        keep = np.where(follows, float(np.clip(amplitude * carried, 0.0, 0.95)), 0.0)
        settled = scene.curve_with()
        difference = recursion(keep, (1.0 - keep) * settled)[before] - settled  # what each plateau ends with
    return np.asarray(amplitude * np.where(follows, difference, 0.0), dtype=np.float64)


UNSETTLED_DWELL = Effect(
    slug="unsettled_dwell",
    title="Plateaus were not settled",
    article="an",
    physics="Friction settles after a step; a reading taken too early still contains a share of the previous plateau.",
    check="hold each speed twice as long before it is read: the error must go",
    repair="hold each speed longer before it is read",
    formula="a (x_before - S), x = S + k a (x_before - S) what a plateau ends with; a = e^{-dwell/τ} averaged over what was "
    "read",
    source="Ompusunggu et al. 2013, section 2.3.3: 5 s a plateau; real transients in tests/lab/real",
    kind=EffectKind.ARTEFACT,
    amplitude="share of the previous plateau",
    states="A reading still contains {} of the previous plateau.",
    unit="%",
    prior_sd=0.05,
    lowest=0.0,
    highest=1.0,
    scale=100.0,
    shapes=(
        ShapeParameter(name="what a plateau starts from", unit="-"),
        ShapeParameter(name="of the share, what is carried on, k", unit="-", lowest=0.0, highest=1.0, smooth=True),
    ),
    grid=lambda _: tuple(Tried(shape=(start, 0.5)) for start in (TORQUE, TORQUE_WITHIN, SPEED)),
    change=_unsettled_dwell_change,
    before_lag=False,
    discrepancies=(Discrepancy.SPEED,),
)


def _channel_delay_change(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
    """Change of torque [P] Nm by a delay of `amplitude` [s]: each loop's curve shifted along its phase; 0 at
    plateaus."""
    points = scene.points
    out = np.zeros_like(scene.curve)
    looping = np.flatnonzero(points.loop >= 0)
    if looping.size:
        velocity, frequency = by_loop(points, looping)
        curves, phases = scene.curve_with()[looping].reshape(velocity.shape), velocity.shape[1]
        step = amplitude * frequency * phases / (2 * np.pi)
        out[looping] = (_shifted(curves, np.clip(step, -phases, phases)) - curves).ravel()
    return out


def _shifted(curves: FloatArray, steps: FloatArray) -> FloatArray:
    """Periodic curves [l, k] delayed by `steps` [l, 1] phases, by parabolas through the nearest three."""
    whole_steps = np.round(steps)
    x = steps - whole_steps
    at = (np.arange(curves.shape[1]) - whole_steps.astype(np.intp)) % curves.shape[1]
    at_step, after, before = (np.take_along_axis(curves, (at + k) % curves.shape[1], axis=1) for k in (0, 1, -1))
    return np.asarray(
        at_step - 0.5 * x * (after - before) + 0.5 * x * x * (after - 2 * at_step + before), dtype=np.float64
    )


CHANNEL_DELAY = Effect(
    slug="channel_delay",
    title="The torque channel is delayed",
    article="a",
    physics="A filter or the recorder delays torque against speed: while the clutch accelerates, the recorded torque "
    "belongs to an earlier, lower speed.",
    check="compare the filters of the torque and the speed channel",
    formula="S(v(t - δ)) - S(v(t)), to first order -δ dS/dt",
    source="anti-aliasing filters and multiplexed recorders; no friction is in it",
    kind=EffectKind.LAG,
    channels=("time_s",),
    amplitude="delay of torque against speed",
    states="Torque is recorded {} after speed.",
    states_below="Torque is recorded {} before speed.",
    unit="ms",
    prior_sd=0.08,
    scale=1000.0,
    between=lambda facts: within(facts.shortest_period),
    change=_channel_delay_change,
    before_lag=True,
    opposite_physics="Torque is ahead of the speed: a filter or the recorder delays the speed channel.",
)
