"""Receipts and predictions as JSON, in the names and units of the API."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Final

from models.friction.identification import StribeckFit
from models.loops.loops import FrictionLoop
from models.prognosis.criteria import HORIZON, QUANTILES
from models.prognosis.first_passage import horizon_at
from service.api.life import BackCastCount, Criterion, Current, DeclaredEnd, LifePrediction, Quantiles
from service.api.run import Evaluation, Fit, Loop, Parameters, ReceivedFile, Warned
from service.channels import bar, whole
from service.clutch.analysis import Analysis, LevelFit, Value
from service.clutch.assumptions import ALL_PRESSURES, MEAN_COF, Assumptions, severity_name
from service.clutch.engagements import engagement_item
from service.clutch.incoming_run import IncomingRun
from service.clutch.timeline import WORN, ByPressure, Event, is_possible
from service.errors import Hypothesis, Notice
from service.settings import CODE_VERSION

#: Public name and unit of each Stribeck parameter.
PARAMETER_UNITS = {
    "static_torque": ("static_torque_nm", "Nm"),
    "coulomb_ratio": ("coulomb_ratio", "1"),
    "stribeck_velocity": ("stribeck_velocity_m_s", "m/s"),
    "viscous_coefficient": ("viscous_coefficient", "Nm/(m/s)^0.3"),
}
#: States of a prediction in which nothing is predicted any more, or not yet.
INSUFFICIENT: Final = "insufficient_data"
ENDED: Final = "ended"
#: The quantile of the end of life that is the safe bound.
SAFE = min(QUANTILES)


def receipt(
    clutch_id: str,
    run: IncomingRun,
    analysis: Analysis,
    *,
    received_at: str,
    cofs: ByPressure | None = None,
    loops: Sequence[FrictionLoop] = (),
) -> Evaluation:
    """The receipt of a run, with mean COFs and loops if they are known already."""
    file = run.file or {}
    return Evaluation(
        clutch_id=clutch_id,
        run_id=run.run_id,
        kind=run.kind,
        cycles=whole(run.cycles),
        started_at=run.started_at,
        origin=run.origin,
        received_at=received_at,
        content_sha256=run.content_sha256,
        duplicate=False,
        file=ReceivedFile(**{name: file[name] for name in ReceivedFile.model_fields}) if file else None,
        warnings=[*warnings_of_file(run), *warned([*date_notice(run.started_at, received_at), *analysis.warnings])],
        fits=fit_items(analysis.fits, cofs or {}),
        loops=loop_items(loops),
        engagement=None if analysis.engagement is None else engagement_item(analysis.engagement),
        duty=run.details.get("duty"),
        event=run.details.get("event"),
        reason=run.details.get("reason"),
        note=run.details.get("note"),
        code_version=CODE_VERSION,
    )


def date_notice(started_at: str | None, received_at: str) -> list[Notice]:
    """The warning of an impossible date."""
    if started_at is None or is_possible(started_at, received_at):
        return []
    started, received = (datetime.fromisoformat(each).timestamp() for each in (started_at, received_at))
    odd = f"is in the future, after the run was received at {received_at}" if started > received else "is too early"
    message = (
        f"the date (started_at) {started_at} {odd}. The run counts as if it had none, and takes no part in the pace: set "
        "the rig's clock"
    )
    return [Notice(code="date_not_possible", message=message)]


def fit_items(levels: Sequence[LevelFit], cofs: ByPressure) -> list[Fit]:
    """The fits of a test as a receipt shows them, with mean COF where it is determined."""
    return [_fit_item(level.fit, cofs.get(level.fit.pressure, (None, None))) for level in levels]


def doubted(notices: Sequence[Notice]) -> list[dict[str, object]]:
    """Notices in the form of stored doubts about a run."""
    return [
        {"code": notice.code, "message": notice.message}
        | ({} if notice.likely_cycles is None else {"likely_cycles": whole(notice.likely_cycles)})
        | ({} if notice.hypothesis is None else _hypothesis(notice.hypothesis))
        for notice in notices
    ]


def _hypothesis(hypothesis: Hypothesis) -> dict[str, object]:
    proposal = {"cycles_offset": hypothesis.cycles_offset, "cycles_factor": hypothesis.cycles_factor}
    stated = {name: whole(float(value)) for name, value in proposal.items() if value is not None}
    shown = {"kind": hypothesis.kind, "runs": list(hypothesis.runs), "proposal": stated}
    return {"id": hypothesis.name, "hypothesis": shown}


def warned(notices: Sequence[Notice]) -> list[Warned]:
    """Notices in the form of an answer's warnings."""
    return [Warned(code=notice.code, message=notice.message) for notice in notices]


def warnings_of_file(run: IncomingRun) -> list[Warned]:
    """The stored warnings from reading the run's file."""
    return [Warned(code=each["code"], message=each["message"]) for each in (run.file or {}).get("warnings", ())]


