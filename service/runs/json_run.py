"""Reads a run from a JSON body: pydantic checks its shape, `service.channels` its numbers.

Other bodies that are JSON come in here too. Whatever is sent, memory stays within some ten times its size.
"""

import codecs
import re
from collections.abc import Callable
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import pydantic
import pydantic_core

from service.api.base import LONGEST_NOTE, MAX_MARKS, rule_in_words
from service.api.run import RUN_IN, DutyRunIn, MaintenanceRunIn
from service.channels import CHANNELS, check_columns
from service.clutch.incoming_run import IncomingRun, name_run
from service.clutch.timeline import END_OF_LIFE, WORN
from service.errors import MAX_ERRORS, MAX_QUOTED, FieldError, InvalidError

#: Items of a list and characters of a name of a run that are checked by its schema: more than a message quotes.
_MAX_SHOWN = 100

#: The character U+0000 as JSON writes it, its backslash no escaped one.
_NUL = re.compile(rb"(?<!\\)(?:\\\\)*\\u0000")
#: Byte order marks that are not UTF-8's; that of UTF-16 in little-endian order begins that of UTF-32.
_MARKS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)

#: Errors of a beginning that what follows may mend.
_OF_THE_END = ("missing", "ragged", "empty")

Answer = TypeVar("Answer")
Body = TypeVar("Body", bound=pydantic.BaseModel)

#: Errors whose rule is about a field's name, not its value.
_WITHOUT_VALUE = ("union_tag_not_found", "extra_forbidden")
_KINDS = ("stationary_stribeck", "dynamic_stribeck", "duty_cycles", "run_in", "maintenance")


def read_run(body: bytes) -> IncomingRun:
    """The run in a JSON body; raises InvalidError naming every wrong place."""
    return _parsed(body, _run)


def _run(sent: Any) -> IncomingRun:
    """The run in a parsed body. Raises InvalidError."""
    run = _validated(RUN_IN.validate_json, sent)
    channels = getattr(run, "channels", None)
    channel_values = () if channels is None else channels.model_dump(exclude_none=True)
    columns = {name: sent["channels"][name] for name in channel_values}
    details: dict[str, Any] = {}
    if isinstance(run, DutyRunIn):
        # a field that was added later must not change the hash of a run that was sent without it
        absent = {"engagement_duration_s"} if run.duty.engagement_duration_s is None else None
        details["duty"] = run.duty.model_dump(exclude=absent)
    if isinstance(run, MaintenanceRunIn):
        details |= {"event": run.event, "note": run.note}
        if run.event == END_OF_LIFE:
            details["reason"] = run.reason or WORN
    sent = IncomingRun(
        kind=run.kind,
        cycles=run.cycles,
        run_id=run.run_id or "",
        started_at=None if run.started_at is None else run.started_at.isoformat(),
        origin=run.origin,
        channels=check_columns(columns) if columns else {},
        details=details,
    )
    return name_run(sent)


def read_run_on_disk(path: Path) -> IncomingRun:
    """The run in a JSON body that was kept on disk while it waited."""
    return read_run(path.read_bytes())


def checked(schema: type[Body], body: bytes) -> Body:
    """Any other JSON body, checked by its schema; raises InvalidError naming every wrong place."""
    return _parsed(body, partial(_validated, schema.model_validate_json, items=MAX_MARKS))


def _parsed(body: bytes, read: Callable[[Any], Answer]) -> Answer:
    """The result of `read` for the body's parsed value; needs memory of about ten times the body's size. Raises
    InvalidError."""
    body = _in_utf8(body)
    if sum(map(body.count, (b'"', b"[", b"{"))) > MAX_MARKS:
        raise _too_many_marks(body, read)
    try:
        sent = pydantic_core.from_json(body)
    except ValueError as error:
        _require_utf8(body)
        message = f"the body must be valid JSON: {error}"
        raise InvalidError.of(message, code="json_invalid") from None
    answer = read(sent)
    if _NUL.search(body):  # PostgreSQL reads no JSON that holds it: stored once, it would fail all that is asked later
        raise InvalidError.of("the body must not hold the character U+0000", code="null_character")
    return answer


