"""What a campaign says beside its torques: states, maintenance, rests, the energy of its duty, its oil and geometry."""

import itertools
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.diagnosis import criteria
from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun, EventKind, Oil, StationaryRun
from models.records.criteria import UNLOADED
from models.records.runs import Plateaus, Record, plate_rise

TestOrDuty: TypeAlias = StationaryRun | DynamicRun | DutyRun
#: The facts that amplitudes and their priors refer to: they stay those of the campaign that was diagnosed.
REFERENCES = ("reference_temperature", "usual_torque", "usual_pressure")


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """The campaign's facts beside the rows that effects need: states, maintenance, rests, duty, oil and geometry.
    Cycles and moments are as in the campaign."""

    geometry: Geometry
    oil: Oil
    states: FloatArray  # distinct cycles [s] at which friction was tested (with the clutch closed), ascending
    temperature_measured: bool
    reference_temperature: float
    oil_changes: tuple[float, ...]  # cycles of maintenance
    sensor_zeros: tuple[float, ...]
    rests: tuple[float, ...]  # cycles of rests: logged as maintenance, or a long gap in the moments
    rest_moments: tuple[float, ...]  # when the rest ended [s], NaN where unknown
    rest_lengths: tuple[float, ...]  # [s], NaN where unknown
    duty_ends: FloatArray  # [d] cycles at the end of each block whose energy is known, ascending
    duty_energies: FloatArray  # [d] J an engagement
    first_moment: float | None = None  # [s] of the timed tests, None where fewer than two were timed
    last_moment: float | None = None
    usual_torque: float = criteria.USUAL_TORQUE  # medians over the closed clutch [Nm], [Pa]
    usual_pressure: float = criteria.USUAL_PRESSURE
    lowest_pressure: float | None = None  # of the closed clutch [Pa]
    shortest_period: float | None = None  # of a loop [s]
    # the plate's rise above the oil at no heat flux of friction [K], and what it rises by with that [K m²/W], if measured
    plate_warming: tuple[float, float] | None = None
    plate_in_all_tests: bool = False  # whether its temperature was measured in every test

    @property
    def life(self) -> float:
        """The cycles from the first to the last state, at least 1."""
        return max(float(self.states[-1] - self.states[0]), 1.0) if self.states.size else 1.0

    @property
    def onsets(self) -> tuple[tuple[float, float, float], ...]:
        """Possible onsets of a change: (state before, cycles midway, state after). Where there are more than
        MOST_ONSETS, that many evenly, and those with an event in the log."""
        gaps = list(itertools.pairwise(self.states.tolist()))
        if len(gaps) > criteria.MOST_ONSETS:
            evenly = {gaps[i] for i in np.linspace(0, len(gaps) - 1, criteria.MOST_ONSETS).round().astype(int)}
            events = (*self.oil_changes, *self.sensor_zeros)
            logged = {gap for gap in gaps if any(gap[0] <= cycles <= gap[1] for cycles in events)}
            gaps = sorted(evenly | logged)
        return tuple((low, 0.5 * (low + high), high) for low, high in gaps)


def facts_of(campaign: Campaign) -> Facts:
    """The facts of a campaign."""
    tests: list[tuple[float, Plateaus | Record]] = [(run.cycles, run.plateaus) for run in campaign.stationary]
    tests += [(run.cycles, run.record) for run in campaign.dynamic]
    under_load = [(cycles, table, table.pressure >= UNLOADED) for cycles, table in tests]
    temperatures = [
        table.oil_temperature[rows] for _, table, rows in under_load if table.oil_temperature is not None and rows.any()
    ]
    rests = _rests(campaign)
    timed = [run.moment for run in campaign.tests if run.moment is not None]
    span = (min(timed), max(timed)) if len(set(timed)) > 1 else (None, None)
    torques, pressures = (
        np.concatenate([np.abs(getattr(table, name)[rows]) for _, table, rows in under_load] or [np.zeros(0)])
        for name in ("torque", "pressure")
    )
    events = {kind: {event.cycles for event in campaign.maintenance if event.event is kind} for kind in EventKind}
    with_energy = [duty for duty in campaign.duty if duty.energy is not None and duty.energy > 0]
    return Facts(
        geometry=campaign.geometry,
        oil=campaign.oil,
        states=np.unique(np.array([cycles for cycles, _, rows in under_load if rows.any()], dtype=np.float64)),
        temperature_measured=bool(temperatures),
        reference_temperature=float(np.median(np.concatenate(temperatures)))
        if temperatures
        else criteria.REFERENCE_TEMPERATURE,
        oil_changes=tuple(sorted(events[EventKind.OIL_CHANGE])),
        sensor_zeros=tuple(sorted(events[EventKind.SENSOR_ZERO])),
        rests=tuple(rests),
        rest_moments=tuple(end for end, _ in rests.values()),
        rest_lengths=tuple(length for _, length in rests.values()),
        duty_ends=np.array([duty.cycles for duty in with_energy], dtype=np.float64),
        duty_energies=np.array([duty.energy for duty in with_energy], dtype=np.float64),
        first_moment=span[0],
        last_moment=span[1],
        usual_torque=max(float(np.median(torques)), 1e-9) if torques.size else criteria.USUAL_TORQUE,
        usual_pressure=max(float(np.median(pressures)), 1e-9) if pressures.size else criteria.USUAL_PRESSURE,
        lowest_pressure=float(pressures.min()) if pressures.size else None,
        plate_warming=_plate_warming(campaign),
        plate_in_all_tests=bool(tests) and all(table.plate_temperature is not None for _, table in tests),
    )


