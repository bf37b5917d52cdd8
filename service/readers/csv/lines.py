"""One line of CSV: its text, whether it is a comment, its cells, and the error that names it."""

import csv

from service.errors import MOST_QUOTED, FieldError, InvalidError

_COMMENTS = ("#", "%", "//")


def text_of(line: bytes) -> str:
    """A line as text: UTF-8, or else Latin-1, which has the signs of all units where Windows has them."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def is_comment(line: str, separator: str) -> bool:
    """Whether a line is a comment; a semicolon begins one where it does not separate."""
    bare = line.lstrip().lstrip('"')
    return bare.startswith(_COMMENTS) or (bare.startswith(";") and separator != ";")


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes, without blanks around them."""
    if '"' in line:
        even = line.replace("\r", " ")  # a carriage return within a line is a blank like others, not a second line
        return [cell.strip() for cell in next(csv.reader([even], delimiter=separator, skipinitialspace=True))]
    return [cell.strip() for cell in line.split(separator)]


def wrong_line(line: int, rule: str, code: str, got: str = "") -> InvalidError:
    """The error of a line that cannot be part of a table; `line` counts from 1."""
    shown = got[:MOST_QUOTED]
    message = f"line {line} {rule}" + (f", got {shown!r}" if got else "")
    return InvalidError(message, errors=[FieldError(pointer="", code=code, message=message, value=shown)])
