"""The numerics of an extended model: subtracts artefacts from measurements, and adds courses along a life.

An *artefact* (oil temperature, a shifted zero, an unsettled dwell ...) is in the measurement and not in the clutch: its
torque is taken off every plateau before a curve is fitted. A *course* (running-in, oil change, accelerated wear ...) is in
the clutch and not in eq. 6: its mean torque is taken off the measured course before eq. 6 is tracked, and put back when
the threshold's first passage is looked for.

The *law* is friction itself, S (1 + δ) in place of eq. 3's S (`baseline.law_form`): a curve is fitted to torque/(1 + δ),
and its mean torque is that of S (1 + δ).

What the diagnosis does not know is a weighted set of draws (`effects.fitted_effect`), each one coherent correction of all
runs of a life: a life is tracked under each, and the prognosis is their mixture.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.diagnosis.baseline.law_form import LawForm, LearnedLaw
from models.diagnosis.baseline.laws import Frame, Laws, scene_of
from models.diagnosis.campaign import Campaign, Oil, StationaryRun
from models.diagnosis.design.design import Points, build_design, points_of
from models.diagnosis.design.facts import REFERENCES, Facts, facts_of
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import Discrepancy, EffectKind
from models.diagnosis.effects.fitted_effect import Draw, FittedEffect, Ranges

#: How answers name the law as found where it is in force in place of eq. 3; no effect of the catalogue.
FRICTION_LAW = "friction_law"
#: Plateaus are handed on in parts of this many: a design takes no more of one run.
_PART = 2000


class NotFiniteError(ArithmeticError):
    """Raised where an extension's change of torque is not finite at some points; the message says which effect, and of
    how many."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Extension:
    """An extended model, ready to be stored as JSON and applied to runs that come later."""

    effects: tuple[str, ...]  # slugs
    content: Mapping[str, Any]  # what `to_dict` stores: plain numbers, strings, lists and dicts, all finite

    @property
    def weights(self) -> FloatArray:
        """The weights [d] of the draws; they sum to one."""
        weights = np.array([draw["weight"] for draw in self.content["draws"]], dtype=np.float64)
        return np.asarray(weights / weights.sum())

    def artefact(self, run: StationaryRun, campaign: Campaign) -> FloatArray:
        """Torque [d, n] Nm that the artefacts add to each plateau of a run under each draw; zero where there are none.
        Raises NotFiniteError.

        `campaign` gives what a run alone does not hold (maintenance, moments of the other runs); it need not hold `run`.
        Without oil temperature, its effect cannot be computed and is not taken off.
        """
        count = run.plateaus.torque.size
        torque = np.zeros((self.weights.size, count))
        usable = np.flatnonzero(run.plateaus.speed != 0)  # as a design takes them: clocks and neighbours are the same
        for rows in np.array_split(usable, max(1, math.ceil(usable.size / _PART))):
            if rows.size:
                clock = None if run.time is None else tuple(np.asarray(run.time)[rows].tolist())
                part = replace(run, plateaus=run.plateaus.take(rows), time=clock, record=None)
                points = build_design(replace(campaign, stationary=(part,), dynamic=())).points
                torque[:, rows] = points.sign * self._changes(points, self._facts(campaign), EffectKind.ARTEFACT)
        return torque

    @property
    def law(self) -> LearnedLaw | None:
        """The learned discrepancy of friction from eq. 3; None where eq. 3 stays."""
        stored = self.content["law"]
        return None if stored is None else _learned_from(stored)

    @property
    def has_course(self) -> bool:
        """Whether any draw contains an effect of use along the life."""
        return bool(self.content["courses"]) and any(
            BY_SLUG[effect["slug"]].kind is EffectKind.COURSE
            for draw in self.content["draws"]
            for effect in draw["effects"]
        )

    def course(self, cycles: FloatArray, pressure: FloatArray, velocity: FloatArray) -> FloatArray:
        """Mean torque [d, m, k] Nm over velocity [v] m/s > 0 that effects of use add at cycles [m] and pressure [k] Pa under
        each draw. Raises NotFiniteError."""
        shape = (self.weights.size, cycles.size, pressure.size, velocity.size)
        if not self.has_course:
            return np.zeros(shape[:3])
        grid = np.broadcast_arrays(cycles[:, None, None], pressure[:, None], velocity)
        at, under, moving = (np.ravel(axis) for axis in grid)
        points = points_of(at.size, cycles=at, pressure=under, velocity=moving)  # not measured: no clock, no neighbours
        changes = self._changes(points, facts_from(self.content["facts"]), EffectKind.COURSE)
        return np.asarray(changes.reshape(shape).mean(axis=3), dtype=np.float64)

    def _facts(self, campaign: Campaign) -> Facts:
        """The campaign's facts, with the temperature, the states and the days that the diagnosis referred to."""
        stored_facts = facts_from(self.content["facts"])
        names = ("states", "first_moment", "last_moment", "plate_warming", *REFERENCES)
        return replace(facts_of(campaign), **{name: getattr(stored_facts, name) for name in names})

    def _changes(self, points: Points, facts: Facts, kind: EffectKind) -> FloatArray:
        """Changes [d, P] Nm of one kind under each draw."""
        ranges: Ranges = {Discrepancy(name): (low, width) for name, (low, width) in self.content["ranges"].items()}
        scenes = [scene_of(_laws(laws), points, facts) for laws in self.content["laws"]]
        changes = np.zeros((self.weights.size, points.run.size))
        for change, draw in zip(changes, self.content["draws"], strict=True):
            for stored in draw["effects"]:
                effect = BY_SLUG[stored["slug"]]
                if effect.kind is kind and not effect.counts_in_severity:
                    drawn = FittedEffect(
                        effect=effect,
                        amplitude=stored["amplitude"],
                        shape=tuple(stored["shape"]),
                        factors=tuple(stored["factors"]),
                    )
                    change += drawn.drawn(scenes[draw["laws"]], ranges)
                    if lost := np.count_nonzero(~np.isfinite(change)):
                        raise NotFiniteError(
                            f"the change of {effect.slug} is not finite at {lost} of {change.size} points"
                        )
        return changes

    @property
    def severity_exponent(self) -> float | None:
        """Exponent of load severity where it was named, ζ growing by (energy/usual energy)^exponent a cycle; else
        None."""
        exponent = self.content.get("severity_exponent")
        return None if exponent is None else float(exponent)

    def to_dict(self) -> dict[str, Any]:
        """The extension as values that JSON can carry."""
        return {"effects": list(self.effects), "content": dict(self.content)}

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> "Extension":
        """The inverse of `to_dict`."""
        return cls(effects=tuple(stored["effects"]), content=stored["content"])


