"""The reading process: its limits on memory, time and output, and a reader that misbehaves ends alone."""

import os
import platform
import signal
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from service.errors import BusyError, InvalidError, TooLargeError
from service.readers import confinement, sandbox, zygote
from service.readers.detect import Format
from service.readers.limits import LIMITS, Limits
from service.readers.read_file import read_file
from tests.service.readers.sample_files import UNITS, read_content, record, write_tdms


def test_memory_is_limited(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "a.tdms", record(2_000_000), units=UNITS)
    with pytest.raises(TooLargeError, match="memory"):
        read_file(path, filename="a.tdms", limits=replace(LIMITS, memory_bytes=60 << 20))


#: A reader that answers by itself.
ANSWER = (
    "import json, os, sys; answer = {{'channels': {channels}, 'notices': [], 'counts': False, 'labels': {{}}}}; "
    "os.write(int(sys.argv[1]), json.dumps(answer).encode() + bytes([10])); os._exit(0)"
)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("import os; os.abort()", "SIGABRT"),
        ("while True: pass", "more than 1 s"),
        ("import os; os._exit(3)", r"broke off \(status 3\)"),
        ("raise RecursionError('deep')", "RecursionError: deep"),
        (ANSWER.format(channels="{'secret': 3}"), r"broke off \(no answer\)"),
        (ANSWER.format(channels="{'torque_nm': 9000000}"), r"broke off \(no answer\)"),
        ("import os, sys; os.write(int(sys.argv[1]), bytes(9000000)); os._exit(0)", r"broke off \(no answer\)"),
    ],
)
def test_a_bad_reader_ends_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, message: str) -> None:
    with pytest.raises(InvalidError, match=message):
        read_with(tmp_path, monkeypatch, body, replace(LIMITS, seconds=1, most_values=1_000_000))


def test_a_machine_with_too_much_to_do_is_not_the_files_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BusyError, match="was not read within 4 s, because the service is busy"):
        read_with(tmp_path, monkeypatch, "import time; time.sleep(60)", replace(LIMITS, wall_seconds=4))
    (tmp_path / "a.csv").write_text("t [s],M [Nm]\n0,1\n", encoding="utf-8")
    with pytest.raises(BusyError, match="the CSV file was not read within 0 s"):
        read_file(tmp_path / "a.csv", filename="a.csv", limits=replace(LIMITS, wall_seconds=0))


def test_a_reader_that_cannot_start_is_not_the_files_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dies = "pass\nimport os\nos._exit(4)"
    with pytest.raises(BusyError, match=r"reads TDMS files could not start \(status 4\).* tell the operator"):
        read_with(tmp_path, monkeypatch, dies)


#: Numbers of calls that Python has no function for, by architecture.
CALLS = {"x86_64": {"tgkill": 234, "tkill": 200, "shmget": 29}, "aarch64": {"tgkill": 131, "tkill": 130, "shmget": 194}}


def read_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, limits: Limits = LIMITS) -> None:
    """Read a file with a reader that does what `body` says."""
    (tmp_path / "nptdms.py").write_text("class TdmsFile: pass\n", encoding="utf-8")
    (tmp_path / "sitecustomize.py").write_text(
        "import ctypes, sys, types, threading, tempfile, socket, subprocess\n"
        "fake = types.ModuleType('service.readers.tdms')\n"
        "def call(name, *arguments):\n"
        f"    libc, numbers = ctypes.CDLL(None, use_errno=True), {CALLS.get(platform.machine(), {})}\n"
        "    if libc.syscall(numbers[name], *arguments) < 0:\n        raise OSError(ctypes.get_errno(), name)\n"
        f"def read_table(path, reading, limits):\n    {body}\n"
        "fake.read_table = read_table\nsys.modules['service.readers.tdms'] = fake\n",
        encoding="utf-8",
    )
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{Path(__file__).parents[3]}")
    path = tmp_path / "a.tdms"
    path.write_bytes(b"TDSm")
    read_file(path, filename="a.tdms", limits=limits)


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sandbox.READERS, Format.TDMS, ("service.readers.tdms", "no_such_package", "mdf"))
    with pytest.raises(BusyError, match=r"pip install -e '\.\[mdf\]'"):
        read_content(tmp_path, b"TDSm", name="a.tdms")


