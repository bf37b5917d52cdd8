"""`/degradation`: the tracks of mean COF, of every Stribeck parameter and of any other quantity."""

from collections.abc import Hashable, Iterable, Iterator

from service import repository
from service.api.life import MethodName
from service.api.over_life import (
    Degradation,
    DegradationItem,
    SeverityWeighed,
)
from service.clutch.assumptions import severity_name
from service.clutch.condition import held_runs_left_out
from service.clutch.criteria import SEVERITY_EXPONENTS
from service.clutch.items import warned
from service.clutch.quantities.items import COEFFICIENTS, paths_item, track_item, trajectory_cycles
from service.clutch.quantities.measured import (
    QUANTITIES,
    Family,
    MeasuredLife,
    Quantity,
    Track,
    chosen_life,
    parameter_tracks,
    posterior_of,
    quantity_named,
    slopes_along,
)
from service.clutch.severity_estimate import SeverityPosterior, severity_estimate
from service.clutch.timeline import Series
from service.clutch.with_held import measured_life
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
    """The tracks of a life by one filter: of one quantity at each place where it was measured, or of mean COF and every
    parameter.

    They are as of `at_cycles`, of the present life or an earlier one by its number, with as many joint `draws` of the
    coefficients, and trajectories up to `until` cycles. Raises NotFoundError, and InvalidError for an unknown quantity.
    """
    asked_quantity = None if quantity is None else quantity_named(quantity)
    with database.reading() as connection:
        state = repository.state(connection, clutch_id)
        chosen = chosen_life(state, life, at_cycles)
        evidence = repository.evidence(connection, clutch_id, of_fits=_follows_from_fits(asked_quantity))
    measured = measured_life(state, chosen, evidence)
    items, estimate = list[DegradationItem](), None
    if measured is not None and asked_quantity is not None:
        items = _items(measured, asked_quantity, method, draws, until)
    elif measured is not None and measured.life.reference:
        items = _all_tracks(measured, method, draws, until)
        estimate = severity_estimate(measured.life, measured.assumptions)
    doubted = [] if estimate is None else estimate.doubts(chosen.assumptions.severity)
    return Degradation(
        clutch_id=clutch_id,
        revision=state.revision,
        method=method,
        life=chosen.item(),
        items=items,
        severity_estimate=_severity_item(estimate),
        held_runs=len(chosen.held),
        warnings=[*warned(doubted), *held_runs_left_out(len(chosen.held))],
        model=chosen.assumptions.model.name,
        prior=chosen.assumptions.prior.name,
        severity=severity_name(chosen.assumptions.severity),
        next=None,
    )


def _follows_from_fits(quantity: Quantity | None) -> bool:
    """Whether the tracks of a quantity (None: of mean COF and every parameter) need fitted curves alone."""
    return quantity is None or quantity.family not in (Family.LAG, Family.ENGAGEMENT)


def arguments(
    method: str,
    quantity: str | None,
    at_cycles: float | None,
    life: int | None,
    draws: int = 0,
    until: float | None = None,
) -> tuple[Hashable, ...]:
    """The arguments of `degradation` after the clutch; an empty tuple if all have their defaults, so that the answer
    has one cache key."""
    all_arguments = (method, quantity, at_cycles, life, draws, until)
    return () if all_arguments == ("grid", None, None, None, 0, None) else all_arguments


def _all_tracks(measured: MeasuredLife, method: str, draws: int, until: float | None) -> list[DegradationItem]:
    """Mean COF, and every parameter."""
    direct = _tracked(measured.series(_MEAN_COF), method)
    tracks = parameter_tracks(measured.life, measured.assumptions, measured.tests, method)
    named = {quantity.internal: quantity for quantity in QUANTITIES.values()}
    return [
        track_item(named[series.quantity], series, posterior, draws, until)
        for series, posterior in (*direct, *tracks.values())
    ]


def _items(
    measured: MeasuredLife, quantity: Quantity, method: str, draws: int, until: float | None
) -> list[DegradationItem]:
    """The tracks of one quantity at each place where it was measured."""
    if quantity.family is Family.SLOPE:
        return _slopes(measured, quantity, method, until)
    return [
        track_item(quantity, series, posterior, draws, until)
        for series, posterior in _tracked(measured.series(quantity), method)
    ]


def _slopes(measured: MeasuredLife, quantity: Quantity, method: str, until: float | None) -> list[DegradationItem]:
    """Tracks of the slope of the Stribeck curve, computed from the joint tracks of the parameters at their pressure."""
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
    """The coefficients of eq. 6 as rows of a table, one row per quantity and place."""
    for item in answer.items:
        estimates = {name: getattr(item.coefficients, name, None) for name in COEFFICIENTS}
        yield (
            cells(item, COLUMNS[:5])
            | {"held_runs": answer.held_runs}
            | {name: getattr(estimate, "value", None) for name, estimate in estimates.items()}
            | {f"{name}_sd": getattr(estimate, "sd", None) for name, estimate in estimates.items()}
        )


def _severity_item(estimate: SeverityPosterior | None) -> SeverityWeighed | None:
    """The estimated severity exponent as an answer shows it; None if it was not estimated."""
    if estimate is None:
        return None
    return SeverityWeighed(
        basis=estimate.basis.value,
        exponents=list(SEVERITY_EXPONENTS),
        probabilities=estimate.probability.tolist(),
        value=estimate.mean,
        sd=estimate.deviation,
    )
