"""What a campaign says beside its torques: states, maintenance, pauses, the energy of its duty, its oil and geometry."""

import itertools
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun, EventKind, Oil, StationaryRun
from models.records.criteria import UNLOADED
from models.records.runs import Plateaus, Record

#: The oil temperature to which everything refers where none was measured: the middle of the reference's 80 to 90 °C [K].
REFERENCE_TEMPERATURE = 273.15 + 85.0
#: The torque [Nm] and the pressure [Pa] of the clutch in whose sizes the effects' priors are given: the reference's.
USUAL_TORQUE, USUAL_PRESSURE = 25.0, 5e5
#: A gap between runs that is longer than this [s] and than so many usual gaps is a pause.
LEAST_PAUSE = 8 * 3600.0
PAUSE_RATIO = 4.0
#: Fewer runs that were timed tell of no pauses.
FEWEST_TIMED = 4
#: Engagements take what they took in this share of the blocks at most: in others the rig rested as well.
BRISK = 0.2
#: Fewer blocks tell no pace, and no engagement takes longer than this [s].
FEWEST_BLOCKS, LONGEST_ENGAGEMENT = 3, 120.0
#: So many change points are tried: further ones between them would look the same.
MOST_ONSETS = 20

Timed: TypeAlias = StationaryRun | DynamicRun | DutyRun


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What effects ask beside the rows. Cycles and moments as in the campaign.

    states [s]: the distinct cycles at which friction was tested (not those where the clutch was open only), ascending;
    oil_changes, sensor_zeros and rests: cycles of maintenance (a rest is also a long gap in the moments); rest_moments: when
    the pause ended, rest_lengths [s]: how long it was, NaN where unknown.
    duty_ends [d], duty_energies [d] J an engagement: blocks whose energy is known, ascending. first_moment and last_moment
    [s] of the tests that were timed, None where fewer than two were. usual_torque [Nm] and usual_pressure [Pa]: medians of
    the closed clutch's.
    """

    geometry: Geometry
    oil: Oil
    states: FloatArray
    temperature_measured: bool
    reference_temperature: float
    oil_changes: tuple[float, ...]
    sensor_zeros: tuple[float, ...]
    rests: tuple[float, ...]
    rest_moments: tuple[float, ...]
    rest_lengths: tuple[float, ...]
    duty_ends: FloatArray
    duty_energies: FloatArray
    first_moment: float | None = None
    last_moment: float | None = None
    usual_torque: float = USUAL_TORQUE
    usual_pressure: float = USUAL_PRESSURE

    @property
    def life(self) -> float:
        """The cycles from the first to the last state, at least 1."""
        return max(float(self.states[-1] - self.states[0]), 1.0) if self.states.size else 1.0

    @property
    def onsets(self) -> tuple[tuple[float, float, float], ...]:
        """Where something may have changed: (state before, cycles midway, state after); where there are more than
        MOST_ONSETS, that many evenly, and those with an event in the log."""
        gaps = list(itertools.pairwise(self.states.tolist()))
        if len(gaps) > MOST_ONSETS:
            evenly = {gaps[i] for i in np.linspace(0, len(gaps) - 1, MOST_ONSETS).round().astype(int)}
            events = (*self.oil_changes, *self.sensor_zeros)
            logged = {gap for gap in gaps if any(gap[0] <= cycles <= gap[1] for cycles in events)}
            gaps = sorted(evenly | logged)
        return tuple((low, 0.5 * (low + high), high) for low, high in gaps)


def facts_of(campaign: Campaign) -> Facts:
    """Read off the campaign."""
    tests: list[tuple[float, Plateaus | Record]] = [(run.cycles, run.plateaus) for run in campaign.stationary]
    tests += [(run.cycles, run.record) for run in campaign.dynamic]
    under_load = [(cycles, table, table.pressure >= UNLOADED) for cycles, table in tests]
    temperatures = [
        table.oil_temperature[rows] for _, table, rows in under_load if table.oil_temperature is not None and rows.any()
    ]
    pauses = _pauses(campaign)
    moments = [*(run.moment for run in campaign.stationary), *(run.moment for run in campaign.dynamic)]
    timed = [moment for moment in moments if moment is not None]
    spread = bool(timed) and max(timed) > min(timed)
    torques, pressures = (
        np.concatenate([np.abs(getattr(table, name)[rows]) for _, table, rows in under_load] or [np.zeros(0)])
        for name in ("torque", "pressure")
    )
    known = [duty for duty in campaign.duty if duty.energy is not None and duty.energy > 0]
    return Facts(
        geometry=campaign.geometry,
        oil=campaign.oil,
        states=np.unique(np.array([cycles for cycles, _, rows in under_load if rows.any()], dtype=np.float64)),
        temperature_measured=bool(temperatures),
        reference_temperature=float(np.median(np.concatenate(temperatures))) if temperatures else REFERENCE_TEMPERATURE,
        oil_changes=_events(campaign, EventKind.OIL_CHANGE),
        sensor_zeros=_events(campaign, EventKind.SENSOR_ZERO),
        rests=tuple(pauses),
        rest_moments=tuple(end for end, _ in pauses.values()),
        rest_lengths=tuple(length for _, length in pauses.values()),
        duty_ends=np.array([duty.cycles for duty in known], dtype=np.float64),
        duty_energies=np.array([duty.energy for duty in known], dtype=np.float64),
        first_moment=min(timed) if spread else None,
        last_moment=max(timed) if spread else None,
        usual_torque=_median(torques, USUAL_TORQUE),
        usual_pressure=_median(pressures, USUAL_PRESSURE),
    )


def _median(values: FloatArray, otherwise: float) -> float:
    return max(float(np.median(values)), 1e-9) if values.size else otherwise


def _events(campaign: Campaign, kind: EventKind) -> tuple[float, ...]:
    return tuple(sorted({event.cycles for event in campaign.maintenance if event.event is kind}))


def _gaps(campaign: Campaign) -> list[tuple[float, float, float]]:
    """When long pauses ended [s], how long they were [s] and the cycles of the run after them: the time between two runs
    less what the engagements between them took, at the pace of the brisk ones."""
    runs: list[Timed] = [*campaign.stationary, *campaign.dynamic, *campaign.duty]
    timed = [(run.moment, run) for run in runs if run.moment is not None]
    timed.sort(key=lambda each: (each[0], each[1].cycles))
    if len(timed) < FEWEST_TIMED:
        return []
    gaps = np.diff(np.array([moment for moment, _ in timed]))
    # some rigs say when a block began, some when it was over: it took the gap in which engagements were never hurried
    idle = max((_idle(gaps, timed, blocks_first) for blocks_first in (True, False)), key=lambda each: each[0])[1]
    least = max(LEAST_PAUSE, PAUSE_RATIO * float(np.median(idle)))
    return [
        (float(moment), float(length), run.cycles)
        for length, (before, _), (moment, run) in zip(idle, timed[:-1], timed[1:], strict=True)
        if length > least and np.isfinite(before)
    ]


def _idle(gaps: FloatArray, timed: list[tuple[float, Timed]], blocks_first: bool) -> tuple[float, FloatArray]:
    """Seconds that an engagement takes, and what is left of the gaps [n] s: a block's engagements lie in the gap after its
    moment, or in the one before it; those that nobody sent lie between two tests."""
    busy = np.zeros(gaps.size)
    for i, ((_, one), (_, other)) in enumerate(itertools.pairwise(timed)):
        block = one if blocks_first else other
        if isinstance(block, DutyRun):
            busy[i] = max(block.engagements, 0.0)
        elif not isinstance(one, DutyRun) and not isinstance(other, DutyRun):
            busy[i] = max(other.cycles - one.cycles, 0.0)
    worked = (busy > 0) & np.isfinite(gaps)
    if np.count_nonzero(worked) < FEWEST_BLOCKS:
        return 0.0, gaps
    pace = min(float(np.quantile(gaps[worked] / busy[worked], BRISK)), LONGEST_ENGAGEMENT)
    return pace, np.maximum(gaps - pace * busy, 0.0)


def _pauses(campaign: Campaign) -> dict[float, tuple[float, float]]:
    """Cycles of the pauses, ascending, with their ends [s] and lengths [s]: gaps between the moments of the runs, and
    maintenance that calls itself rest, which lasts from its own moment to the next run's."""
    found: dict[float, tuple[float, float]] = {}
    for end, length, cycles in _gaps(campaign):
        found.setdefault(cycles, (end, length))
    tests: list[StationaryRun | DynamicRun] = [*campaign.stationary, *campaign.dynamic]
    tested = sorted(run.moment for run in tests if run.moment is not None)
    for event in campaign.maintenance:
        if event.event is EventKind.REST:
            after = [moment for moment in tested if event.moment is not None and moment >= event.moment]
            if event.moment is not None and after:
                found[event.cycles] = (after[0], after[0] - event.moment)
            else:
                found.setdefault(event.cycles, (float("nan") if event.moment is None else event.moment, float("nan")))
    return dict(sorted(found.items()))