def _fit_item(fit: StribeckFit, cof: Value | tuple[None, None]) -> Fit:
    """A fitted curve as a receipt shows it, with its mean COF."""
    names = [public for public, _ in PARAMETER_UNITS.values()]
    return Fit(
        pressure_bar=bar(fit.pressure),
        parameters=Parameters(**dict(zip(names, map(float, fit.parameters.as_array()), strict=True))),
        standard_errors=Parameters(**dict(zip(names, map(float, fit.covariance.diagonal() ** 0.5), strict=True))),
        mse_percent=fit.mse_percent,
        rmse_nm=fit.rmse,
        noise_nm=fit.noise,
        acceptable=fit.acceptable,
        mean_cof=cof[0],
        mean_cof_sd=cof[1],
        points=fit.points,
        status=fit.status.value,
        undetermined=[PARAMETER_UNITS[name][0] for name in fit.undetermined],
        message=fit.message,
    )


def loop_items(loops: Sequence[FrictionLoop]) -> list[Loop]:
    """The friction loops of a test as a receipt shows them."""
    return [
        Loop(
            pressure_bar=bar(loop.pressure),
            loop_area_nm_m_s=loop.area,
            loop_area_sd_nm_m_s=loop.area_sd,
            attractor_nm_s=loop.attractor,
            attractor_sd_nm_s=loop.attractor_sd,
            film_time_s=loop.film_time,
            film_time_sd_s=loop.film_time_sd,
            frequency_hz=loop.frequency,
            periods=loop.periods,
            direction=str(loop.direction.value),
            better_law=loop.better_law,
            status=loop.status.value,
            message=loop.message,
        )
        for loop in loops
    ]


def insufficient(assumptions: Assumptions, cycles: float | None, pressure: float, fraction: float) -> LifePrediction:
    """The answer with status `insufficient_data`, which predicts nothing."""
    return LifePrediction(
        as_of_cycles=None if cycles is None else whole(cycles),
        runs_used=0,
        status=INSUFFICIENT,
        criterion=criterion_item(fraction, pressure, None, None),
        current=Current(
            mean_cof=None, mean_cof_sd=None, measured_at_cycles=None, fraction_of_initial=None, health=None
        ),
        remaining_cycles=by_quantile({}),
        end_of_life_cycles=by_quantile({}),
        at_least=None,
        probability_of_reaching=None,
        course=None,
        back_cast=BackCastCount(held=0, of=0, widening=1.0, widening_later=1.0),
        ended_lives=0,
        ended=None,
        sample=None,
        horizon_cycles=whole(HORIZON),
        warnings=[],
        model=assumptions.model.name,
        prior=assumptions.prior.name,
        severity=severity_name(assumptions.severity),
    )


def share_of_way(value: float, initial: float, limit: float, *, rises: bool = False) -> float | None:
    """Health by one criterion, 0 to 1: the remaining share of the way from a quantity's initial value down to its limit
    (up to it if it `rises`); None if it began at the limit or beyond."""
    way, left = (limit - initial, limit - value) if rises else (initial - limit, value - limit)
    return min(1.0, max(0.0, left / way)) if way > 0.0 else None


def safe_bound(end: float | None, now: float, origin: float) -> float:
    """The cycles left from `now` with 95 % probability, from the 5 % quantile of the end of life in cycles since new;
    None if that lies beyond the horizon of the life that began at `origin`."""
    return max(0.0, (origin + horizon_at(now - origin) if end is None else end) - now)


def ended(prediction: LifePrediction, end: Event | None) -> LifePrediction:
    """A prediction adapted to the declared `end` of its life (None: it goes on): after wear, the remaining life is
    zero.

    A life that ended for another reason has no remaining life either, but keeps its predicted end of life.
    """
    if end is None or end.end is None:
        return prediction
    at = whole(end.cycles)
    declared = {"status": ENDED, "ended": DeclaredEnd(cycles=at, reason=end.end, run_id=end.run_id)}
    if end.end != WORN:
        return prediction.model_copy(update={**declared, "remaining_cycles": by_quantile({}), "at_least": None})
    worn = {
        "current": prediction.current.model_copy(update={"health": 0.0}),
        "remaining_cycles": by_quantile(dict.fromkeys(QUANTILES, 0.0)),
        "at_least": 0.0,
        "end_of_life_cycles": by_quantile(dict.fromkeys(QUANTILES, float(at))),
        "probability_of_reaching": 1.0,
    }
    return prediction.model_copy(update=declared | worn)


def criterion_item(fraction: float, pressure: float, initial: float | None, threshold: float | None) -> Criterion:
    """The criterion on mean COF over a pressure [Pa]."""
    return Criterion(
        quantity=MEAN_COF,
        fraction=fraction,
        initial_mean_cof=initial,
        threshold_mean_cof=threshold,
        pressure_bar=None if pressure == ALL_PRESSURES else bar(pressure),
    )


def by_quantile(values: Mapping[float, float | None]) -> Quantiles:
    """Numbers by quantile as sent to clients; null if missing."""
    return {f"{quantile:g}": values.get(quantile) for quantile in QUANTILES}
