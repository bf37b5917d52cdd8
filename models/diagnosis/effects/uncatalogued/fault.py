"""What an uncatalogued rig fault is: a template of something rigs do that no effect of the catalogue describes.

Smooth contrasts have no change points and no time constants. Without these templates a gain that settles while the sensor
warms up passes for a zero that does, and another speed scale from a cycle on for fresh oil: the effect of the catalogue that
resembles it has the right course and would win. Where a fault does clearly better than the catalogue, structure is
unexplained and lies on the fault's axis, and the report describes it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Effect, Family, Kind, Shape, ShapeParameter, Tried
from models.diagnosis.effects.uncatalogued.criteria import USUAL_SIZE


@dataclass(frozen=True, slots=True, kw_only=True)
class UncataloguedFault:
    """A template, the axis (`design.axes`) on which its structure lies, and a description for the report."""

    effect: Effect
    axis: str
    description: str


def uncatalogued_fault(
    *,
    slug: str,
    description: str,
    formula: str,
    axis: str,
    grid: Callable[[Facts], tuple[Tried, ...]],
    change: Callable[[Scene, float, Shape], FloatArray],
    shapes: int = 0,
) -> UncataloguedFault:
    """A fault of relative size USUAL_SIZE that changes the measured torque, with so many `shapes` that are taken from its
    grid."""
    effect = Effect(
        slug=slug,
        title=description,
        physics=description,
        formula=formula,
        source="faults of rigs",
        family=Family.SENSOR,
        kind=Kind.ARTEFACT,
        channels=(),
        amplitude="size",
        unit="-",
        prior_sd=USUAL_SIZE,
        positive=False,
        scale=1.0,
        shapes=tuple(ShapeParameter(name="course", unit="-", lowest=-np.inf, highest=np.inf) for _ in range(shapes)),
        grid=grid,
        change=change,
        before_lag=False,
        discrepancies=(),
    )
    return UncataloguedFault(effect=effect, axis=axis, description=description)


def no_shape(_facts: Facts) -> tuple[Tried, ...]:
    """The grid of a fault without shapes."""
    return (Tried(shape=()),)
