"""The rows of a campaign that the baseline and the effects are fitted to.

A *point* is where torque is predicted: a plateau of a stationary test, or one of PHASES evenly spaced phases of a loop. A
*row* is what is compared with data: a plateau again, or one of BINS phase bins of a loop, the mean over the points (and
over the samples) within. So a loop is a few rows however fast it was sampled, and sixty states stay cheap. Where a campaign
is too large, states are left out evenly, the first and the last are kept.

Everything is folded to v >= 0 (the model is odd): `sign` says which way the clutch turned. Axes on which structure may lie
have public channel names, or a name of our own where no channel is it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.campaign import Campaign, DynamicRun, StationaryRun
from models.diagnosis.design.autocorrelation import bin_autocorrelation
from models.diagnosis.design.facts import Facts, facts_of
from models.diagnosis.design.loop_bins import BINS, PHASES, BinnedLoop, binned_loops
from models.records.criteria import UNLOADED
from models.records.pressure_levels import levels_of
from models.records.runs import plate_rise

SPEED, PRESSURE, TORQUE, TEMPERATURE = "speed_rpm", "pressure_bar", "torque_nm", "oil_temperature_c"
CYCLES, CLOCK, PHASE, FREQUENCY = "cycles", "test_clock_s", "loop_phase", "frequency_hz"

IntArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Points at which torque is predicted, or rows that are compared with data, as columns [n]: plateaus, or phases of
    loops."""

    run: IntArray  # index into Design.runs
    cycles: FloatArray
    # [Pa]; where the clutch is open the campaign's lowest closed pressure, for the laws hold for no other
    pressure: FloatArray
    engaged: FloatArray  # 1, or 0 where the clutch is open: no friction acts there
    velocity: FloatArray  # [m/s] >= 0, folded
    sign: FloatArray  # ±1, which way the clutch turned
    acceleration: FloatArray  # [m/s²] of the folded velocity
    temperature: FloatArray  # of the oil [K], NaN where not measured
    plate_rise: FloatArray  # of the plate above the oil [K], NaN where not measured
    clock: FloatArray  # [s] since the test began
    moment: FloatArray  # [s] since 1970, NaN where unknown
    angular_frequency: FloatArray  # [rad/s], 0 at plateaus
    phase: FloatArray  # [rad]
    loop: IntArray  # index, -1 at plateaus
    previous: IntArray  # index of the plateau before it in the same run, -1 where there is none

    @property
    def steady(self) -> NDArray[np.bool_]:
        """Whether each point [n] is a plateau."""
        return self.loop < 0

    def take(self, index: IntArray | NDArray[np.bool_]) -> "Points":
        """The points at `index`; `previous` is set to -1, for the plateau that it means may be gone."""
        columns = {field.name: getattr(self, field.name)[index] for field in fields(self)}
        return Points(**{**columns, "previous": np.full(columns["run"].size, -1, dtype=np.intp)})


def mark_open(points: Points) -> Points:
    """The points with pressures below UNLOADED marked as an open clutch; their pressure becomes the lowest closed
    one."""
    closed = points.pressure >= UNLOADED
    lowest = float(points.pressure[closed].min()) if closed.any() else 1.0
    return replace(points, engaged=closed.astype(np.float64), pressure=np.where(closed, points.pressure, lowest))


#: What stands where nothing is given (0 in all others).
_USUAL: dict[str, float] = {"engaged": 1, "sign": 1, "loop": -1, "previous": -1}
_USUAL |= dict.fromkeys(("temperature", "plate_rise", "moment"), np.nan)


def points_of(count: int, **known: FloatArray | IntArray | float | None) -> Points:
    """`count` points: plateaus of a closed clutch that turns forwards unless given; what was not measured is None."""
    columns: dict[str, Any] = {}
    for field in fields(Points):
        known_values = known.get(field.name)
        values = _USUAL.get(field.name, 0) if known_values is None else known_values
        columns[field.name] = np.full(count, values, dtype=np.intp if field.type is IntArray else np.float64)
    return Points(**columns)


