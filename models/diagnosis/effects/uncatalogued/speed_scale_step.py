"""Another scale of the speed from a cycle on, as of another encoder or belt."""

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.axes import CYCLES
from models.diagnosis.effects.effect import Shape
from models.diagnosis.effects.uncatalogued.fault import uncatalogued_fault
from models.diagnosis.effects.uncatalogued.steps import onset_grid, stepped


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    return stepped(scene.by_velocity * scene.points.velocity, scene, amplitude, shape[0])


FAULT = uncatalogued_fault(
    slug="speed_scale_step",
    description="another scale of the speed from a cycle on, as of another encoder or belt",
    formula="a v ∂S/∂v from a cycle on",
    axis=CYCLES,
    grid=onset_grid,
    change=_change,
    shapes=1,
)