def _too_many_marks(body: bytes, read: Callable[[Any], object]) -> InvalidError:
    """The error for a body with more names, texts and lists than any valid one: the errors of its beginning.

    Such a body is not parsed as a whole: each value takes some fifty bytes of memory, even if it takes two in the body.
    """
    try:
        end = next(islice(re.finditer(rb'["\[{]', body), MAX_MARKS, None)).start()
        head = pydantic_core.from_json(body[:end], allow_partial=True)
        for look in (_check_channels, read):
            try:
                look(head)
            except InvalidError as error:
                errors = [field for field in error.errors if field.code not in _OF_THE_END]
                total = error.total - len(error.errors) + len(errors)
                if errors:
                    return InvalidError(f"{errors[0].message}; {total} errors or more", errors=errors, total=total)
    except ValueError:
        pass  # nested too deeply, or no JSON from its beginning on
    message = f"the body must not hold more than {MAX_MARKS} quotation marks and brackets: send a long record as a file"
    return InvalidError.of(message, code="too_many_marks")


def _check_channels(sent: Any) -> None:
    """Raise InvalidError if a channel's values are not numbers."""
    channels = sent.get("channels") if isinstance(sent, dict) else None
    for name, values in channels.items() if isinstance(channels, dict) else ():
        if name in CHANNELS and isinstance(values, list):
            check_columns({name: values})


def _in_utf8(body: bytes) -> bytes:
    """The body without the byte order mark of UTF-8. Raises InvalidError where it begins as JSON in another encoding does.

    JSON begins with two characters of ASCII: a zero among its first bytes is of UTF-16 or UTF-32 (RFC 4627, section 3).
    """
    for mark, name in _MARKS:
        if body.startswith(mark):
            raise _encoding_error(f"the body begins with the byte order mark of {name}")
    body = body.removeprefix(codecs.BOM_UTF8)
    if (zero := body[:4].find(0)) >= 0:
        raise _encoding_error(f"byte {zero + 1} is zero, as in UTF-{32 if body[:4].count(0) == 3 else 16}")
    return body


def _require_utf8(body: bytes) -> None:
    """Raise InvalidError if the body is not valid UTF-8."""
    try:
        body.decode()
    except UnicodeDecodeError as error:
        wrong = body[error.start : error.start + 1]
        shown = f"0x{wrong.hex()}, which is {wrong.decode('latin-1')!r} in Latin-1"
        raise _encoding_error(f"byte {error.start + 1} is {shown}") from None


def _encoding_error(why: str) -> InvalidError:
    message = f"the body must be JSON in UTF-8: {why}"
    return InvalidError.of(message, code="encoding")


def _validated(validate: Callable[[bytes], Answer], sent: object, items: int = _MAX_SHOWN) -> Answer:
    """The sent value checked by its schema, with texts cut, and objects and lists cut after `items` entries; a run's
    channels are read by `check_columns` instead.

    pydantic copies each wrong value with all its content once per error.
    """
    try:
        return validate(pydantic_core.to_json(_cut(sent, items), inf_nan_mode="constants"))
    except pydantic.ValidationError as error:
        raise _invalid(error) from None


def _cut(value: Any, items: int) -> Any:
    """A parsed value with long texts, lists and objects shortened."""
    if isinstance(value, dict):
        return {name[:items]: _cut(item, items) for name, item in value.items()}
    if isinstance(value, list):
        return [item if type(item) is float else _cut(item, items) for item in value[:items]]
    return value[: LONGEST_NOTE + 1] if isinstance(value, str) else value


def _invalid(error: pydantic.ValidationError) -> InvalidError:
    """pydantic's errors as the service's InvalidError, with pointer, row, value and rule."""
    details = error.errors(include_url=False, include_context=False)
    errors = [_field_error(item["loc"], item["type"], item["msg"], item["input"]) for item in details[:MAX_ERRORS]]
    more = f"; {len(details)} errors in all" if len(details) > 1 else ""
    return InvalidError(errors[0].message + more, errors=errors, total=len(details))


def _field_error(loc: tuple[int | str, ...], code: str, rule: str, value: object) -> FieldError:
    """One of pydantic's errors as the service's FieldError. pydantic puts the run's kind before the place, and it is no
    part of the body's path; rows count from 1."""
    place = loc[1:] if loc and loc[0] in _KINDS else loc
    if code.startswith("union_tag"):
        place = (*place, "kind")
        value = value.get("kind", "") if isinstance(value, dict) else value
    pointer = "".join(f"/{str(part).replace('~', '~0').replace('/', '~1')}" for part in place)
    name = ".".join(str(part) for part in place) or "the body"
    shown = "" if code == "missing" else repr(value)[:MAX_QUOTED]
    rule = rule_in_words(code, rule)
    states_value = shown and "got" not in rule and code not in _WITHOUT_VALUE
    message = f"{name}: {rule}" + (f", got {shown}" if states_value else "")
    row = place[-1] + 1 if place and isinstance(place[-1], int) else None
    return FieldError(pointer=pointer, code=code, message=message, row=row, value=shown)