def thinned(campaign: Campaign, notes: list[str]) -> Campaign:
    """The campaign with states left out evenly where it is too large; `notes` gets a sentence on the omitted states."""
    looped = np.unique([run.cycles for run in campaign.dynamic])
    if looped.size > criteria.MOST_LOOP_STATES:
        kept = _evenly(looped, criteria.MOST_LOOP_STATES)
        notes.append(
            f"Dynamic tests of {len(kept)} of {looped.size} states were used, spread evenly, because there are very many."
        )
        campaign = replace(campaign, dynamic=tuple(run for run in campaign.dynamic if run.cycles in kept))
    states = np.unique([run.cycles for run in campaign.tests])
    size = sum(min(run.plateaus.torque.size, criteria.MOST_PLATEAUS) for run in campaign.stationary)
    size += sum(8 * BINS for _ in campaign.dynamic)  # some eight pressures each
    if size <= criteria.MOST_ROWS or states.size < 3:
        return campaign
    kept = _evenly(states, max(2, int(states.size * criteria.MOST_ROWS / size)))
    notes.append(
        f"{states.size - len(kept)} of {states.size} states were left out evenly, because the campaign is very large."
    )
    return replace(
        campaign,
        stationary=tuple(run for run in campaign.stationary if run.cycles in kept),
        dynamic=tuple(run for run in campaign.dynamic if run.cycles in kept),
    )


def _evenly(states: FloatArray, count: int) -> set[float]:
    """So many of the states, evenly among them, the first and the last included."""
    return set(states[np.linspace(0, states.size - 1, count).round().astype(int)].tolist())


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """The design of a campaign's fit: points of prediction, rows of measured torque, and the facts beside them."""

    points: Points  # [P] plateaus first, then PHASES points a loop
    rows: Points  # [N] plateaus first, then the loops' bins
    torque: FloatArray  # [N] Nm, measured, folded
    samples: FloatArray  # [N] how many were averaged in each row
    level: FloatArray  # [N] Pa, pressure level, 0 where the clutch is open
    curve: IntArray  # [N] an index that the rows of one run at one level share
    bins: IntArray  # [N - plateaus] which bin of the flat (loop, bin) order each loop row is
    bin_offset: FloatArray  # [N - plateaus] how far past that bin's middle (in bins) its samples lie
    # rows [n] of a loop, and what a further period of it differs by there [n] Nm, as if each were one sample (`loop_bins`)
    period_differences: tuple[tuple[IntArray, FloatArray], ...]
    chains: tuple[IntArray, ...]  # [b, n] rows that follow each other in a run or loop, those of one length together
    plateaus: int  # how many
    loops: int
    # of neighbouring bins, and of those next but one, by the loops' samples; None where these are too few
    bin_autocorrelation: tuple[float, float] | None
    runs: tuple[StationaryRun | DynamicRun, ...]  # that gave rows
    facts: Facts
    notes: tuple[str, ...]  # what was left out

    @property
    def closed(self) -> NDArray[np.bool_]:
        """Whether the clutch is closed at each row [N], so that there is friction and its pressure means something."""
        return self.rows.engaged > 0

    @property
    def levels(self) -> FloatArray:
        """The distinct pressure levels [l] Pa of the closed clutch, ascending."""
        return np.unique(self.level[self.closed])

    @property
    def usual_torque(self) -> float:
        """Median absolute torque of the closed clutch [Nm], kept off 0."""
        return max(float(np.median(np.abs(self.torque[self.closed]))) if self.closed.any() else 0.0, 1e-12)

    def to_rows(self, at_points: FloatArray) -> FloatArray:
        """Values [N, ...] at the rows from values [P, ...] at the points: each bin by a line through its points, at the
        mean phase of its samples."""
        if not self.loops:
            return at_points
        out = np.empty((self.torque.size, *at_points.shape[1:]))
        out[: self.plateaus] = at_points[: self.plateaus]
        per_bin = PHASES // BINS
        place = (np.arange(per_bin) + 0.5) / per_bin - 0.5
        weights = 1.0 / per_bin + self.bin_offset[:, None] * place / (place**2).sum()  # a line through a bin's points
        within = at_points[self.plateaus :].reshape(-1, per_bin, *at_points.shape[1:])[self.bins]
        out[self.plateaus :] = np.einsum("bk,bk...->b...", weights, within)
        return out


