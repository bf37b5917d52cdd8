"""A JSON body that holds more names, texts and lists than any that is right: what is wrong in it, found without parsing it.

A value in memory is some fifty bytes, whether the body spends two bytes on it or twenty. Instead such a body is gone
through, piece by piece, for what most likely made it so: fields that are not known, and numbers that are texts or lists.
"""

import re
from collections.abc import Mapping, Set

from service.errors import MOST_ERRORS, MOST_QUOTED, FieldError, InvalidError
from service.schemas.limits import MOST_MARKS

#: Fields that may be there, by the field that they stand in; "" is the body itself.
Fields = Mapping[str, Set[str]]

#: A text, a bracket, or what stands between them; no pattern here gives back what it has taken, so each is linear.
_PIECE = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+"|[\[\]{}]|[^"\[\]{}]++', re.DOTALL)
_COLON = re.compile(rb"\s*+:")
#: Texts in a row, and in a row fields whose values are no texts, lists or objects: half as many as quotation marks.
_TEXTS = re.compile(rb'(?:\s*+"[^"\\]*+"\s*+,)++')
_PLAIN_FIELDS = re.compile(rb'(?:\s*+"[^"\\]*+"\s*+:[^"\[\]{},]*+,)++')
_TEXT, _OPENING, _CLOSING = b'"', b"[{", b"]}"
#: Pieces that are looked at one by one. Chosen: some tenths of a second.
_MOST_PIECES = 100_000
#: The depth of a channel's values: in the body, in `channels`, in the channel's list.
_IN_CHANNEL = 3


def invalid_json(why: str) -> InvalidError:
    """The error of a body that is no JSON."""
    message = f"the body: Invalid JSON: {why}"
    return InvalidError(message, errors=[FieldError(pointer="", code="json_invalid", message=message)])


def too_many_marks(body: bytes, fields: Fields) -> InvalidError:
    """The error of a body with more than `MOST_MARKS` quotation marks and opening brackets, which may have these fields.

    It lists the first errors and says how many there are; where the body is too tangled to count all, how many at least.
    """
    search = _Search(body, fields)
    pieces = 0
    while pieces < _MOST_PIECES and search.take():
        pieces += 1
    if not search.total:
        message = f"the body must not hold more than {MOST_MARKS} quotation marks and opening brackets, got more"
        return InvalidError(message, errors=[FieldError(pointer="", code="too_many_marks", message=message)])
    rest = " in all" if pieces < _MOST_PIECES else " or more"
    more = f"; {search.total} errors{rest}" if search.total > 1 else ""
    return InvalidError(search.errors[0].message + more, errors=search.errors, total=search.total)


class _Search:
    """A place in the body, and what was wrong before it: the first MOST_ERRORS, and how many in all."""

    def __init__(self, body: bytes, fields: Fields) -> None:
        self.errors: list[FieldError] = []
        self.total = 0
        self._body = body
        self._fields = fields
        self._place = 0
        self._depth = 0
        #: The field of the body that the place is in, and the field in that.
        self._names = ["", ""]
        #: The row of the channel that the next value is.
        self._row = 0

    def take(self) -> bool:
        """Go on behind the next piece; False where there is none."""
        if self.total >= MOST_ERRORS:
            self._count()
        piece = _PIECE.match(self._body, self._place)
        if piece is None:
            return False
        start, self._place = piece.span()
        first = self._body[start : start + 1]
        if first in _CLOSING:
            self._depth -= 1
        elif first == _TEXT and _COLON.match(self._body, self._place):
            self._name(start + 1, self._place - 1)
        elif first == _TEXT or first in _OPENING:
            self._value(start, self._place)
            self._depth += first in _OPENING
        elif self._in_channel():
            self._row += self._body.count(b",", start, self._place)
        return True

    def _in_channel(self) -> bool:
        return (
            self._depth == _IN_CHANNEL
            and self._names[0] == "channels"
            and "channels" in self._fields
            and self._names[1] != ""
        )

    def _outer(self) -> str | None:
        """The field whose fields stand here, "" for the body's own, None deeper in it."""
        return {1: "", 2: self._names[0]}.get(self._depth)

    def _count(self) -> None:
        """Go on behind what is wrong in the same way many times in a row: it is counted, and not looked at."""
        outer = self._outer()
        allowed: Set[str] = frozenset()
        if outer is not None and outer in self._fields:
            repeated, allowed = _PLAIN_FIELDS, self._fields[outer]
        elif self._in_channel():
            repeated = _TEXTS
        else:
            return
        if run := repeated.match(self._body, self._place):
            start, self._place = run.span()
            right = sum(self._body.count(f'"{name}"'.encode(), start, self._place) for name in allowed)
            self.total += self._body.count(_TEXT, start, self._place) // 2 - right

    def _name(self, start: int, end: int) -> None:
        outer = self._outer()
        if outer is None:
            return
        name = self._shown(start, end)
        self._names[self._depth - 1 :] = [name] if outer else [name, ""]
        self._row = 0
        if outer in self._fields and name not in self._fields[outer]:
            path = [outer, name] if outer else [name]
            pointer = "".join(f"/{part.replace('~', '~0').replace('/', '~1')}" for part in path)
            message = f"{'.'.join(path)}: Extra inputs are not permitted"
            self._add(FieldError(pointer=pointer, code="extra_forbidden", message=message))

    def _value(self, start: int, end: int) -> None:
        if self._in_channel():
            channel, shown = self._names[1], self._shown(start, end)
            pointer = f"/channels/{channel}/{self._row}"
            message = f"{channel}[{self._row}] must be a number, got {shown}"
            row = self._row + 1
            self._add(FieldError(pointer=pointer, row=row, value=shown, code="not_a_number", message=message))

    def _shown(self, start: int, end: int) -> str:
        return self._body[start : min(end, start + MOST_QUOTED)].decode("utf-8", "replace")

    def _add(self, error: FieldError) -> None:
        self.total += 1
        if len(self.errors) < MOST_ERRORS:
            self.errors.append(error)
