"""A run as a JSON body -> `IncomingRun`: pydantic checks the shape, `service.columns` the millions of numbers."""

from typing import Any, TypeVar

import pydantic

from service.columns import check_columns
from service.errors import MOST_ERRORS, MOST_QUOTED, FieldError, InvalidError
from service.lives.incoming_run import IncomingRun, name_run
from service.schemas.base import Schema
from service.schemas.run import RUN_IN, DutyRunIn, MaintenanceRunIn

Body = TypeVar("Body", bound=Schema)

_KINDS = ("stationary_stribeck", "dynamic_stribeck", "duty_cycles", "run_in", "maintenance")


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
        # a field that was added later must not change the hash of a run that was sent without it
        absent = {"engagement_duration_s"} if run.duty.engagement_duration_s is None else None
        details["duty"] = run.duty.model_dump(exclude=absent)
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


def checked(schema: type[Body], body: bytes) -> Body:
    """A small JSON body by its schema; raises InvalidError naming every place that is wrong."""
    try:
        return schema.model_validate_json(body)
    except pydantic.ValidationError as error:
        raise invalid(error) from None


def invalid(error: pydantic.ValidationError) -> InvalidError:
    """pydantic's errors as the service's: pointer, row, value, rule."""
    details = error.errors(include_url=False, include_context=False)
    errors = [_field_error(item["loc"], item["type"], item["msg"], item["input"]) for item in details[:MOST_ERRORS]]
    more = f"; {len(details)} errors in all" if len(details) > 1 else ""
    return InvalidError(errors[0].message + more, errors=errors, total=len(details))


def _field_error(loc: tuple[int | str, ...], code: str, rule: str, value: object) -> FieldError:
    place = loc[1:] if loc and loc[0] in _KINDS else loc
    if code.startswith("union_tag"):
        place = (*place, "kind")
        value = value.get("kind", "") if isinstance(value, dict) else value
    pointer = "".join(f"/{str(part).replace('~', '~0').replace('/', '~1')}" for part in place)
    name = ".".join(str(part) for part in place) or "the body"
    shown = "" if code in ("missing", "json_invalid") else repr(value)[:MOST_QUOTED]
    rule = rule.removeprefix("Value error, ")
    message = f"{name}: {rule}" + (f", got {shown}" if shown and "got" not in rule else "")
    row = place[-1] + 1 if place and isinstance(place[-1], int) else None
    return FieldError(pointer=pointer, code=code, message=message, row=row, value=shown)
