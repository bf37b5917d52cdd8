"""A course over life that any effect may have: it is at work from an unknown state on.

An encoder is changed, a pump wears out, a programme is given shorter dwells: what is wrong need not have been wrong in the
first test. Were a step in the template of one effect alone, any step would be taken for that effect. So an effect is at work
from the start or from a state on, the one as probable as the other, and each state as probable as the next.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import FROM_THE_START, Effect, Shape, ShapeParameter, Tried


def begins(effect: Effect) -> Effect:
    """An effect whose last shape is the cycle from which on it is at work. A step is tried with its likeliest kinds of
    shapes, and of each with the likeliest shape: a refit moves the others."""
    own = len(effect.shapes)

    def grid(facts: Facts) -> tuple[Tried, ...]:
        tried = effect.grid(facts)
        always = [Tried(shape=(*t.shape, FROM_THE_START), log_weight=t.log_weight) for t in tried]
        if not tried or facts.states.size < 3:
            return tuple(always)
        kinds: dict[Shape, list[Tried]] = {}
        for one in tried:
            kinds.setdefault(effect.stiff(one.shape), []).append(one)
        weights = [float(logsumexp([one.log_weight for one in kind])) for kind in kinds.values()]
        likeliest = [k for k, w in zip(kinds.values(), weights, strict=True) if w > max(weights) - 1e-6]
        shapes = [max(kind, key=lambda one: one.log_weight).shape for kind in likeliest]
        onsets = [onset for _, onset, _ in facts.onsets]
        weight = float(logsumexp(weights) - np.log(len(shapes) * len(onsets)))
        later = [Tried(shape=(*shape, onset), log_weight=weight) for shape in shapes for onset in onsets]
        return (*always, *later)

    def change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
        return np.where(_at_work(scene, shape[own:]), effect.change(scene, amplitude, shape[:own]), 0.0)

    def several(scene: Scene, settings: Sequence[tuple[float, Shape]]) -> FloatArray:
        at_work = np.stack([_at_work(scene, shape[own:]) for _, shape in settings], axis=1)
        return np.where(at_work, effect.changes(scene, [(size, shape[:own]) for size, shape in settings]), 0.0)

    return replace(
        effect,
        shapes=(*effect.shapes, ShapeParameter(name="onset ζ_k", unit="cycles")),
        begins=True,
        grid=grid,
        change=change,
        several=None if effect.several is None else several,
    )


def _at_work(scene: Scene, onset: Shape) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Where [P]; an extension that was stored without an onset is at work from the start."""
    return np.asarray(scene.points.cycles > max(onset, default=FROM_THE_START), dtype=np.bool_)
