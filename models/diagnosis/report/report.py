"""What a diagnosis says: the verdict, its causes, what was seen and where, what the extension gains, which test decides."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from models.arrays import FloatArray
from models.diagnosis.effects.estimate import Estimate
from models.diagnosis.extension import Extension


class Verdict(StrEnum):
    """The honest answers: nothing beyond noise, these causes, one of these, something else, too little data."""

    MODEL_ADEQUATE = "model_adequate"
    CAUSE_NAMED = "cause_named"
    CAUSE_AMBIGUOUS = "cause_ambiguous"
    UNEXPLAINED_STRUCTURE = "unexplained_structure"
    INSUFFICIENT_DATA = "insufficient_data"


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """An effect that competed: its slug, probability [0, 1] and gain in log evidence over the baseline [nats], both in the
    fit that it was part of: with the effects `beside` it."""

    effect: str
    title: str
    probability: float
    log_evidence_gain: float
    estimate: Estimate
    beside: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """An axis on which structure lives: public channel name or `test_clock_s`, `cycles`, `loop_phase`; strength in nats."""

    axis: str
    strength: float
    p_value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """How well a model fits: rmse and noise [Nm], the share of the variance beyond noise, and where it lives."""

    rmse: float
    noise: float
    unexplained_share: float
    where: tuple[Where, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Gain:
    """What the extension gains on runs held out by state and by pressure; rmse [Nm], log score [nats].

    `reduction_sd` [%] is the paired uncertainty of `reduction_percent`. `excess` [Nm] is the error beyond noise. MSE is
    eq. 5's percentage. `remaining` tells whether the extension also helps to foretell the last states from the first ones:
    log score gained there [nats].
    """

    held_out_runs: tuple[str, ...]
    rmse_before: float
    rmse_after: float
    reduction_percent: float
    reduction_sd: float
    excess_before: float
    excess_after: float
    mse_percent_before: float
    mse_percent_after: float
    log_score_gain: float
    remaining: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """A test that would decide between two effects (or between an effect and none, then `other` is "baseline").

    `key` names the test for machines (`experiments.candidates.TRIALS`), `nats` is what it is expected to bring.
    """

    key: str
    test: str
    effect: str
    other: str
    nats: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Visible:
    """The smallest amplitude of an effect that these data would have shown with 90 % power in the middle one of its shapes;
    `least` in the shape that shows best; and its usual size."""

    effect: str
    amplitude: float
    least: float
    usual: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Maps:
    """Mean whitened residuals [-] before and after the extension; NaN where nothing was measured.

    Axes: pressure [p] Pa, speed [s] rad/s, cycles [c]. `speed_pressure` are [p, s], `pressure_cycles` [c, p].
    """

    pressure: FloatArray
    speed: FloatArray
    cycles: FloatArray
    speed_pressure_before: FloatArray
    speed_pressure_after: FloatArray
    pressure_cycles_before: FloatArray
    pressure_cycles_after: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTrace:
    """A loop over one period: speed [n] rad/s, torque [n] Nm measured, and what baseline and extended model give."""

    pressure: float
    cycles: float
    frequency: float
    speed: FloatArray
    measured: FloatArray
    baseline: FloatArray
    extended: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A finished diagnosis. `extension` is what may be adopted, None where there is nothing to adopt."""

    verdict: Verdict
    causes: tuple[str, ...]
    summary: str
    candidates: tuple[Candidate, ...]
    baseline: Misfit | None
    extended: Misfit | None
    gain: Gain | None
    advice: tuple[Advice, ...]
    visible: tuple[Visible, ...]
    maps: Maps | None
    loops: tuple[LoopTrace, ...]
    extension: Extension | None
    #: Anything an engineer should know about the data: assumed noise floor, missing channels, states left out.
    notes: tuple[str, ...]
    #: Numbers of the engine that a test may want: alarm statistic, its threshold, closure p-values.
    statistics: Mapping[str, float]
