"""Logs: one line a record, JSON for programs or text for a terminal, with the id of the request that it belongs to.

No line can be forged: what comes from outside (ids, addresses, the texts of errors) never begins one. In JSON a line break
is escaped; in text all but the first line of a record begin with a bar, and other control characters are escaped.
"""

import json
import logging
import re
import sys
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Any, Literal, TextIO

LogFormat = Literal["auto", "json", "text"]
LogLevel = Literal["critical", "error", "warning", "info", "debug"]

#: The id of the request that is worked on; empty where none is.
request_id: ContextVar[str] = ContextVar("request_id", default="")

#: Loggers that are heard from the chosen level on; all others from `warning` on.
_OWN = ("clutchlife", "uvicorn")
_SANE = re.compile(rb"[!-~]{1,128}")
_CONTINUED = "\n    | "
#: A line a request.
access = logging.getLogger("clutchlife.access")
#: What an operator must know of a start, whatever is chosen to be logged later: who may ask, what is misspelt.
start = logging.getLogger("clutchlife.start")


def sane(sent: bytes) -> str | None:
    """An id that a caller gave, where it is 1 to 128 visible characters of ASCII; else None."""
    return sent.decode("ascii") if _SANE.fullmatch(sent) else None


def configure(form: LogFormat, level: LogLevel, stream: TextIO | None = None) -> None:
    """Have all loggers of this process write so, the server's and Python's warnings too: to standard error, or `stream`.

    `auto` is text where that is a terminal, JSON elsewhere.
    """
    written = sys.stderr if stream is None else stream
    plain = form == "text" or (form == "auto" and written.isatty())
    handler = logging.StreamHandler(written)
    handler.setFormatter(TextLines() if plain else JsonLines())
    root = logging.getLogger()
    root.handlers[:] = [handler]
    lowest = logging.getLevelNamesMapping()[level.upper()]
    root.setLevel(max(lowest, logging.WARNING))
    for name in _OWN:
        logging.getLogger(name).setLevel(lowest)
    start.setLevel(min(lowest, logging.WARNING))
    logging.captureWarnings(True)


def log_request(level: int, method: str, route: str, status: int, seconds: float, size: int, key: str | None) -> None:
    """A line for a request that has been answered with `size` bytes: `key` is the name of its key, or who else asked."""
    fields = {
        "method": method,
        "route": route,
        "status": status,
        "duration_ms": round(1000 * seconds, 2),
        "bytes": size,
        "key": key,
    }
    access.log(level, "%s %s %s", method, route, status, extra={"fields": fields})


class JsonLines(logging.Formatter):
    """A record as one line of JSON: time, level, logger, process, message, and what is there of the rest."""

    def format(self, record: logging.LogRecord) -> str:
        line: dict[str, Any] = {
            "time": _time(record),
            "level": record.levelname.lower(),
            "logger": record.name,
            "process": record.process,
            "message": record.getMessage(),
        }
        if request_id.get():
            line["request_id"] = request_id.get()
        line |= getattr(record, "fields", {})
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


class TextLines(logging.Formatter):
    """Log lines for people: `time LEVEL logger: message name=value ...`, with the traceback below."""

    def format(self, record: logging.LogRecord) -> str:
        fields = dict(getattr(record, "fields", {}))
        if request_id.get():
            fields["request_id"] = request_id.get()
        shown = "".join(f" {name}={_value(value)}" for name, value in fields.items())
        first, *more = record.getMessage().splitlines() or [""]
        if record.exc_info:
            more += self.formatException(record.exc_info).splitlines()
        head = f"{_time(record)} {record.levelname} {record.name}: "
        return head + _CONTINUED.join(map(_printable, (first + shown, *more)))


def _time(record: logging.LogRecord) -> str:
    return datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _value(value: object) -> str:
    text = str(value)
    return text if text and not re.search(r'[\s"=]', text) else json.dumps(text, ensure_ascii=False)


def _printable(text: str) -> str:
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in text)
