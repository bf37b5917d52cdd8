"""The reading process: its limits on memory, time and output, and a reader that misbehaves ends alone."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from service.errors import InvalidError, TooLargeError
from service.readers import sandbox
from service.readers.detect import Format
from service.readers.limits import LIMITS
from service.readers.read_file import read_file
from tests.service.readers.sample_files import UNITS, record, write_tdms


def test_memory_is_limited(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "a.tdms", record(2_000_000), units=UNITS)
    with pytest.raises(TooLargeError, match="memory"):
        read_file(path, filename="a.tdms", limits=replace(LIMITS, memory_bytes=130 << 20))


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("import os; os.abort()", "SIGABRT"),
        ("while True: pass", "longer than 1 s"),
        ("import sys; sys.exit(3)", "status 3"),
        ("raise RecursionError('deep')", "RecursionError: deep"),
        ("import time; time.sleep(60)", "longer than 1 s"),
        ("return {'secret': __import__('numpy').zeros(3)}", "gave no answer"),
        ("return {'torque_nm': __import__('numpy').zeros(9000000)}", "OSError|SIGXFSZ"),
    ],
)
def test_a_reader_that_misbehaves_ends_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, message: str
) -> None:
    (tmp_path / "nptdms.py").write_text("class TdmsFile: pass\n", encoding="utf-8")
    (tmp_path / "sitecustomize.py").write_text(
        f"import sys, types\nfake = types.ModuleType('service.readers.tdms')\n"
        f"def read(path, mapping, limits):\n    {body}\n"
        "fake.read = read\nsys.modules['service.readers.tdms'] = fake\n",
        encoding="utf-8",
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(sandbox, "_STARTING_SECONDS", 2)
    path = tmp_path / "a.tdms"
    path.write_bytes(b"TDSm")
    with pytest.raises(InvalidError, match=message):
        read_file(path, filename="a.tdms", limits=replace(LIMITS, seconds=1, most_values=1_000_000))


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sandbox.READERS, Format.TDMS, ("service.readers.tdms", "no_such_package", "tdms"))
    path = tmp_path / "a.tdms"
    path.write_bytes(b"TDSm")
    with pytest.raises(InvalidError, match=r"install clutchlife\[tdms\]"):
        read_file(path, filename="a.tdms")


def test_reading_loads_no_foreign_package_here() -> None:
    assert "asammdf" not in sys.modules
