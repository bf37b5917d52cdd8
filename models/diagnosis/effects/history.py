"""Effects of a clutch's history: what use, oil and rests do to friction beside eq. 6.

Running-in (early in life asperities are worn off), an oil change (shear and boundary friction step at a cycle), wear that
accelerates late in life, load severity (ζ is energy rather than a count), recovery in rests (friction is off its course
after a pause and returns to it with use).
"""

import math

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import (
    Discrepancy,
    Effect,
    EffectKind,
    Felt,
    Shape,
    ShapeParameter,
    Tried,
    of_twice,
)

#: Whether what a rest did settles with use alone, or by the test's clock as well; and the log of its settling time [s],
#: which with use alone stays where it is.
BY_USE, BY_CLOCK, SETTLING = 0.0, 1.0, (math.log(20.0), math.log(1e4))
#: What is changed: the static torque's part of the curve, all of it, or the pace at which all four parameters age.
STATIC, WHOLE, PACE = 0.0, 1.0, 2.0
#: How many times as much a cycle may count after the onset, less one.
_PACES = np.concatenate([[0.0], np.geomspace(1e-2, 30.0, 120)])


def _carried(scene: Scene, part: float) -> FloatArray:
    """Torque [P] Nm to which a relative change applies: the whole curve S, or its static part M_s ∂S/∂M_s."""
    return scene.curve if part == WHOLE else scene.gradient[:, 0] * scene.parameters[:, 0]


def _running_in_grid(facts: Facts) -> tuple[Tried, ...]:
    """Shapes (ln of the decay's length [cycles], part of the torque) of running-in: five lengths, of static torque or
    of all; none with fewer than four states."""
    if facts.states.size < 4:
        return ()
    gap = max(float(np.diff(facts.states).min()), 1e-3 * facts.life)
    lengths = np.geomspace(gap / 3, facts.life / 6, 5)
    return tuple(Tried(shape=(float(np.log(length)), part)) for length in lengths for part in (STATIC, WHOLE))


def _running_in_change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque [P] Nm that decays with the cycles since the life began: a · part · e^(-ζ/length)."""
    log_length, part = shape
    left = np.exp(-scene.points.cycles / np.exp(log_length))
    return np.asarray(amplitude * _carried(scene, part) * left, dtype=np.float64)


RUNNING_IN = Effect(
    slug="running_in",
    title="Running-in was not finished",
    article="unfinished",
    physics="The first cycles polish the lining: a new clutch's friction differs from what it settles to.",
    check="look up how long the clutch was run in",
    formula="a M_s ∂S/∂M_s e^{-ζ/ζ_r}, or a S e^{-ζ/ζ_r}",
    source="Ompusunggu et al. 2013, section 2.3.1: 200 cycles of running-in before cycle 0",
    kind=EffectKind.COURSE,
    amplitude="difference of the new clutch's friction from its settled value",
    states="The new clutch's friction was {} above its settled value.",
    states_below="The new clutch's friction was {} below its settled value.",
    unit="%",
    prior_sd=0.08,
    lowest=-1.0,
    highest=1.0,
    scale=100.0,
    shapes=(
        ShapeParameter(name="log of the length ζ_r", unit="ln cycles", lowest=3.0, highest=8.6, smooth=True),
        ShapeParameter(name="what is changed", unit="-"),
    ),
    grid=_running_in_grid,
    change=_running_in_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.LIFE),
)


#: Log prior odds [nats] of an unlogged change against a logged one.
_UNLOGGED = -2.0
#: The largest step of viscous friction upwards [-]. Derived: from ISO VG 22 to VG 100, the grades of such gears.
_THICKEST = 4.0


def _oil_change_grid(facts: Facts) -> tuple[Tried, ...]:
    """Shapes (onset [cycles], share of boundary friction, share lost with age) of an oil change at each possible
    onset; one in the log is more probable than one that nobody logged."""
    tried = []
    for low, onset, high in facts.onsets:
        logged = any(low <= cycles <= high for cycles in facts.oil_changes)
        weight = 0.0 if logged else (_UNLOGGED if facts.oil_changes else 0.0) - float(np.log(len(facts.onsets)))
        tried += [Tried(shape=(onset, share, lost), log_weight=weight) for share in (-0.1, 0.1) for lost in (0.0, 0.5)]
    return tuple(tried)


def _oil_change_change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque [P] Nm after the onset: a step of viscous friction with a share of boundary friction, which
    ages."""
    onset, share, lost = shape
    since = scene.points.cycles - onset
    ageing = 1.0 - lost * -np.expm1(-np.maximum(since, 0.0) / (0.5 * scene.facts.life))
    boundary = scene.gradient[:, 1] * scene.parameters[:, 1]
    step = (scene.viscous + share * boundary) * ageing
    return np.asarray(amplitude * np.where(since > 0, step, 0.0), dtype=np.float64)


