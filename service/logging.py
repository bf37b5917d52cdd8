"""Logs: one line a record, JSON for programs or text for a terminal, with the id of the request that it belongs to.

A thread writes the lines: where nobody reads them, or the disk is full, only the log waits.

No line can be forged: what comes from outside (ids, addresses, the texts of errors) never begins one. In JSON a line break
is escaped; in text all but the first line of a record begin with a bar, and other control characters are escaped.
"""

import json
import logging
import os
import re
import sys
import threading
import time
from collections import deque
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
#: Bytes of lines that wait for who takes them, at most. Chosen: a minute of 200 requests a second, and little beside what a
#: process holds.
MAX_WAITING_BYTES = 4 << 20
#: [s] A process that ends waits so long for the next line to be taken. Chosen: `docker stop` waits 10 s for all of a stop.
FLUSH_SECONDS = 2.0
#: [s] After which a line that could not be written is tried again.
RETRY_SECONDS = 0.1
#: A line a request.
access = logging.getLogger("clutchlife.access")
#: What an operator must know of a start, whatever is chosen to be logged later: who may ask, what is misspelt.
start = logging.getLogger("clutchlife.start")


def sane(sent: bytes) -> str | None:
    """A request id given by a caller, if it has 1 to 128 visible ASCII characters; else None."""
    return sent.decode("ascii") if _SANE.fullmatch(sent) else None


def configure(form: LogFormat, level: LogLevel, stream: TextIO | None = None) -> None:
    """Configure all logging of this process, the server's and Python's warnings too, to standard error or `stream`.

    `auto`: text on a terminal, JSON elsewhere.
    """
    written = sys.stderr if stream is None else stream
    plain = form == "text" or (form == "auto" and written.isatty())
    root = logging.getLogger()
    root.handlers[:] = [Queued(written, TextLines() if plain else JsonLines())]
    lowest = logging.getLevelNamesMapping()[level.upper()]
    root.setLevel(max(lowest, logging.WARNING))
    for name in _OWN:
        logging.getLogger(name).setLevel(lowest)
    start.setLevel(min(lowest, logging.WARNING))
    logging.captureWarnings(True)


def log_request(level: int, method: str, route: str, status: int, seconds: float, size: int, key: str | None) -> None:
    """Log an answered request with its `size` in bytes; `key`: its key's name, or another description of the caller."""
    fields = {
        "method": method,
        "route": route,
        "status": status,
        "duration_ms": round(1000 * seconds, 2),
        "bytes": size,
        "key": key,
    }
    access.log(level, "%s %s %s", method, route, status, extra={"fields": fields})


class Queued(logging.Handler):
    """Has a thread write lines to a stream's file, in their order, so that nobody waits for whoever takes them.

    Lines beyond `most` bytes that wait are dropped. How many were is a line in their place.
    """

    def __init__(self, stream: TextIO, form: logging.Formatter, most: int = MAX_WAITING_BYTES) -> None:
        super().__init__()
        self.setFormatter(form)
        self._file, self._encoding, self._most = _file_of(stream), stream.encoding, most
        self._lines: deque[bytes | int] = deque()  # a number: so many were dropped here
        self._waiting = self._written = 0  # bytes
        self._changed = threading.Condition()
        threading.Thread(target=self._write_all, name="log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        """Queue a record's line."""
        line = self._encoded(record)
        with self._changed:
            if self._waiting + len(line) <= self._most:
                self._lines.append(line)
                self._waiting += len(line)
            elif self._lines and isinstance(self._lines[-1], int):
                self._lines[-1] += 1
            else:
                self._lines.append(1)
            self._changed.notify_all()

    def flush(self) -> None:
        """Wait until all is written, or for some seconds nothing was taken. `logging.shutdown` calls it."""
        with self._changed:
            while self._waiting:
                before = self._written
                if not self._changed.wait_for(lambda: self._written != before, FLUSH_SECONDS):  # noqa: B023
                    return

    def _encoded(self, record: logging.LogRecord) -> bytes:
        return (self.format(record) + "\n").encode(self._encoding, "backslashreplace")

    def _write_all(self) -> None:
        """The loop of the writing thread: writes lines as the reader takes them; a full disk is tried again."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._lines)
                line = self._lines.popleft()
                if isinstance(line, int):
                    line = self._encoded(_of_dropped(line))
                    self._waiting += len(line)
            rest = memoryview(line)
            while rest:
                try:
                    # past Python's own buffer, which would be locked while nobody takes the line, at the process's end too
                    taken = os.write(self._file, rest)
                except OSError:  # as where the disk is full
                    time.sleep(RETRY_SECONDS)
                    continue
                rest = rest[taken:]
                with self._changed:
                    self._waiting -= taken
                    self._written += taken
                    self._changed.notify_all()


def _file_of(stream: TextIO) -> int:
    """A stream's file; that of standard error where it has none, as one that a test has put in its place."""
    try:
        return stream.fileno()
    except OSError:
        return 2


def _of_dropped(number: int) -> logging.LogRecord:
    """The log record that says how many lines were dropped."""
    message = "%d lines of the log were dropped here: nobody took them"
    return logging.LogRecord("clutchlife", logging.WARNING, __file__, 0, message, (number,), None)


class JsonLines(logging.Formatter):
    """Formats a log record as one line of JSON: time, level, logger, process, message, and other fields it has."""

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
    """Formats a log record for people: `time LEVEL logger: message name=value ...`, with the traceback below."""

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
