"""`/degradation`: the tracks of mean COF, of every Stribeck parameter and of any other quantity, and mean COF from the
parameters (`models.prognosis.from_parameters`)."""

from collections.abc import Hashable, Iterable, Iterator, Mapping

import numpy as np

from models.friction.stribeck import PARAMETER_NAMES
from models.prognosis.criteria import FEWEST_TESTS, QUANTILES
from models.prognosis.first_passage import ends_of_life, horizon_at
from models.prognosis.first_passage import paths as track_paths
from models.prognosis.from_parameters import CofPaths, disagreement, far_apart, mean_cof_paths
from service import repository
from service.api.life import MethodName
from service.api.over_life import (
    Degradation,
    DegradationItem,
    Disagreement,
    Rebuilt,
    SeverityWeighed,
    Trajectory,
)
from service.clutch.assumptions import ALL_PRESSURES, severity_name
from service.clutch.condition import held_runs_left_out
from service.clutch.criteria import SEVERITY_EXPONENTS
from service.clutch.items import by_quantile, warned
from service.clutch.quantities.items import COEFFICIENTS, paths_item, track_item, trajectory_cycles
from service.clutch.quantities.measured import (
    QUANTITIES,
    Family,
    MeasuredLife,
    ParameterTracks,
    Quantity,
    Track,
    chosen_life,
    parameter_tracks,
    posterior_of,
    pressure_level,
    quantity_named,
    slopes_along,
)
from service.clutch.severity_estimate import SeverityPosterior, severity_estimate
from service.clutch.timeline import Series, reference_velocities
from service.clutch.tracking import offset_of, step_rng
from service.clutch.with_held import measured_life
from service.errors import Notice
from service.tables import Cells, cells
from storage.engine.database import Database

COLUMNS = (
    "quantity",
    "unit",
    "pressure_bar",
    "speed_rpm",
    "frequency_hz",
    *(f"{name}{part}" for name in COEFFICIENTS for part in ("", "_sd")),
    "held_runs",
)
_MEAN_COF = QUANTITIES["mean_cof"]


def degradation(
    database: Database,
    clutch_id: str,
    method: MethodName = "grid",
    quantity: str | None = None,
    at_cycles: float | None = None,
    life: int | None = None,
    draws: int = 0,
    until: float | None = None,
) -> Degradation:
    """The tracks of a life by a filter: of one quantity wherever it was measured, or of mean COF and every parameter.

    As it was at `at_cycles`, of the present life or of an earlier one by its number; with so many joint `draws` of the
    coefficients, and trajectories up to `until` cycles. Raises NotFoundError, and InvalidError for a quantity that is none.
    """
    asked_quantity = None if quantity is None else quantity_named(quantity)
    with database.reading() as connection:
        state = repository.state(connection, clutch_id)
        chosen = chosen_life(state, life, at_cycles)
        evidence = repository.evidence(connection, clutch_id, of_fits=_follows_from_fits(asked_quantity))
    measured = measured_life(state, chosen, evidence)
    items, from_parameters, estimate = list[DegradationItem](), None, None
    if measured is not None and asked_quantity is not None:
        items = _items(measured, asked_quantity, method, draws, until)
    elif measured is not None and measured.life.reference:
        items, from_parameters = _all_tracks(measured, method, draws, until)
        estimate = severity_estimate(measured.life, measured.assumptions)
    doubted = [] if estimate is None else estimate.doubts(chosen.assumptions.severity)
    return Degradation(
        clutch_id=clutch_id,
        revision=state.revision,
        method=method,
        life=chosen.item(),
        items=items,
        rebuilt=from_parameters,
        severity_estimate=_severity_item(estimate),
        held_runs=len(chosen.held),
        warnings=[*warned([*_disagreements(from_parameters), *doubted]), *held_runs_left_out(len(chosen.held))],
        model=chosen.assumptions.model.name,
        prior=chosen.assumptions.prior.name,
        severity=severity_name(chosen.assumptions.severity),
        next=None,
    )


def _follows_from_fits(quantity: Quantity | None) -> bool:
    """Whether the tracks of a quantity, or of mean COF and every parameter, follow from fitted curves alone."""
    return quantity is None or quantity.family not in (Family.LAG, Family.ENGAGEMENT)


def arguments(
    method: str,
    quantity: str | None,
    at_cycles: float | None,
    life: int | None,
    draws: int = 0,
    until: float | None = None,
) -> tuple[Hashable, ...]:
    """The arguments of `degradation` behind the clutch; none where all are left out: so the answer is kept under one key."""
    all_arguments = (method, quantity, at_cycles, life, draws, until)
    return () if all_arguments == ("grid", None, None, None, 0, None) else all_arguments


def _all_tracks(
    measured: MeasuredLife, method: str, draws: int, until: float | None
) -> tuple[list[DegradationItem], Rebuilt | None]:
    """Mean COF, every parameter, and mean COF from the parameters."""
    direct = _tracked(measured.series(_MEAN_COF), method)
    tracks = parameter_tracks(measured.life, measured.assumptions, measured.tests, method)
    from_parameters = _from_parameters(
        measured, tracks, {series.pressure: (series, posterior) for series, posterior in direct}
    )
    named = {quantity.internal: quantity for quantity in QUANTITIES.values()}
    items = [
        track_item(named[series.quantity], series, posterior, draws, until)
        for series, posterior in (*direct, *tracks.values())
    ]
    return items, from_parameters


