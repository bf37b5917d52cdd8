"""A simulated life as the product sees it: curves fitted to its stationary tests, loops cut out of its dynamic ones."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.identification import StribeckFit, fit_curves
from models.friction.speed_protocol import REFERENCE_SPEEDS
from models.friction.stribeck import PARAMETER_NAMES, torque
from models.loops.loops import Loop, evaluate_loops
from models.records.runs import curves_by_pressure
from models.rig.sampled import DynamicTest, sampled_test
from models.rig.simulated_runs import RunKind, SimulatedRun
from models.rig.stationary import Sensor
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch

GEOMETRY = Geometry()
VELOCITY = GEOMETRY.sliding_velocity(REFERENCE_SPEEDS)
#: Fig. 7's and fig. 17's states [cycles].
STAGES = (0, 1000, 7000, 15_000)


@dataclass(eq=False)
class Life:
    """A simulated life and what the product makes of it."""

    clutch: SimulatedClutch
    runs: tuple[SimulatedRun, ...]

    @cached_property
    def cycles(self) -> FloatArray:
        """Of the stationary tests [tests]."""
        return np.array([run.cycles for run in self.runs if run.plateaus is not None], dtype=float)

    @cached_property
    def fits(self) -> list[tuple[StribeckFit, ...]]:
        """Of each stationary test, by pressure."""
        return [fit_curves(curves_by_pressure(run.plateaus, GEOMETRY)) for run in self.runs if run.plateaus is not None]

    @cached_property
    def loops(self) -> dict[int, tuple[Loop, ...]]:
        """By cycles, of the stages."""
        tests = [run for run in self.runs if run.kind is RunKind.DYNAMIC_STRIBECK]
        return {run.cycles: evaluate_loops(run.record, GEOMETRY, None) for run in tests if run.cycles in STAGES}

    def stage(self, cycles: int) -> tuple[StribeckFit, ...]:
        """The fits of the test after so many cycles."""
        return self.fits[int(np.flatnonzero(self.cycles == cycles)[0])]

    def curves(self, cycles: int) -> FloatArray:
        """Fitted torque [pressures, speeds] Nm after so many cycles."""
        return np.array([torque(VELOCITY, fit.parameters) for fit in self.stage(cycles)])

    def parameter(self, name: str) -> tuple[FloatArray, FloatArray]:
        """A fitted parameter and its deviation [tests, pressures]."""
        index = PARAMETER_NAMES.index(name)
        values = [[(f.parameters.as_array()[index], f.standard_errors[index]) for f in fits] for fits in self.fits]
        told = np.array(values)
        return told[..., 0], told[..., 1]

    def mean_cofs(self) -> FloatArray:
        """Mean COF of each stationary test [tests], of the fitted curves."""
        unit = np.array([GEOMETRY.torque_per_cof(float(p)) for p in PROTOCOL_PRESSURES])
        return np.array([(self.curves(int(c)) / unit[:, None]).mean() for c in self.cycles])

    def areas(self, cycles: int) -> FloatArray:
        """Loop areas [pressures] Nm m/s after so many cycles."""
        return areas_by_pressure(self.loops[cycles])


def areas_of(clutch: SimulatedClutch, cycles: int, test: DynamicTest) -> FloatArray:
    """Loop areas [pressures] Nm m/s of one dynamic test."""
    record = sampled_test(clutch, cycles, test, np.random.default_rng(3), Sensor())
    return areas_by_pressure(evaluate_loops(record, GEOMETRY, None))


def areas_by_pressure(loops: tuple[Loop, ...]) -> FloatArray:
    """Loop areas [pressures] Nm m/s; every pressure of the protocol was found."""
    assert [loop.pressure for loop in loops] == pytest.approx(PROTOCOL_PRESSURES)
    return np.array([loop.area for loop in loops])