def test_reading_loads_no_foreign_package_here() -> None:
    assert "asammdf" not in sys.modules


#: Each tries to reach what it must not, and says how that ended by the error that its reader gives.
REACHES = {
    "another file": "open({secret!r})",
    "the folder of the file": "__import__('os').listdir({folder!r})",
    "a file to write": "open({folder!r} + '/new', 'w')",
    "the environment of the service": "open('/proc/{service}/environ')",
    "a socket": "__import__('socket').socket()",
    "a pair of sockets": "__import__('socket').socketpair()",
    "a program": "__import__('subprocess').run(['/bin/true'])",
    "a further process": "__import__('os').fork()",
    "the service itself": "__import__('os').kill({service}, 0)",
    "a thread of the service": "call('tgkill', {service}, {service}, 0)",
    "a thread of the service by itself": "call('tkill', {service}, 0)",
    "the limits of the service": "__import__('resource').prlimit({service}, 7)",
    "the priority of the service": "__import__('os').setpriority(0, {service}, 19)",
    "the processors of the service": "__import__('os').sched_setaffinity({service}, [0])",
    "who may read another file": "__import__('os').chmod({secret!r}, 0o644)",
    "who owns another file": "__import__('os').chown({secret!r}, 0, 0)",
    "when another file was changed": "__import__('os').utime({secret!r})",
    "what is noted of another file": "__import__('os').setxattr({secret!r}, 'user.a', b'x')",
    "memory that outlives it": "call('shmget', 0, 4096, 0o1600)",
}
#: What a reader may do: read the file, write into its own folder, use threads; and have only so many files open.
MAY = {
    "the file": "raise ValueError(open(path).read())",
    "a temporary file": "raise ValueError(__import__('tempfile').TemporaryFile().write(b'TDSm') and 'TDSm')",
    "its own limits": "raise ValueError('TDSm' if __import__('resource').getrlimit(7)[0] == 64 else 'others')",
    "its own processors": "__import__('os').sched_setaffinity(0, [0]); raise ValueError('TDSm')",
    "a thread": "t = __import__('threading').Thread(target=print); t.start(); t.join(); raise ValueError('TDSm')",
}


@pytest.mark.skipif(confinement.missing() != [], reason=f"this system leaves open {confinement.missing()}")
@pytest.mark.parametrize("reach", REACHES)
def test_a_reader_reaches_nothing_but_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reach: str) -> None:
    secret = tmp_path / "clutchlife.db"
    secret.write_text("what keys protect", encoding="utf-8")
    attempt = REACHES[reach].format(secret=str(secret), folder=str(tmp_path), service=os.getpid())
    with pytest.raises(InvalidError, match="PermissionError"):
        read_with(tmp_path, monkeypatch, f"{attempt}; raise ValueError('reached')")


@pytest.mark.parametrize("use", MAY)
def test_a_reader_may_do_what_reading_needs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, use: str) -> None:
    with pytest.raises(InvalidError, match="TDSm"):
        read_with(tmp_path, monkeypatch, MAY[use])


def test_a_reader_opens_only_so_many_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidError, match="Too many open files"):
        read_with(tmp_path, monkeypatch, "held = [open(path) for _ in range(1000)]; raise ValueError(len(held))")


def test_readers_stay_warm_and_one_that_ended_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first file has the library loaded; the next is read by a child of the same process, and of another where that
    ended."""
    monkeypatch.setenv("LANG", "C.UTF-8")  # a zygote of its own
    path = write_tdms(tmp_path / "a.tdms", record(50), units=UNITS)

    def read_by() -> int:
        assert read_file(path, filename="a.tdms").columns["torque_nm"].size == 50
        return zygote._idle[-1][1]._process.pid

    first = read_by()
    assert read_by() == first
    os.kill(first, signal.SIGKILL)
    zygote._idle[-1][1]._process.wait()
    assert read_by() != first
