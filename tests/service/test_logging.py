"""The log: a line a record, which nobody who is logged can forge."""

import errno
import fcntl
import json
import logging
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

import pytest

from service.logging import JsonLines, LogFormat, Queued, TextLines, configure, request_id

FORGED = 'x\n2026-01-01T00:00:00.000Z INFO clutchlife: key revoked\r\n{"level": "info"}\x85\u2028\x1b[2Jy'


def record(message: str, *arguments: object, error: BaseException | None = None, **fields: Any) -> logging.LogRecord:
    info = None if error is None else (type(error), error, error.__traceback__)
    made = logging.LogRecord("clutchlife", logging.WARNING, "", 0, message, arguments, info)
    made.fields = fields
    return made


def raised() -> ValueError:
    """An error with a traceback."""
    with pytest.raises(ValueError, match="key revoked") as caught:
        raise ValueError(FORGED)
    return caught.value


@pytest.fixture
def stream(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[TextIO]:
    """Where to log; afterwards logs go where they went before."""
    root = logging.getLogger()
    monkeypatch.setattr(root, "handlers", list(root.handlers))
    with (tmp_path / "log").open("w", encoding="utf-8") as stream:
        yield stream


def written(stream: TextIO) -> str:
    """What was logged."""
    logging.getLogger().handlers[0].flush()
    return Path(stream.name).read_text("utf-8")


def test_a_record_is_one_line_of_json_its_traceback_too() -> None:
    line = JsonLines().format(record("%s: %s", "a", FORGED, error=raised(), key=FORGED))
    assert len(line.splitlines()) == 1
    assert line.isascii()
    read = json.loads(line)
    assert read["exception"].startswith("Traceback")
    expected = {"level": "warning", "logger": "clutchlife", "message": f"a: {FORGED}", "key": FORGED}
    assert expected.items() <= read.items()
    assert read["time"].endswith("Z")
    assert "request_id" not in read


def test_no_line_of_text_begins_with_what_is_logged() -> None:
    text = TextLines().format(record("%s", FORGED, error=raised(), key=FORGED, note="a=b c"))
    first, *others = text.splitlines()
    assert " WARNING clutchlife: x " in first
    assert 'note="a=b c"' in first
    assert others
    assert all(line.startswith("    | ") for line in others)
    assert all(line.isprintable() for line in (first, *others)), "no sign moves a terminal's cursor"


@pytest.mark.parametrize("lines", [JsonLines(), TextLines()])
def test_a_line_names_the_request_that_it_belongs_to(lines: logging.Formatter) -> None:
    before = request_id.set("rig-7")
    try:
        assert "rig-7" in lines.format(record("x"))
    finally:
        request_id.reset(before)
    assert "rig-7" not in lines.format(record("x"))


def test_ours_are_heard_from_the_level_on_and_others_from_warning_on(stream: TextIO) -> None:
    configure("json", "info", stream)
    for name in ("clutchlife", "clutchlife.access", "uvicorn.error", "alembic.runtime"):
        for level in (logging.DEBUG, logging.INFO, logging.WARNING):
            logging.getLogger(name).log(level, "x")
    heard = [(line["logger"], line["level"]) for line in map(json.loads, written(stream).splitlines())]
    ours = ("clutchlife", "clutchlife.access", "uvicorn.error")
    assert heard == [*[(name, level) for name in ours for level in ("info", "warning")], ("alembic.runtime", "warning")]


@pytest.mark.parametrize(
    ("form", "on_a_terminal", "is_json"),
    [("auto", False, True), ("auto", True, False), ("text", False, False), ("json", True, True)],
)
def test_auto_is_text_on_a_terminal_and_json_elsewhere(
    form: LogFormat, on_a_terminal: bool, is_json: bool, stream: TextIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream, "isatty", lambda: on_a_terminal)
    configure(form, "info", stream)
    logging.getLogger("clutchlife").info("x")
    assert written(stream).startswith("{") is is_json


def test_lines_that_nobody_takes_are_counted_in_their_place() -> None:
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)
    with os.fdopen(reading, "rb") as taken, os.fdopen(writing, "w") as stream:
        handler = Queued(stream, logging.Formatter("%(message)s"), most=20_000)
        for number in range(3000):
            handler.handle(record("line %d", number))
        lines = [taken.readline() for _ in range(1000)]
        handler.handle(record("one more"))
        while lines[-1] != b"one more\n":
            lines.append(taken.readline())
        handler.flush()
    *kept, notice, last = [line.decode().strip() for line in lines]
    assert kept == [f"line {number}" for number in range(len(kept))]
    assert 1500 < len(kept) < 3000
    assert notice == f"{3000 - len(kept)} lines of the log were dropped here: nobody took them"
    assert last == "one more"


def test_what_could_not_be_written_is_tried_again(stream: TextIO, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that was full, or a pipe that does not wait: no line is torn, and none is lost."""
    configure("text", "info", stream)
    failures = [OSError(errno.ENOSPC, "full"), BlockingIOError(errno.EAGAIN, "wait")]
    write = os.write

    def partly(number: int, line: Any) -> int:
        if failures and len(line) < 20:
            raise failures.pop()
        return write(number, line[: max(1, len(line) // 2)])

    monkeypatch.setattr(os, "write", partly)
    for number in range(3):
        logging.getLogger("clutchlife").info("line %d", number)
    lines = written(stream).splitlines()
    assert not failures
    assert [line.split(": ")[1] for line in lines] == ["line 0", "line 1", "line 2"]