def _plate_warming(campaign: Campaign) -> tuple[float, float] | None:
    """Intercept [K] and slope [K m²/W] of the plate's temperature rise over the heat flux |M| ω/A of friction, by least
    squares; None without a plate temperature. Plateaus are used, which have time to warm, or loops where no plateau has
    the channel; the slope is at least the least that counts as warming."""
    plateaus, records = [run.plateaus for run in campaign.stationary], [run.record for run in campaign.dynamic]
    area = campaign.geometry.friction_faces * campaign.geometry.lining_area
    for tables in (plateaus, records):
        measured = [(table, rise) for table in tables if (rise := plate_rise(table)) is not None]
        if measured:
            flux = np.concatenate([np.abs(table.torque * table.speed) for table, _ in measured]) / area
            rise = np.concatenate([rise for _, rise in measured])
            off = flux - flux.mean()
            # 1 K at 0.32 W/mm² at least, above what thermometers drift with speed; friction heats by tens of K
            slope = float(off @ rise) / max(float(off @ off), 1e-300)
            return float(rise.mean() - slope * flux.mean()), max(slope, 1.0 / 0.32e6)
    return None


def _rests(campaign: Campaign) -> dict[float, tuple[float, float]]:
    """Cycles of the rests, ascending, with their ends [s] and lengths [s]: long gaps between the moments of the runs, and
    maintenance logged as rest, which lasts from its own moment to the next run's."""
    rests: dict[float, tuple[float, float]] = {}
    for end, length, cycles in _long_gaps(campaign):
        rests.setdefault(cycles, (end, length))
    tested = sorted(run.moment for run in campaign.tests if run.moment is not None)
    for event in campaign.maintenance:
        if event.event is EventKind.REST:
            after = [moment for moment in tested if event.moment is not None and moment >= event.moment]
            if event.moment is not None and after:
                rests[event.cycles] = (after[0], after[0] - event.moment)
            else:
                rests.setdefault(event.cycles, (float("nan") if event.moment is None else event.moment, float("nan")))
    return dict(sorted(rests.items()))


def _long_gaps(campaign: Campaign) -> list[tuple[float, float, float]]:
    """Long idle gaps between runs: when each ended [s], how long the rig was idle in it [s], and the cycles of the run
    after it.

    Idle is the time between two runs less what the engagements between them took, at the pace of the fast blocks."""
    runs: list[TestOrDuty] = [*campaign.tests, *campaign.duty]
    timed = [(run.moment, run) for run in runs if run.moment is not None]
    timed.sort(key=lambda moment_and_run: (moment_and_run[0], moment_and_run[1].cycles))
    if len(timed) < 4:
        return []
    gaps = np.diff([moment for moment, _ in timed])
    # some rigs send when a block began, some when it was over: the right reading gives the longer time per engagement
    readings = [_idle_time(gaps, timed, gap_follows_block) for gap_follows_block in (True, False)]
    _, idle = max(readings, key=lambda reading: reading[0])
    least = max((8 * 3600.0), 4.0 * float(np.median(idle)))  # eight hours, and four usual gaps
    return [
        (float(moment), float(length), run.cycles)
        for length, (before, _), (moment, run) in zip(idle, timed[:-1], timed[1:], strict=True)
        if length > least and np.isfinite(before)
    ]


def _idle_time(
    gaps: FloatArray, timed: list[tuple[float, TestOrDuty]], gap_follows_block: bool
) -> tuple[float, FloatArray]:
    """Time [s] of one engagement, and the idle time [n] s of the gaps [n] s without engagements. A block's engagements
    lie in the gap after its moment, or in the one before it; engagements that were not sent lie between two tests."""
    engagements = np.zeros(gaps.size)
    for i, ((_, earlier), (_, later)) in enumerate(itertools.pairwise(timed)):
        block = earlier if gap_follows_block else later
        if isinstance(block, DutyRun):
            engagements[i] = max(block.engagements, 0.0)
        elif not isinstance(earlier, DutyRun) and not isinstance(later, DutyRun):
            engagements[i] = max(later.cycles - earlier.cycles, 0.0)
    worked = (engagements > 0) & np.isfinite(gaps)
    if np.count_nonzero(worked) < 3:
        return 0.0, gaps
    # in slower blocks the rig rested as well; an engagement takes two minutes at most
    pace = min(float(np.quantile(gaps[worked] / engagements[worked], 0.2)), 120.0)
    return pace, np.maximum(gaps - pace * engagements, 0.0)