def build_design(campaign: Campaign) -> Design:
    """The points, rows and facts of a campaign, thinned where it is too large.

    Never raises on a campaign that is valid by itself; it may have no rows."""
    notes: list[str] = []
    used = thinned(campaign, notes)
    tests = _stationary_tests(used, notes)
    plateaus = sum(torque.size for _, _, torque in tests)
    runs: list[StationaryRun | DynamicRun] = [run for run, _, _ in tests]
    loops, loop_points = _loops(used, runs, notes)
    points = mark_open(_joined([points_of(0), *(block for _, block, _ in tests), *loop_points]))
    torque, samples, offsets = (
        np.concatenate([np.zeros(0), *(getattr(loop, name) for loop in loops)])
        for name in ("torque", "samples", "bin_offset")
    )
    bins = np.flatnonzero(samples > 0)
    per_bin = PHASES // BINS
    middle = plateaus + bins * per_bin + per_bin // 2
    rows = points.take(np.concatenate([np.arange(plateaus), middle]).astype(np.intp))
    level, closed = np.zeros(rows.run.size), rows.engaged > 0
    level[closed] = levels_of(rows.pressure[closed]) if closed.any() else 0.0
    _, curve = np.unique(np.stack([rows.run, level]), axis=1, return_inverse=True)
    return Design(
        points=points,
        rows=rows,
        torque=np.concatenate([np.zeros(0), *(at_plateaus for _, _, at_plateaus in tests), torque[bins]]),
        samples=np.concatenate([np.ones(plateaus), samples[bins]]),
        level=level,
        curve=np.asarray(curve, dtype=np.intp).reshape(-1),
        bins=np.asarray(bins, dtype=np.intp),
        bin_offset=offsets[bins],
        period_differences=tuple(_period_differences(loops, bins, plateaus)),
        chains=_chains(rows),
        plateaus=plateaus,
        loops=len(loops),
        bin_autocorrelation=bin_autocorrelation([loop.autocorrelation for loop in loops]),
        runs=tuple(runs),
        facts=replace(facts_of(used), shortest_period=_shortest(points)),
        notes=tuple(notes),
    )


def _stationary_tests(campaign: Campaign, notes: list[str]) -> list[tuple[StationaryRun, Points, FloatArray]]:
    """Stationary runs that have plateaus in motion, with their points [n] and folded torque [n] Nm; `notes` gets a
    sentence on omitted plateaus."""
    tests: list[tuple[StationaryRun, Points, FloatArray]] = []
    rows = 0
    for run in campaign.stationary:
        points, torque = _plateaus(run, campaign, len(tests), rows, notes)
        if torque.size:
            tests.append((run, points, torque))
            rows += torque.size
    return tests


def _loops(
    campaign: Campaign, runs: list[StationaryRun | DynamicRun], notes: list[str]
) -> tuple[list[BinnedLoop], list[Points]]:
    """Loops of the dynamic runs, and the points [PHASES] of each. `runs` gets the runs that have loops; `notes` sentences
    on what was left out."""
    loops: list[BinnedLoop] = []
    points: list[Points] = []
    reasons: list[str] = []  # why a dynamic test gave no loop at all
    for run in campaign.dynamic:
        test_loops, sentences = binned_loops(run.record, campaign.geometry)
        notes.extend(f"{run.run_id}: {sentence}" for sentence in sentences)
        reasons += sentences[:1] if not test_loops else []
        points += [_loop_points(loop, run, len(runs), len(loops) + k) for k, loop in enumerate(test_loops)]
        loops += test_loops
        if test_loops:
            runs.append(run)
    if reasons:
        count = f"{len(reasons)} of {len(campaign.dynamic)} ({reasons[0].rstrip('.')})"
        notes.append(f"Dynamic tests that could not be evaluated and were left out: {count}.")
    return loops, points


