"""The numerics of an extended model: artefacts are taken off measurements, courses are added along a life.

An *artefact* (oil temperature, a shifted zero, an unsettled dwell ...) is in the measurement and not in the clutch: its
torque is taken off every plateau before a curve is fitted. A *course* (running-in, oil change, accelerated wear ...) is in
the clutch and not in eq. 6: its mean torque is taken off the measured course before eq. 6 is tracked, and put back when
the threshold's first passage is looked for. Where the cause is ambiguous, every alternative counts with its probability.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.diagnosis.baseline.criteria import EXPONENTIAL
from models.diagnosis.baseline.laws import ATTRACTOR, LOG_CURVATURE, POWERS, Frame, Laws, scene_of
from models.diagnosis.campaign import Campaign, Oil, StationaryRun
from models.diagnosis.design.design import build_design
from models.diagnosis.design.facts import Facts, facts_of
from models.diagnosis.design.points import Points
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import Kind
from models.diagnosis.pooled_fit.gauss_newton import Fit

#: Plateaus are handed on in parts of this many: a design takes no more of one run.
_PART = 2000


class NotFiniteError(ArithmeticError):
    """An extension makes no number of some points; the message says which effect, and of how many."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Extension:
    """An extended model, ready to be stored as JSON and applied to runs that come later.

    `effects` are slugs; `content` is what `to_dict` stores: plain numbers, strings, lists and dicts, all finite.
    """

    effects: tuple[str, ...]
    content: Mapping[str, Any]

    def artefact(self, run: StationaryRun, campaign: Campaign) -> FloatArray:
        """Torque [n] Nm that the artefacts add to each plateau of a run; zero where there are none. Raises NotFiniteError.

        `campaign` gives what a run alone does not hold (maintenance, moments of the other runs); it need not hold `run`.
        Without oil temperature, its effect cannot be computed and is not taken off.
        """
        count = run.plateaus.torque.size
        torque = np.zeros(count)
        usable = np.flatnonzero(run.plateaus.speed != 0)  # as a design takes them: clocks and neighbours are the same
        for rows in np.array_split(usable, max(1, math.ceil(usable.size / _PART))):
            if rows.size:
                torque[rows] = self._on(run, rows, campaign)
        return torque

    def _on(self, run: StationaryRun, rows: np.ndarray[Any, np.dtype[np.intp]], campaign: Campaign) -> FloatArray:
        part = run.plateaus.take(rows)
        clock = None if run.time is None else tuple(np.asarray(run.time)[rows].tolist())
        alone = replace(campaign, stationary=(replace(run, plateaus=part, time=clock, record=None),), dynamic=())
        points = build_design(alone).points
        return points.sign * self._mean(points, self._facts(campaign), {Kind.ARTEFACT})[0]

    def course(self, cycles: FloatArray, pressure: FloatArray, velocity: FloatArray) -> FloatArray:
        """Mean torque [m, k] Nm over velocity [v] m/s > 0 that effects of use add at cycles [m] and pressure [k] Pa. Raises
        NotFiniteError."""
        return self._course(cycles, pressure, velocity)[0]

    def course_sd(self, cycles: FloatArray, pressure: FloatArray, velocity: FloatArray) -> FloatArray:
        """Deviation [m, k] Nm of `course`, from the effects' amplitudes and between alternatives."""
        return self._course(cycles, pressure, velocity)[1]

    def _course(self, cycles: FloatArray, pressure: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
        shape = (cycles.size, pressure.size, velocity.size)
        grid = np.broadcast_arrays(cycles[:, None, None], pressure[:, None], velocity)
        if not self.content["courses"]:
            return np.zeros(shape[:2]), np.zeros(shape[:2])
        points = _steady_points(*(np.ravel(axis) for axis in grid))
        mean, deviation = self._mean(points, facts_from(self.content["facts"]), {Kind.COURSE})
        return mean.reshape(shape).mean(axis=2), deviation.reshape(shape).mean(axis=2)

    def _facts(self, campaign: Campaign) -> Facts:
        """The campaign's facts, with the temperature, the states and the days that the diagnosis referred to."""
        kept = facts_from(self.content["facts"])
        return replace(
            facts_of(campaign),
            reference_temperature=kept.reference_temperature,
            states=kept.states,
            first_moment=kept.first_moment,
            last_moment=kept.last_moment,
            usual_torque=kept.usual_torque,
            usual_pressure=kept.usual_pressure,
            plate_warming=kept.plate_warming,
        )

    def _mean(self, points: Points, facts: Facts, kinds: set[Kind]) -> tuple[FloatArray, FloatArray]:
        """Weighted over the alternatives: change [P] Nm and its deviation [P] Nm."""
        weights, means, variances = [], [], []
        for alternative in self.content["alternatives"]:
            scene = scene_of(_laws(alternative), points, facts)
            mean, variance = np.zeros(points.run.size), np.zeros(points.run.size)
            for stored in alternative["effects"]:
                effect = BY_SLUG[stored["slug"]]
                if effect.kind in kinds and not effect.counts_in_severity:
                    change = effect.change(scene, stored["amplitude"], tuple(stored["shape"]))
                    if not np.isfinite(change).all():
                        lost = np.count_nonzero(~np.isfinite(change))
                        raise NotFiniteError(
                            f"the change of {effect.slug} is not finite at {lost} of {change.size} points"
                        )
                    if effect.kind is Kind.COURSE:  # followed far enough, friction ends; it does not reverse
                        change = np.maximum(change, -scene.curve)
                    relative = stored["amplitude_sd"] / max(abs(stored["amplitude"]), 1e-300)
                    mean, variance = mean + change, variance + (change * relative) ** 2
            weights.append(float(alternative["weight"]))
            means.append(mean)
            variances.append(variance)
        weight = np.array(weights)[:, None] / sum(weights)
        mean = (weight * means).sum(axis=0)
        return mean, np.sqrt((weight * (np.array(variances) + (np.array(means) - mean) ** 2)).sum(axis=0))

    @property
    def severity_exponent(self) -> float | None:
        """Where load severity was named: ζ grows by (energy/usual energy)^exponent a cycle; else None."""
        exponent = self.content.get("severity_exponent")
        return None if exponent is None else float(exponent)

    def to_dict(self) -> dict[str, Any]:
        """As JSON can carry it."""
        return {"effects": list(self.effects), "content": dict(self.content)}

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> "Extension":
        """The inverse of `to_dict`."""
        return cls(effects=tuple(stored["effects"]), content=stored["content"])


def build_extension(
    alternatives: Sequence[tuple[float, Fit, Sequence[float]]], facts: Facts, *, courses: bool
) -> Extension:
    """From what was fitted: the weight of each alternative, its fit, the deviations of its effects' amplitudes.

    The most probable one names the effects. `courses`: whether effects of use are to be followed beyond the data; where
    they did not help to predict the last states from the first, a life is tracked without them.
    """
    stored = [_stored(weight, fit, deviations) for weight, fit, deviations in alternatives]
    best = max(stored, key=lambda alternative: float(alternative["weight"]))
    exponents = [effect["amplitude"] for effect in best["effects"] if BY_SLUG[effect["slug"]].counts_in_severity]
    return Extension(
        effects=tuple(effect["slug"] for effect in best["effects"]),
        content={
            "facts": facts_to(facts),
            "alternatives": stored,
            "courses": courses,
            "severity_exponent": exponents[0] if exponents and courses else None,
        },
    )


def facts_to(facts: Facts) -> dict[str, Any]:
    """Facts as JSON can carry them: arrays as lists, what is not a number as None."""
    stored: dict[str, Any] = {}
    for field in fields(Facts):
        value = getattr(facts, field.name)
        if isinstance(value, Geometry | Oil):
            stored[field.name] = asdict(value)
        elif isinstance(value, np.ndarray | tuple):
            stored[field.name] = [None if math.isnan(float(x)) else float(x) for x in value]
        else:
            stored[field.name] = value
    return stored


def facts_from(stored: Mapping[str, Any]) -> Facts:
    """The inverse of `facts_to`."""
    values: dict[str, Any] = dict(stored) | {"geometry": Geometry(**stored["geometry"]), "oil": Oil(**stored["oil"])}
    for field in fields(Facts):
        lacking = [] if field.default is MISSING else field.default
        value = values.setdefault(field.name, lacking)  # what an older build did not store
        if isinstance(value, list):
            numbers = [math.nan if x is None else x for x in value]
            values[field.name] = np.array(numbers, dtype=np.float64) if field.type is FloatArray else tuple(numbers)
    return Facts(**values)


def _stored(weight: float, fit: Fit, deviations: Sequence[float]) -> dict[str, Any]:
    frame = {field.name: getattr(fit.laws.frame, field.name) for field in fields(Frame)}
    effects = [
        {
            "slug": fitted.effect.slug,
            "amplitude": fitted.amplitude,
            "amplitude_sd": sd,
            "shape": list(fitted.shape),
        }
        for fitted, sd in zip(fit.effects, deviations, strict=True)
    ]
    frame["loop_pressures"] = fit.laws.frame.loop_pressures.tolist()
    return {"weight": weight, "theta": fit.laws.theta.tolist(), "frame": frame, "effects": effects}


def _laws(alternative: Mapping[str, Any]) -> Laws:
    frame = alternative["frame"]
    at = Frame(**(frame | {"loop_pressures": np.array(frame["loop_pressures"], dtype=np.float64)}))
    theta = np.array(alternative["theta"], dtype=np.float64)
    size = ATTRACTOR + at.loop_pressures.size + POWERS
    # before it had a bend M̄_c's law was an exponential, and before that the open clutch had no drag
    if theta.size in (size - 1, size - 1 - POWERS):
        theta = np.insert(theta, LOG_CURVATURE, np.log(EXPONENTIAL))
    return Laws(theta=np.append(theta, np.zeros(size - theta.size)), frame=at)


def _steady_points(cycles: FloatArray, pressure: FloatArray, velocity: FloatArray) -> Points:
    """Plateaus that were not measured: no temperature but the reference's, no clock, no neighbours."""
    count = cycles.size
    whole, none, zero = np.zeros(count, dtype=np.intp), np.full(count, -1, dtype=np.intp), np.zeros(count)
    nan = np.full(count, np.nan)
    return Points(
        run=whole,
        cycles=cycles,
        pressure=pressure,
        engaged=np.ones(count),
        velocity=velocity,
        sign=np.ones(count),
        acceleration=zero,
        temperature=nan,
        plate_rise=nan,
        clock=zero,
        moment=nan,
        angular_frequency=zero,
        phase=zero,
        loop=none,
        previous=none,
    )