def _items(
    measured: MeasuredLife, quantity: Quantity, method: str, draws: int, until: float | None
) -> list[DegradationItem]:
    """One quantity wherever it was measured."""
    if quantity.family is Family.SLOPE:
        return _slopes(measured, quantity, method, until)
    return [
        track_item(quantity, series, posterior, draws, until)
        for series, posterior in _tracked(measured.series(quantity), method)
    ]


def _slopes(measured: MeasuredLife, quantity: Quantity, method: str, until: float | None) -> list[DegradationItem]:
    """Slopes from the joint tracks of the parameters at their pressure."""
    slopes = measured.series(quantity)
    tracks = parameter_tracks(measured.life, measured.assumptions, measured.tests, method)
    direct = {
        series.pressure: (series, posterior) for series, posterior in _tracked(measured.mean_cofs().values(), method)
    }
    items = []
    for series in slopes:
        at = series.scale.progress(trajectory_cycles(series, until))
        paths = slopes_along(measured, tracks, direct[series.pressure], series.speed_rpm or 0.0, at)
        items.append(paths_item(quantity, series, paths, until=until))
    return items


def _tracked(several: Iterable[Series], method: str) -> list[Track]:
    return [(series, posterior_of(series, method)) for series in several if series.measurements]


def rows(answer: Degradation) -> Iterator[Cells]:
    """Eq. 6's coefficients as rows of a table, a row a quantity and place."""
    for item in answer.items:
        estimates = {name: getattr(item.coefficients, name, None) for name in COEFFICIENTS}
        yield (
            cells(item, COLUMNS[:5])
            | {"held_runs": answer.held_runs}
            | {name: getattr(estimate, "value", None) for name, estimate in estimates.items()}
            | {f"{name}_sd": getattr(estimate, "sd", None) for name, estimate in estimates.items()}
        )


def _from_parameters(measured: MeasuredLife, tracks: ParameterTracks, direct: Mapping[float, Track]) -> Rebuilt | None:
    """Mean COF from the parameters, in the public shape; None with too few tests. `direct`: its own tracks by pressure."""
    life, (series, _) = measured.life, direct[ALL_PRESSURES]
    tested = {measurement.progress for measurement in series.measurements}
    if life.speed_range is None or len(tested) < FEWEST_TESTS:
        return None
    paths = mean_cof_paths(
        [
            pressure_level(measured, tracks, direct[level], level)
            for level in life.reference
            if level in direct and all((name, level) in tracks for name in PARAMETER_NAMES)
        ],
        now=series.measurements[-1].progress,
        horizon=float(
            series.scale.progress(series.scale.origin + horizon_at(life.events[-1].cycles - series.scale.origin))
        ),
        velocities=reference_velocities(life.speed_range, measured.geometry),
        reference_cofs=[cof for cof, _ in life.reference.values()],
        rng=step_rng("rebuilt", series, len(series.measurements)),
    )
    return None if paths is None else _rebuilt(paths, direct[ALL_PRESSURES], measured.fraction)


def _severity_item(estimate: SeverityPosterior | None) -> SeverityWeighed | None:
    if estimate is None:
        return None
    return SeverityWeighed(
        basis=estimate.basis.value,
        exponents=list(SEVERITY_EXPONENTS),
        probabilities=estimate.probability.tolist(),
        value=estimate.mean,
        sd=estimate.deviation,
    )


def _disagreements(from_parameters: Rebuilt | None) -> list[Notice]:
    if from_parameters is None:
        return []
    words = {"now_sd": "mean COF now", "end_of_life_sd": "the median end of life"}
    return [
        Notice(
            code="tracks_disagree",
            message=f"{words[name]}, computed from the four Stribeck parameters, is {abs(value):.1f} standard deviations "
            f"{'above' if value > 0 else 'below'} its direct estimate. Look at the fits of the last tests",
        )
        for name in words
        if far_apart(value := getattr(from_parameters.disagreement, name))
    ]


def _rebuilt(paths: CofPaths, direct: Track, fraction: float) -> Rebuilt:
    """The paths of mean COF in the public shape, beside the direct track."""
    series, posterior = direct
    now = float(paths.progress[paths.now])
    ends = series.scale.cycles(paths.ends_of_life(fraction))
    shown = paths.progress <= max(1.0, now) * 1.5
    cap = float(series.scale.cycles(paths.progress[-1]))
    quantiles = np.quantile(np.minimum(ends, 10 * cap), QUANTILES).tolist()
    offset, horizon = offset_of(series), float(paths.progress[-1])
    differences = disagreement(
        paths.present,
        ends,
        track_paths(posterior, paths.progress[paths.now : paths.now + 1], offset)[0],
        series.scale.cycles(ends_of_life(posterior, fraction, offset=offset, horizon=horizon)),
        posterior.weight,
        series.scale.origin,
    )
    lower, median, upper = (row[shown].tolist() for row in paths.band())
    return Rebuilt(
        trajectory=Trajectory(
            cycles=series.scale.cycles(paths.progress)[shown].tolist(), lower=lower, median=median, upper=upper
        ),
        end_of_life_cycles=by_quantile(
            {q: None if value > cap else value for q, value in zip(QUANTILES, quantiles, strict=True)}
        ),
        disagreement=Disagreement(now_sd=differences.now, end_of_life_sd=differences.end_of_life),
    )