OIL_CHANGE = Effect(
    slug="oil_change",
    title="The oil was changed",
    article="an",
    physics="Fresh oil has another viscosity and fresh additives: viscous friction steps, and boundary friction a little.",
    check="look up when oil was changed or topped up",
    formula="a (C_v |v|^γ + k M̄_c ∂S/∂M̄_c) (1 - l (1 - e^{-2(ζ - ζ_k)/ζ_last})) after ζ_k",
    source="maintenance practice; friction modifiers deplete with use",
    kind=EffectKind.COURSE,
    amplitude="step of viscous friction",
    states="Viscous friction stepped up by {}.",
    states_below="Viscous friction stepped down by {}.",
    unit="%",
    prior_sd=0.15,
    lowest=-1.0,
    highest=_THICKEST,
    scale=100.0,
    shapes=(
        ShapeParameter(name="cycle ζ_k", unit="cycles"),
        ShapeParameter(name="share of M̄_c k", unit="-", lowest=-0.5, highest=0.5, smooth=True),
        ShapeParameter(name="share lost again as the oil ages", unit="-", lowest=0.0, highest=1.0, smooth=True),
    ),
    grid=_oil_change_grid,
    change=_oil_change_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.LIFE),
)


def _faster(scene: Scene, lost: float, onset: float) -> FloatArray:
    """Change of torque [P] Nm, S(ζ + x (ζ - ζ_k)₊) - S(ζ), with x such that the baseline's static torque has lost a further
    share by the last state."""
    last, cycles = float(scene.facts.states[-1]), scene.points.cycles
    reached = last + _PACES * (last - onset)
    static = scene.laws.parameters(np.full(reached.size, scene.facts.usual_pressure), reached)[:, 0]
    pace = float(np.interp(abs(lost), np.maximum.accumulate(1.0 - static / static[0]), _PACES))
    changed = scene.curve_with(cycles=cycles + pace * np.maximum(cycles - onset, 0.0)) - scene.curve_with()
    return changed if lost >= 0.0 else -changed


def _accelerated_wear_grid(facts: Facts) -> tuple[Tried, ...]:
    """Shapes (onset [cycles], power, part) of accelerated wear at each onset but the first; none with fewer than four
    states."""
    if facts.states.size < 4:
        return ()
    onsets = sorted({cycles for low, onset, _ in facts.onsets[1:] for cycles in (low, onset)})
    weight = -float(np.log(len(onsets)))
    forms = ((1.0, PACE), (1.0, STATIC), (2.0, STATIC))
    return tuple(Tried(shape=(onset, *form), log_weight=weight) for onset in onsets for form in forms)


