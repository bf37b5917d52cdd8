"""An adopted extension (`models.diagnosis.extension`) applied to a clutch's runs: corrected mean COFs, and the course.

Artefacts are taken off the plateaus of a test and its curves fitted again, with what was known when it was made: the runs
before it in the history, whenever they arrived. The fit is to the mean over the model's draws; each draw's own mean COF
differs from it by the mean of what it takes off less. Of a sampled record before it only the moment and one point stand
in, for to cut all of them at every new run would cost more than the run.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.diagnosis.campaign import Campaign, StationaryRun
from models.prognosis.criteria import HORIZON
from models.records.runs import Plateaus, loaded
from service.api.clutch import ClutchIn
from service.api.life import ModelName
from service.clutch.analysis import Value, levels_of, mean_cofs
from service.clutch.assumptions import ALL_PRESSURES, AddedCourse, ModelInForce
from service.clutch.criteria import COURSE_PROBES
from service.clutch.diagnosis.campaign import CampaignRun, campaign_of, run_of, without_record
from service.clutch.incoming_run import IncomingRun
from service.clutch.timeline import STATIONARY, Corrected, Event, Life, reference_velocities

if TYPE_CHECKING:
    from models.diagnosis.baseline.law_form import LearnedLaw
    from models.diagnosis.extension import Extension

_log = logging.getLogger("clutchlife")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunReader:
    """A reader of a clutch's runs as sent, each read when needed.

    `read(run_id)` gives a run with its channels, `describe(run_id)` without; `sampled` are those that are sampled records,
    `torque_filter` [s] is the time constant of their torque channel's low-pass. `cut` gives, by run_id, the stationary test
    of a life that was cut already. A history's runs are at its cycles, whatever was sent.
    """

    read: Callable[[str], IncomingRun]
    describe: Callable[[str], IncomingRun]
    sampled: frozenset[str]
    torque_filter: float
    cut: Mapping[str, Callable[[Life], StationaryRun | None]] = field(default_factory=dict)

    def campaign_runs(self, events: Sequence[Event], *, origin: float) -> list[CampaignRun]:
        """The runs of a life in order, without their sampled records."""
        return [
            without_record(replace(self.describe(event.run_id), cycles=event.cycles), origin=origin)
            if event.run_id in self.sampled
            else run_of(replace(self.read(event.run_id), cycles=event.cycles), origin=origin)
            for event in events
        ]

    def stationary_tests(self, life: Life) -> Iterator[StationaryRun]:
        """The stationary tests of a life in order, read one by one with their records."""
        for event in life.events:
            if event.kind != STATIONARY:
                continue
            try:
                run = self.cut[event.run_id](life) if event.run_id in self.cut else self._cut(event, life)
            except ValueError as error:  # a record that this release cuts no longer
                _log.warning("%s: %s", event.run_id, error)
                continue
            if isinstance(run, StationaryRun):
                yield run

    def _cut(self, event: Event, life: Life) -> CampaignRun:
        """A run of a life as the diagnosis reads it, its record cut into plateaus."""
        run = replace(self.read(event.run_id), cycles=event.cycles)
        return run_of(run, origin=life.origin, torque_filter=self.torque_filter)


def extension_of(content: Mapping[str, Any]) -> Extension:
    from models.diagnosis.extension import Extension  # start-up time: it loads the whole diagnosis

    return Extension.from_dict(content)


def corrected_cofs(
    extension: Extension, record: ClutchIn, life: Life, runs: Sequence[CampaignRun], tests: Iterable[StationaryRun]
) -> dict[str, Corrected]:
    """run_id -> pressure [Pa] -> corrected mean COF, its standard deviation, and mean COF under each draw, for the
    `tests` that the extension corrects.

    `runs` are those of the life in order, up to the last of the tests at least.
    """
    if life.speed_range is None:
        return {}
    geometry = record.geometry.to_model()
    velocities = reference_velocities(life.speed_range, geometry)
    place = {event.run_id: index for index, event in enumerate(life.events)}
    law, corrected = extension.law, dict[str, Corrected]()
    for test in tests:
        artefact = _artefact(extension, test, campaign_of(record, runs[: place[test.run_id]]))
        if artefact is None and law is None:
            continue
        if artefact is None:
            artefact = np.zeros((extension.weights.size, test.plateaus.torque.size))
        mean = extension.weights @ artefact
        cofs = _mean_cofs(
            replace(test.plateaus, torque=test.plateaus.torque - mean), law, test.cycles, velocities, geometry
        )
        if cofs:
            off = _mean_cof_changes(mean - artefact, test.plateaus, list(cofs), velocities, geometry)
            corrected[test.run_id] = {
                level: (value, sd, tuple((value + off[level]).tolist())) for level, (value, sd) in cofs.items()
            }
    return corrected


def _mean_cofs(
    freed: Plateaus, law: LearnedLaw | None, cycles: float, velocities: FloatArray, geometry: Geometry
) -> dict[float, Value]:
    """Mean COFs of plateaus without artefacts, by pressure [Pa]: of eq. 3's curves, or of the law S (1 + δ) at cycles
    since new, with S fitted to torque/(1 + δ)."""

    def raised(velocity: FloatArray, pressure: FloatArray) -> FloatArray:
        return (
            np.ones_like(velocity)
            if law is None
            else 1.0 + law.share(velocity, pressure, np.full_like(velocity, cycles))
        )

    by_eq3 = raised(geometry.sliding_velocity(np.abs(freed.speed)), freed.pressure)
    under_load = loaded(replace(freed, torque=freed.torque / by_eq3))
    if under_load is None:
        return {}
    return mean_cofs(
        levels_of(under_load, geometry),
        velocities,
        geometry,
        lambda pressure: raised(velocities, np.full_like(velocities, pressure)),
    )


def _mean_cof_changes(
    torque_change: FloatArray, plateaus: Plateaus, levels: Sequence[float], velocities: FloatArray, geometry: Geometry
) -> dict[float, FloatArray]:
    """pressure [Pa] -> change [d] of the mean COF over the protocol's velocities, from the change of torque [d, n] Nm at the
    plateaus."""
    means = {}
    level_of = np.abs(plateaus.pressure[:, None] - np.array(levels)).argmin(axis=1)
    speed = geometry.sliding_velocity(np.abs(plateaus.speed))
    for place, level in enumerate(levels):
        rows = np.flatnonzero((level_of == place) & (plateaus.speed != 0))
        rows = rows[np.argsort(speed[rows], kind="stable")]
        sign = np.sign(plateaus.speed[rows])
        over = [np.interp(velocities, speed[rows], sign * change[rows]).mean() for change in torque_change]
        means[level] = np.array(over) / geometry.torque_per_cof(level)
    return means


def _artefact(extension: Extension, run: StationaryRun, before: Campaign) -> FloatArray | None:
    """The artefact torque [d, n] Nm to subtract under each draw; None if there is none.

    A test must be accepted under any adopted model, so nothing is subtracted if the model fails for it.
    """
    try:
        artefact = extension.artefact(run, before)
    except (ArithmeticError, LookupError, ValueError):
        _log.exception("%s is not corrected", run.run_id)
        return None
    return artefact if artefact.any() else None


def model_in_force(extension: Extension, life: Life, geometry: Geometry) -> ModelInForce:
    """An extension as it applies to the tracking of a life."""
    from models.diagnosis.report.corrections import corrections  # start-up time: it loads the whole diagnosis

    return ModelInForce(
        name=ModelName(name="extended", effects=list(extension.effects)),
        weights=tuple(extension.weights.tolist()),
        course=added_course(extension, life, geometry),
        severity_exponent=extension.severity_exponent,
        corrected=corrections(extension),
    )


def added_course(extension: Extension, life: Life, geometry: Geometry) -> AddedCourse | None:
    """Mean COF [d, m] added by the effects of use at cycles since new [m] at a pressure [Pa] (0: the reference
    pressures).

    None if it is zero at all tried cycles, if it is not finite at some, or before the reference test.
    """
    if life.speed_range is None or not life.reference or not extension.has_course:
        return None
    from models.diagnosis.extension import NotFiniteError  # start-up time: it loads the whole diagnosis

    # every fifth of the protocol's speeds: their mean is that of all of them to half a per cent of the course
    velocities = reference_velocities(life.speed_range, geometry)[2::5]
    reference = np.array(sorted(life.reference))

    @cache  # asked for the same cycles at every run
    def added(cycles: tuple[float, ...], pressure: float) -> FloatArray:
        """The added mean COF [d, m] at cycles since new, at a pressure or over the reference pressures (0)."""
        levels = np.array([pressure]) if pressure else reference
        per_cof = np.array([geometry.torque_per_cof(float(level)) for level in levels])
        since = np.maximum(np.array(cycles) - life.origin, 0.0)
        course = extension.course(since, levels, velocities)
        return np.asarray((course / per_cof).mean(axis=2), dtype=np.float64)

    probes = tuple(np.concatenate([[0.0], np.geomspace(1.0, HORIZON, COURSE_PROBES)]).tolist())
    try:
        adds = added(probes, ALL_PRESSURES).any()
    except NotFiniteError:
        _log.exception("no course of %s is followed", ", ".join(extension.effects))
        return None
    if not adds:
        return None
    return lambda cycles, pressure: added(tuple(cycles.tolist()), pressure)
