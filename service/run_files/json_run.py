"""A run as JSON -> `IncomingRun`: pydantic for the shape, `columns` for the millions of numbers."""

from typing import Any

import pydantic

from service.errors import MOST_ERRORS, FieldError, InvalidError
from service.lives.incoming_run import IncomingRun, name_run
from service.readers.checks import check_columns
from service.schemas.run import RUN_IN, DutyRunIn, MaintenanceRunIn

_KINDS = ("stationary_stribeck", "dynamic_stribeck", "duty_cycles", "run_in", "maintenance")
_SHOWN = 80


def read_run(body: bytes) -> IncomingRun:
    """The run in a JSON body; raises InvalidError naming every place that is wrong."""
    try:
        run = RUN_IN.validate_json(body)
    except pydantic.ValidationError as error:
        raise invalid(error) from None
    channels = getattr(run, "channels", None)
    columns = {} if channels is None else channels.model_dump(exclude_none=True)
    details: dict[str, Any] = {}
    if isinstance(run, DutyRunIn):
        # a field that came later must not change the hash of what was sent before it
        unsaid = {"engagement_duration_s"} if run.duty.engagement_duration_s is None else None
        details["duty"] = run.duty.model_dump(exclude=unsaid)
    if isinstance(run, MaintenanceRunIn):
        details |= {"event": run.event, "note": run.note}
    return name_run(
        kind=run.kind,
        cycles=run.cycles,
        run_id=run.run_id,
        started_at=None if run.started_at is None else run.started_at.isoformat(),
        origin=run.origin,
        channels=check_columns(columns) if columns else {},
        details=details,
    )


def invalid(error: pydantic.ValidationError) -> InvalidError:
    """pydantic's findings in the service's words: pointer, row, value, rule."""
    found = error.errors(include_url=False, include_context=False)
    errors = [_field_error(each["loc"], each["type"], each["msg"], each["input"]) for each in found[:MOST_ERRORS]]
    more = f"; {len(found)} errors in all" if len(found) > 1 else ""
    return InvalidError(errors[0].message + more, errors=errors, total=len(found))


def _field_error(loc: tuple[int | str, ...], code: str, rule: str, value: object) -> FieldError:
    place = loc[1:] if loc and loc[0] in _KINDS else loc
    if code.startswith("union_tag"):
        place = (*place, "kind")
        value = value.get("kind", "") if isinstance(value, dict) else value
    pointer = "".join(f"/{str(part).replace('~', '~0').replace('/', '~1')}" for part in place)
    name = ".".join(str(part) for part in place) or "the body"
    shown = "" if code in ("missing", "json_invalid") else repr(value)[:_SHOWN]
    said = rule.removeprefix("Value error, ")
    message = f"{name}: {said}" + (f", got {shown}" if shown and "got" not in said else "")
    row = place[-1] + 1 if place and isinstance(place[-1], int) else None
    return FieldError(pointer=pointer, code=code, message=message, row=row, value=shown)