def _accelerated_wear_change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque [P] Nm after the onset: static torque lost with a power of the cycles since, or eq. 6 at a
    faster pace."""
    onset, power, part = shape
    late = np.maximum(scene.points.cycles - onset, 0.0) / max(float(scene.facts.states[-1]) - onset, 1.0)
    if part == PACE:
        return _faster(scene, amplitude, onset)
    return np.asarray(-amplitude * _carried(scene, STATIC) * np.minimum(late, 10.0) ** power, dtype=np.float64)


ACCELERATED_WEAR = Effect(
    slug="accelerated_wear",
    title="Wear accelerates late in life",
    physics="Glazing, lost porosity or torn fibres: from some cycle on static torque falls faster than in the model's "
    "course, or every cycle ages the clutch more.",
    check="inspect the lining for glazing and torn fibres",
    formula="-a M_s ∂S/∂M_s ((ζ - ζ_k)₊/(ζ_last - ζ_k))^q, or S(ζ + x (ζ - ζ_k)₊) - S(ζ)",
    source="Ompusunggu et al. 2013, figs. 4 and 5: glazing and lost porosity",
    kind=EffectKind.COURSE,
    amplitude="further loss of static torque by the last state",
    states="Static torque lost {} more by the last state.",
    unit="%",
    prior_sd=0.1,
    lowest=0.0,
    highest=1.0,
    scale=100.0,
    shapes=(
        ShapeParameter(name="onset ζ_k", unit="cycles"),
        ShapeParameter(name="power q", unit="-"),
        ShapeParameter(name="what is changed", unit="-"),
    ),
    grid=_accelerated_wear_grid,
    change=_accelerated_wear_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.LIFE),
)


def _load_severity_grid(facts: Facts) -> tuple[Tried, ...]:
    """One shape (it has no parameters) if the blocks of duty differ in energy; none otherwise."""
    # blocks that differ by less than 3 % cannot show a severity
    if facts.duty_energies.size > 1 and np.ptp(np.log(facts.duty_energies)) > 0.03:
        return (Tried(shape=()),)
    return ()


def effective_cycles(cycles: FloatArray, facts: Facts, exponent: float) -> FloatArray:
    """Cycles ζ [n] weighted by severity: each engagement counts (energy/usual energy)^exponent, 1 where no energy was
    sent."""
    ends = np.concatenate([[0.0], facts.duty_ends])
    lengths = np.maximum(np.diff(ends), 0.0)
    usual = float(np.median(facts.duty_energies))
    weights = np.exp(np.clip(exponent * np.log(facts.duty_energies / usual), -3.0, 3.0))
    grown = np.concatenate([[0.0], np.cumsum(lengths * weights)])
    beyond = np.maximum(cycles - ends[-1], 0.0)
    return np.asarray(np.interp(cycles, ends, grown) + beyond, dtype=np.float64)


LOAD_SEVERITY = Effect(
    slug="load_severity",
    title="Some duty was harder than other",
    article="varying",
    physics="An engagement of more energy ages the clutch more than an easy one.",
    check="compare logged with intended energy per engagement, over the life",
    formula="S(ζ_e) - S(ζ), ζ_e = Σ (E/E_usual)^m over the engagements whose energy was sent",
    source="models.degradation.general_order: dD/dζ = -k Dⁿ with k by the load's severity",
    kind=EffectKind.COURSE,
    channels=("energy_per_cycle_kj",),
    amplitude="severity exponent m (1: proportional)",
    unit="-",
    felt=Felt(unit="", of=of_twice),
    states="Doubling the energy per engagement multiplies ageing by {}.",
    prior_sd=0.7,
    lowest=0.0,
    grid=_load_severity_grid,
    change=lambda scene, amplitude, _: (
        scene.curve_with(cycles=effective_cycles(scene.points.cycles, scene.facts, amplitude)) - scene.curve_with()
    ),
    before_lag=True,
    discrepancies=(Discrepancy.LIFE,),
    counts_in_severity=True,
)


def _rest_recovery_grid(facts: Facts) -> tuple[Tried, ...]:
    """Shapes (length [cycles], by use or by the clock, ln of the settling time [s], power of the pause, part) of
    recovery after rests; none without a rest."""
    if not facts.rests or facts.states.size < 2:
        return ()
    gap = float(np.median(np.diff(facts.states)))
    courses = [(length, BY_USE, sum(SETTLING) / 2) for length in (0.1 * gap, 0.5 * gap, 1.5 * gap)]
    if np.isfinite(facts.rest_moments).any():
        courses += [(0.1 * gap, BY_CLOCK, math.log(seconds)) for seconds in (150.0, 600.0)]
    powers = (0.0, 1.0) if np.isfinite(facts.rest_lengths).sum() > 1 else (0.0,)
    return tuple(
        Tried(shape=(*course, power, part)) for course in courses for power in powers for part in (WHOLE, STATIC)
    )


def _rest_recovery_change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque [P] Nm that a rest leaves: largest just after it, less with the cycles and the time since; of
    several rests the largest counts."""
    length, clocked, settling, power, part = shape
    points, seconds = scene.points, math.exp(settling)
    share = np.zeros_like(points.cycles)
    # what settles grows with the logarithm of the pause; 1 after the longest, and where the length is not known
    grown = np.log1p(np.maximum(np.array(scene.facts.rest_lengths, dtype=np.float64), 60.0) / 3600.0)
    timed = np.isfinite(grown)
    strengths = np.where(timed, grown / max(float(grown[timed].max(initial=0.0)), 1e-9), 1.0) ** power
    for pause, moment, strength in zip(scene.facts.rests, scene.facts.rest_moments, strengths.tolist(), strict=True):
        since = points.cycles - pause
        left = np.where(since >= 0, strength * np.exp(-np.maximum(since, 0.0) / length), 0.0)
        if clocked == BY_CLOCK and np.isfinite(moment):
            waited = np.where(np.isfinite(points.moment), points.moment - moment, points.clock)
            left = np.where(waited < -60.0, 0.0, left)  # tested at the same cycles, but before the pause
            left = left * np.exp(-np.clip(waited / seconds, 0.0, 50.0))
        share = np.maximum(share, left)
    return np.asarray(amplitude * _carried(scene, part) * share, dtype=np.float64)


REST_RECOVERY = Effect(
    slug="rest_recovery",
    title="Friction recovered during a rest",
    physics="While the clutch rests, additives settle and oil drains: friction starts changed and recovers as it slides.",
    check="check that friction deviated most after the longest rest",
    formula="a S (ln(1 + rest/1 h)/ln(1 + longest/1 h))^r e^{-(ζ - ζ_rest)/ζ_c}, S or M_s ∂S/∂M_s; with the clock also "
    "e^{-(t - t_rest)/τ}",
    source="boundary films of friction modifiers re-form at rest",
    kind=EffectKind.COURSE,
    channels=("started_at",),
    amplitude="change of friction at the end of the longest rest",
    states="Friction was {} higher right after the longest rest.",
    states_below="Friction was {} lower right after the longest rest.",
    unit="%",
    prior_sd=0.04,
    lowest=-1.0,
    highest=1.0,
    scale=100.0,
    shapes=(
        ShapeParameter(name="length ζ_c", unit="cycles"),
        ShapeParameter(name="whether it settles by the clock", unit="-"),
        ShapeParameter(
            name="log of the settling time τ", unit="ln s", lowest=SETTLING[0], highest=SETTLING[1], smooth=True
        ),
        ShapeParameter(name="power of the rest's length r", unit="-", lowest=0.0, highest=2.0, smooth=True),
        ShapeParameter(name="what is changed", unit="-"),
    ),
    grid=_rest_recovery_grid,
    change=_rest_recovery_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.LIFE, Discrepancy.CLOCK),
)