def build_extension(
    draws: Sequence[Draw], facts: Facts, ranges: Ranges, *, courses: bool, law: LearnedLaw | None = None
) -> Extension:
    """An extension from weighted draws, and the campaign's facts and ranges that they refer to; and the law in place of
    eq. 3.

    `courses`: whether effects of use are to be followed beyond the data; where they did not help to predict the last states
    from the first, a life is tracked without them. ζ counts by the mean exponent of severity.
    """
    effects = dict.fromkeys(effect.effect.slug for draw in draws for effect in draw.effects)
    laws = list({id(draw.laws): draw.laws for draw in draws}.values())
    exponents = [
        (draw.weight, effect.amplitude) for draw in draws for effect in draw.effects if effect.effect.counts_in_severity
    ]
    total = sum(weight for weight, _ in exponents)
    exponent = sum(weight * amplitude for weight, amplitude in exponents) / total if total > 0 else None
    return Extension(
        effects=(*effects, *((FRICTION_LAW,) if law is not None else ())),
        content={
            "facts": facts_to(facts),
            "ranges": {along.value: list(range_) for along, range_ in ranges.items()},
            "law": None if law is None else _learned_to(law),
            "laws": [
                {
                    "theta": shared.theta.tolist(),
                    "frame": facts_to(shared.frame),
                    "learned": None if shared.learned is None else _learned_to(shared.learned),
                }
                for shared in laws
            ],
            "draws": [
                {
                    "weight": draw.weight,
                    "laws": next(place for place, shared in enumerate(laws) if shared is draw.laws),
                    "effects": [
                        {
                            "slug": effect.effect.slug,
                            "amplitude": effect.amplitude,
                            "shape": list(effect.shape),
                            "factors": list(effect.factors),
                        }
                        for effect in draw.effects
                    ],
                }
                for draw in draws
            ],
            "courses": courses,
            "severity_exponent": exponent if courses else None,
        },
    )


def facts_to(facts: Facts | Frame | LawForm) -> dict[str, Any]:
    """Facts, a frame, or the form of a law, as values that JSON can carry: arrays as lists, NaN as None."""
    stored = asdict(facts)
    for name, value in stored.items():
        if isinstance(value, np.ndarray | tuple):
            stored[name] = [None if math.isnan(float(x)) else float(x) for x in value]
    return stored


def facts_from(stored: Mapping[str, Any]) -> Facts:
    """The inverse of `facts_to`."""
    return Facts(
        **_arrays_of(Facts, stored) | {"geometry": Geometry(**stored["geometry"]), "oil": Oil(**stored["oil"])}
    )


def _arrays_of(kind: type[Facts | Frame | LawForm], stored: Mapping[str, Any]) -> dict[str, Any]:
    """Stored fields of a dataclass, with lists converted back to arrays or tuples and None to NaN."""
    values = dict(stored)
    for field in fields(kind):
        if isinstance(value := stored[field.name], list):
            numbers = [math.nan if x is None else x for x in value]
            values[field.name] = np.array(numbers, dtype=np.float64) if field.type is FloatArray else tuple(numbers)
    return values


def _laws(stored: Mapping[str, Any]) -> Laws:
    """The laws with their frame and learned discrepancy, from their stored form."""
    frame, learned = Frame(**_arrays_of(Frame, stored["frame"])), stored["learned"]
    return Laws(
        theta=np.array(stored["theta"], dtype=np.float64),
        frame=frame,
        learned=None if learned is None else _learned_from(learned),
    )


def _learned_to(learned: LearnedLaw) -> dict[str, Any]:
    """The stored form of a learned discrepancy."""
    return {"form": facts_to(learned.form), "coefficients": learned.coefficients.tolist()}


def _learned_from(stored: Mapping[str, Any]) -> LearnedLaw:
    """A learned discrepancy from its stored form."""
    form = LawForm(**_arrays_of(LawForm, stored["form"]))
    return LearnedLaw(form=form, coefficients=np.array(stored["coefficients"], dtype=np.float64))