def _joined(blocks: list[Points]) -> Points:
    """All blocks of points, one after the other."""
    columns = {field.name: [getattr(block, field.name) for block in blocks] for field in fields(Points)}
    return Points(**{name: np.concatenate(parts) for name, parts in columns.items()})


def _shortest(points: Points) -> float | None:
    """The shortest period of a loop [s]; None without loops."""
    frequencies = points.angular_frequency[~points.steady]
    return float(2 * np.pi / frequencies.max()) if frequencies.size else None


def _period_differences(
    loops: list[BinnedLoop], bins: IntArray, plateaus: int
) -> Iterator[tuple[IntArray, FloatArray]]:
    """Rows [n] of each loop, and how each of its further periods differs there [n] Nm (`loop_bins`)."""
    for number, loop in enumerate(loops):
        first, last = np.searchsorted(bins, [number * BINS, (number + 1) * BINS])
        for differences in loop.period_differences[:, bins[first:last] - number * BINS]:
            measured = np.isfinite(differences)
            yield np.asarray(plateaus + first + np.flatnonzero(measured), dtype=np.intp), differences[measured]


def _chains(rows: Points) -> tuple[IntArray, ...]:
    """Index arrays [b, n] of consecutive rows in runs of plateaus, then in loops, for the correlation of neighbours;
    chains of one length are whitened together."""
    owner = np.where(rows.steady, rows.run, rows.loop + int(rows.run.max(initial=0)) + 1)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(owner)) + 1, [owner.size]])
    starts, lengths = edges[:-1], np.diff(edges)
    steady = np.append(rows.steady, False)[starts]  # there may be no rows
    chains = []
    for kind in (steady, ~steady):
        for length in np.unique(lengths[kind & (lengths > 0)]):
            first = starts[kind & (lengths == length)]
            chains.append(np.asarray(first[:, None] + np.arange(length), dtype=np.intp))
    return tuple(chains)


def _plateaus(
    run: StationaryRun, campaign: Campaign, index: int, offset: int, notes: list[str]
) -> tuple[Points, FloatArray]:
    """Points and folded torque of a run's plateaus in motion; `offset` is its first row."""
    table = run.plateaus
    usable = np.flatnonzero(table.speed != 0)
    if usable.size < table.torque.size:
        notes.append(f"{run.run_id}: {table.torque.size - usable.size} plateaus at rest left out.")
    if usable.size > criteria.MOST_PLATEAUS:
        notes.append(f"{run.run_id}: {criteria.MOST_PLATEAUS} of {usable.size} plateaus used, spread evenly.")
        usable = usable[np.linspace(0, usable.size - 1, criteria.MOST_PLATEAUS).round().astype(int)]
    velocity = campaign.geometry.sliding_velocity(table.speed[usable])
    sign = np.copysign(1.0, velocity)
    count = usable.size
    times = criteria.PLATEAU_DURATION * (np.arange(table.torque.size) + 0.5) if run.time is None else np.array(run.time)
    clock = np.asarray(times[usable], dtype=np.float64)
    rise = plate_rise(table)
    consecutive = np.concatenate([[-1], np.where(np.diff(usable) == 1, offset + np.arange(count - 1), -1)])
    points = points_of(
        count,
        run=index,
        cycles=float(run.cycles),
        pressure=table.pressure[usable],
        velocity=np.abs(velocity),
        sign=sign,
        temperature=None if table.oil_temperature is None else table.oil_temperature[usable],
        plate_rise=None if rise is None else rise[usable],
        clock=clock,
        moment=None if run.moment is None else run.moment + clock,
        previous=consecutive[:count],
    )
    return points, sign * table.torque[usable]


def _loop_points(loop: BinnedLoop, run: DynamicRun, index: int, number: int) -> Points:
    """Points of the loop of that number, of a run of that index."""
    own = {field.name for field in fields(BinnedLoop)} & {field.name for field in fields(Points)}
    return points_of(
        loop.velocity.size,
        run=index,
        cycles=float(run.cycles),
        moment=None if run.moment is None else run.moment + loop.clock,
        loop=number,
        **{name: getattr(loop, name) for name in own},
    )
