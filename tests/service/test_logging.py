"""The log: a line a record, which nobody who is logged can forge."""

import io
import json
import logging
from typing import Any

import pytest

from service.logging import JsonLines, LogFormat, LogLevel, TextLines, configure, request_id

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


def configured(form: LogFormat, level: LogLevel) -> io.StringIO:
    """What is written from now on."""
    written = io.StringIO()
    configure(form, level, written)
    return written


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


def test_ours_are_heard_from_the_level_on_and_others_from_warning_on() -> None:
    written = configured("json", "info")
    for name in ("clutchlife", "clutchlife.access", "uvicorn.error", "alembic.runtime"):
        for level in (logging.DEBUG, logging.INFO, logging.WARNING):
            logging.getLogger(name).log(level, "x")
    heard = [(line["logger"], line["level"]) for line in map(json.loads, written.getvalue().splitlines())]
    ours = ("clutchlife", "clutchlife.access", "uvicorn.error")
    assert heard == [*[(name, level) for name in ours for level in ("info", "warning")], ("alembic.runtime", "warning")]


@pytest.mark.parametrize(
    ("form", "on_a_terminal", "is_json"),
    [("auto", False, True), ("auto", True, False), ("text", False, False), ("json", True, True)],
)
def test_auto_is_text_on_a_terminal_and_json_elsewhere(
    form: LogFormat, on_a_terminal: bool, is_json: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stream := io.StringIO(), "isatty", lambda: on_a_terminal)
    configure(form, "info", stream)
    logging.getLogger("clutchlife").info("x")
    assert stream.getvalue().startswith("{") is is_json
