"""`/remaining-useful-life/forecast`: the remaining useful life under a programme of planned duty. Nothing is stored.

How far ζ has to go to the end of life is what the filter says, as every answer states it; the programme decides how many
cycles lead there. An adopted model's course over ζ is that of recent duty.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from scipy.special import ndtri

from models.arrays import FloatArray
from models.clutch import Geometry
from models.degradation.severity import (
    Block,
    DutyProgramme,
    Severity,
    SeverityBasis,
    SeverityMap,
    counted,
    severity_map,
    uncertain_work,
)
from models.prognosis.criteria import HORIZON, QUANTILES
from models.prognosis.first_passage import PassageStatus, horizon_at, weighted_quantiles
from models.prognosis.stated_end import StatedEnd
from service import repository
from service.api.life import LifePrediction, PlannedBlock, PlannedLife, ProgrammeIn, Quantiles
from service.channels import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM
from service.clutch.condition import in_short, with_held_runs
from service.clutch.items import ENDED, INSUFFICIENT, SAFE, by_quantile, ended, warned
from service.clutch.recomputation import ClutchHistory
from service.clutch.summary import StoredSummary
from service.clutch.timeline import Event, Series, date_of, moment_at, pace_of
from service.clutch.tracking import advance, carrier, drawn, end_of_life, predict, predict_at, sampled, step_rng
from service.clutch.with_held import with_held
from service.errors import Notice
from storage.engine.database import Database

_SECONDS_PER_HOUR = 3600.0
#: Draws of what a plan leaves open, evenly spread, in another order for each block.
_PLANS = 500
_NORMALS = ndtri((np.arange(_PLANS) + 0.5) / _PLANS)

PlannedBlocks = Sequence[PlannedBlock]


def planned_life(database: Database, clutch_id: str, method: str, planned: ProgrammeIn) -> PlannedLife:
    """The remaining useful life of the present life under a planned programme, by one filter. Raises NotFoundError."""
    with database.reading() as connection:
        state = repository.state(connection, clutch_id, carried=True)
    events = state.lives[-1].events if state.events else ()
    stated = planned.pace_cycles_per_hour
    of_runs = pace_of(events)
    pace = stated or (None if of_runs is None else of_runs * _SECONDS_PER_HOUR)
    prediction, plan = _prediction(state, method, planned)
    among = None
    if state.held:
        evidence = repository.evidence_for(database, state, repository.run_reader(database, clutch_id))
        among = None if evidence is None else in_short(_prediction(with_held(state, evidence), method, planned)[0])
    summary: StoredSummary = {}
    if pace is not None and events:
        a_second = pace / _SECONDS_PER_HOUR
        summary["pace"] = {"cycles_per_second": a_second, "moment": moment_at(events, a_second, events[-1].cycles)}
    beside = with_held_runs(in_short(prediction), summary, among, len(state.held))
    head = {"clutch_id": clutch_id, "method": method, "revision": state.revision, "origin": state.record.origin}
    return PlannedLife(
        **{**head, **dict(prediction), **beside.of(prediction), **asdict(plan)},
        end_of_life_at=_dates(prediction.end_of_life_cycles, events, pace),
        pace_cycles_per_hour=pace,
        pace_from=None if pace is None else "runs" if stated is None else "request",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plan:
    """Figures of a programme: the remaining cycles if recent duty continued, the blocks until the end of life, the
    severity of a cycle of each block, and the basis by which planned cycles were counted."""

    recent_duty_cycles: Quantiles
    remaining_blocks: Quantiles
    block_severity: Sequence[float | None]
    counted_by: str


def _prediction(state: ClutchHistory, method: str, planned: ProgrammeIn) -> tuple[LifePrediction, _Plan]:
    """The remaining life under the programme (under recent duty if too few tests, or past its end), and the programme's
    figures."""
    assumptions, fraction = state.assumptions, state.fraction
    series = state.lives[-1].pooled(assumptions) if state.events else None
    basis = assumptions.severity.basis.value
    unknown = _Plan(
        recent_duty_cycles=by_quantile({}),
        remaining_blocks=by_quantile({}),
        block_severity=[None] * len(planned.programme),
        counted_by=basis,
    )
    if series is None or not series.measurements:
        return predict_at(state.lives, assumptions, fraction, method=method), unknown
    life, runs = state.lives[-1], len(series.measurements)
    now = life.events[-1].cycles
    tracked = advance(method, series, (state.filters or {}).get(carrier(method)), runs)
    tracked = sampled(method, series, tracked)
    sample = drawn(method, series, tracked)
    recent = ended(predict(method, series, tracked, now, fraction, tests=life.tests), life.end)
    unknown = replace(unknown, recent_duty_cycles=recent.remaining_cycles)
    if recent.status in (INSUFFICIENT, ENDED):
        return recent, unknown
    duty = _counted(state, assumptions.severity, series, planned)
    rng = step_rng(f"{method}-programme", series, runs)
    programme = duty.programme(planned.programme, recent.current.mean_cof or 0.0, rng)
    most = series.scale.origin + horizon_at(now - series.scale.origin) - now
    horizon = float(series.scale.progress(now)) + most * float(programme.rates.max())
    end = end_of_life(sample, series, tracked, now, fraction, horizon)
    planned_end, blocks = _planned_end(recent, programme, end, series, now=now, most=most)
    notices = warned(duty.notices(planned.programme))
    rates = programme.rates / series.scale.severity.rate
    plan = _Plan(
        recent_duty_cycles=recent.remaining_cycles,
        remaining_blocks=blocks,
        block_severity=[float(median) for median in np.median(rates, axis=0)],
        counted_by=duty.severity.basis.value,
    )
    return planned_end.model_copy(update={"warnings": recent.warnings + notices}), plan


def _planned_end(
    recent: LifePrediction, programme: DutyProgramme, end: StatedEnd, series: Series, *, now: float, most: float
) -> tuple[LifePrediction, Quantiles]:
    """The predicted end under the programme: unchanged if it is past, else when severity-weighted cycles ζ reach the
    end of life, at most `most` cycles ahead; and the blocks until then."""
    draws = np.arange(end.ends.size) % programme.rates.shape[0]
    ahead = end.ends - float(series.scale.progress(now))
    spread = DutyProgramme(cycles=programme.cycles, rates=programme.rates[draws])
    with np.errstate(invalid="ignore"):
        left = np.where(ahead > 0.0, spread.cycles_until(np.maximum(ahead, 0.0)), series.scale.cycles(end.ends) - now)
    stated = weighted_quantiles(np.minimum(left, 10.0 * (most + HORIZON)), end.weight, QUANTILES).tolist()
    ends = {q: x if x <= most else None for q, x in zip(QUANTILES, stated, strict=True)}
    remaining = {q: None if x is None else max(x, 0.0) for q, x in ends.items()}
    open_ended = PassageStatus.MAY_NEVER_REACH if None in remaining.values() else PassageStatus.PREDICTED
    known = {
        "status": recent.status if recent.status == PassageStatus.REACHED.value else open_ended.value,
        "remaining_cycles": by_quantile(remaining),
        "end_of_life_cycles": by_quantile({q: None if x is None else now + x for q, x in ends.items()}),
        "at_least": most if remaining[SAFE] is None else remaining[SAFE],
        "probability_of_reaching": min(1.0, float(end.weight @ (left <= most))),
    }
    blocks = by_quantile({q: None if x is None else programme.blocks_in(x) for q, x in remaining.items()})
    return recent.model_copy(update=known), blocks


def _counted(state: ClutchHistory, severity: Severity, series: Series, planned: ProgrammeIn) -> "_Counted":
    """How planned cycles count: as the clutch's record states. If it counts plain cycles but the programme and the
    life's duty both state energies: in proportion to energy, relative to the mean of recent duty."""
    plain = _Counted(severity=severity, scale=series.scale.severity, geometry=state.geometry)
    stated = any(block.energy_per_cycle_kj is not None for block in planned.programme)
    if severity.basis is not SeverityBasis.CYCLES or planned.counted_by == "cycles" or not stated:
        return plain
    origin = series.scale.origin
    blocks = [event.duty.since(origin) for event in state.lives[-1].events if event.duty and event.duty.end > origin]
    energy = Severity(basis=SeverityBasis.DISSIPATED_ENERGY)
    of_energy = severity_map(energy, blocks)
    if of_energy.reference is None:
        return plain
    recent = replace(series.scale.severity, reference=of_energy.reference * of_energy.rate)
    return _Counted(severity=energy, scale=recent, geometry=state.geometry, assumed=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Counted:
    """How severity is counted in a life: its ζ so far, and the disc geometry that converts speed and pressure to
    energy; `assumed`: by energy, although the record counts plain cycles."""

    severity: Severity
    scale: SeverityMap
    geometry: Geometry
    assumed: bool = False

    def programme(self, blocks: PlannedBlocks, cof: float, rng: np.random.Generator) -> DutyProgramme:
        """The programme, with random draws for unstated values; a block without a stated severity counts like recent
        duty."""
        rates = np.full((_PLANS, len(blocks)), self.scale.rate)
        for place, block in enumerate(blocks):
            work = self._work(block, cof, rng.permutation(_NORMALS))
            if work is not None and self.scale.reference is not None:
                rates[:, place] = counted(work, self.scale.reference, self.severity.exponent)
        return DutyProgramme(cycles=np.array([block.cycles for block in blocks]), rates=rates)

    def notices(self, blocks: PlannedBlocks) -> list[Notice]:
        """A warning if planned cycles count by an assumed energy, or if their severity cannot be counted."""
        basis = self.severity.basis.value.replace("_", " ")
        if self.assumed and self.scale.reference is not None:
            recent = f"{self.scale.reference / 1e3:.3g} kJ a cycle of recent duty"
            message = (
                f"each planned cycle counts by its energy, relative to {recent}; the clutch's own runs count by cycles"
            )
            return [Notice(code="counted_by_energy", message=message)]
        if self.severity.basis is SeverityBasis.CYCLES:
            why = "`severity.basis` of the clutch is cycles, so energies are not used"
        elif self.scale.reference is None:
            why = f"no duty run of this life states the {basis}, so there is nothing to compare with"
        else:
            none = np.zeros(1)
            unstated = [str(n) for n, block in enumerate(blocks, start=1) if self._work(block, 0.1, none) is None]
            if not unstated:
                return []
            why = f"block {', '.join(unstated)} of the programme states no {basis}"
        return [Notice(code="severity_not_counted", message=f"{why}: planned cycles count like those of recent duty")]

    def _work(self, block: PlannedBlock, cof: float, normals: FloatArray) -> FloatArray | None:
        """The energy [J] or slid angle [rad] of a cycle, by draw [n]; None if the block states neither."""
        if self.severity.basis is SeverityBasis.CYCLES:
            return None
        speed = block.initial_speed_rpm
        angle = Block(
            end=block.cycles,
            cycles=block.cycles,
            speed=None if speed is None else speed * RADIANS_PER_SECOND_PER_RPM,
            duration=block.engagement_duration_s,
        ).work(SeverityBasis.SLIDING_DISTANCE)
        if self.severity.basis is SeverityBasis.SLIDING_DISTANCE:
            return None if angle is None else np.full(normals.size, angle)
        if block.energy_per_cycle_kj is not None:
            return uncertain_work(1e3 * block.energy_per_cycle_kj, 1e3 * block.sd, normals)
        if angle is None or block.maximum_pressure_bar is None:
            return None
        energy = self.geometry.torque(cof, PASCALS_PER_BAR * block.maximum_pressure_bar) * angle
        return np.full(normals.size, energy)


def _dates(
    ends: Mapping[str, float | None], events: Sequence[Event], pace: float | None
) -> dict[str, str | None] | None:
    """The dates at which these cycles since new, by quantile, are reached at a pace [cycles/h]; None without a pace or
    a run."""
    if pace is None or not events:
        return None
    return {
        quantile: None if end is None else date_of(moment_at(events, pace / _SECONDS_PER_HOUR, end))
        for quantile, end in ends.items()
    }
