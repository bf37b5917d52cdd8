"""TDMS, MDF4 and Parquet: the same columns as were written; wrong files end in errors, in a process of their own."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter  # type: ignore[import-untyped]

from models.arrays import FloatArray
from service.errors import InvalidError, TooLargeError
from service.readers.limits import LIMITS
from service.readers.read_file import read_file, reading_of
from tests.service.readers.sample_files import UNITS, read_content, record, write_mdf, write_parquet, write_tdms
from tests.support import one_quick

Writer = Callable[..., Path]
FORMATS: list[tuple[Writer, str]] = [(write_tdms, "a.tdms"), (write_mdf, "a.mf4"), (write_parquet, "a.parquet")]
GERMAN = {"M": "kNm", "n": "rad/s", "p": "MPa", "Öltemperatur": "K"}


def german(columns: dict[str, FloatArray]) -> dict[str, FloatArray]:
    time, pressure, speed, torque, oil = columns.values()
    measured = (time, torque / 1e3, speed * 2 * np.pi / 60, pressure / 10, oil + 273.15)
    return dict(zip(("time_s", *GERMAN), measured, strict=True))


def read(path: Path, mapping: str | None = None) -> dict[str, FloatArray]:
    return read_file(path, filename=path.name, reading=reading_of(mapping)).columns


@pytest.mark.parametrize(("write", "name"), FORMATS)
def test_columns_come_back_bit_for_bit(tmp_path: Path, write: Writer, name: str) -> None:
    columns = record()
    got = read(write(tmp_path / name, columns, units=UNITS))
    assert got.keys() == columns.keys()
    for channel, column in columns.items():
        assert got[channel].tobytes() == column.tobytes()


@pytest.mark.parametrize(("write", "name"), one_quick(FORMATS))
def test_units_are_converted_names_understood_unknown_channels_listed_and_too_many_values_refused(
    tmp_path: Path, write: Writer, name: str
) -> None:
    columns = record(200)
    got = read(write(tmp_path / name, german(columns), units=GERMAN))
    assert got.keys() == columns.keys()
    for channel, column in columns.items():
        np.testing.assert_allclose(got[channel], column, rtol=1e-13)
    columns["Mz"] = columns.pop("torque_nm")
    path = write(tmp_path / name, columns, units={})
    (notice,) = read_file(path, filename=name).notices
    assert (notice.code, "Mz" in notice.message) == ("columns_left_out", True)
    assert read(path, "torque_nm:Mz")["torque_nm"].tobytes() == columns["Mz"].tobytes()
    with pytest.raises(TooLargeError, match="must not hold more than 100 values"):
        read_file(path, filename=name, limits=replace(LIMITS, most_values=100))


def test_a_waveform_has_its_time_from_its_clock(tmp_path: Path) -> None:
    columns = {name: column for name, column in record(100).items() if name != "time_s"}
    got = read(write_tdms(tmp_path / "a.tdms", columns, properties={"wf_increment": 1e-3, "wf_start_offset": 2.0}))
    np.testing.assert_allclose(got["time_s"], 2 + np.arange(100) * 1e-3, rtol=1e-15)


def test_waveforms_are_timed_from_the_earliest_start_of_all(tmp_path: Path) -> None:
    starts = {"speed_rpm": 20, "pressure_bar": 0, "torque_nm": 50}
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        channels = []
        for name, milliseconds in starts.items():
            start = np.datetime64("2026-11-02T08:00:00") + np.timedelta64(milliseconds, "ms")
            properties = {"unit_string": UNITS[name], "wf_increment": 0.01, "wf_start_time": start}
            channels.append(ChannelObject("Rig", name, np.arange(1.0, 101.0), properties=properties))
        writer.write_segment(channels)
    got = read(tmp_path / "a.tdms")
    np.testing.assert_allclose(got["time_s"], 0.05 + 0.01 * np.arange(94), rtol=1e-12)
    assert [got[name][0] for name in starts] == pytest.approx([4.0, 6.0, 1.0])


def test_two_lengths_without_times_are_refused_by_name(tmp_path: Path) -> None:
    columns = record(100)
    slow = {"oil_temperature_c": columns.pop("oil_temperature_c")[:10]}
    lengths = r"the same number of rows, got: (?=.*torque_nm has 100)(?=.*oil_temperature_c has 10)"
    with pytest.raises(InvalidError, match=lengths):
        read(write_tdms(tmp_path / "a.tdms", {"torque_nm": columns["torque_nm"]}, units=UNITS, more=slow))


@pytest.mark.parametrize(("write", "name"), one_quick([(write_tdms, "a.tdms"), (write_mdf, "a.mf4")]))
def test_two_channels_of_one_name_are_refused(tmp_path: Path, write: Writer, name: str) -> None:
    columns = record(100)
    path = write(tmp_path / name, columns, units=UNITS, more={"torque_nm": columns["torque_nm"]})
    with pytest.raises(InvalidError, match="torque_nm must be one column"):
        read(path)


@pytest.mark.slow
def test_mdf_3_is_refused_and_packed_mdf_4_is_read(tmp_path: Path) -> None:
    columns = record()
    packed = write_mdf(tmp_path / "b.mf4", columns, units=UNITS, compression=2)
    assert read(packed)["torque_nm"].tobytes() == columns["torque_nm"].tobytes()
    old = write_mdf(tmp_path / "a.mdf", columns, units=UNITS, version="3.30")
    with pytest.raises(InvalidError, match=r"version 4, got '3\.30'"):
        read(old)


def test_a_time_stamp_is_seconds_since_the_first(tmp_path: Path) -> None:
    stamps = [datetime(2026, 11, 2) + timedelta(milliseconds=100 * index) for index in range(5)]
    columns = {"time": np.array(stamps, dtype="datetime64[us]"), "torque_nm": np.arange(5.0)}
    for path in (write_tdms(tmp_path / "a.tdms", columns), write_parquet(tmp_path / "a.parquet", columns)):
        np.testing.assert_allclose(read(path)["time_s"], 0.1 * np.arange(5), rtol=0, atol=1e-12)


def test_words_in_parquet_are_refused(tmp_path: Path) -> None:
    path = write_parquet(tmp_path / "a.parquet", {"time_s": [0.0, 1.0], "torque_nm": ["a", "b"]})
    with pytest.raises(InvalidError, match=r"torque_nm\[0\] must be a number, got 'a'"):
        read(path)


def test_a_renamed_picture_is_refused(tmp_path: Path) -> None:
    for content, message in ((b"\x89PNG\r\n\x1a\n", "PNG picture"), (b"RIFX", "is not a TDMS file, although its name")):
        with pytest.raises(InvalidError, match=message):
            read_content(tmp_path, content + bytes(100), name="a.tdms")


# --- MDF4: what the file says is read, what it would have computed is refused.

#: Writes files of 20 rows and three channels into a folder, a channel (`time`: the clock) with a conversion.
_WRITE = """
import sys, numpy
from asammdf import MDF, Signal
from asammdf.blocks.v4_blocks import ChannelConversion
formula = ChannelConversion(conversion_type=3, formula="X1*X1+20")
ranges = ChannelConversion(
    conversion_type=8, lower_0=500, upper_0=501, text_0=b"never", links_nr=6, val_param_nr=2, ref_param_nr=2,
    default_addr=formula,
)
linear = ChannelConversion(conversion_type=1, a=2.0, b=1.0)
rational = ChannelConversion(conversion_type=2, P1=0, P2=1, P3=0, P4=0, P5=0, P6=2)
FILES = {
    "formula": ("torque_nm", formula), "clock": ("time", formula), "ranges": ("torque_nm", ranges),
    "linear": ("torque_nm", linear), "rational": ("torque_nm", rational), "aside": ("temperature", formula),
}
for name, (where, conversion) in FILES.items():
    time = numpy.arange(20) / 100
    units = {"pressure_bar": "bar", "speed_rpm": "rpm", "torque_nm": "Nm", "temperature": ""}
    file = MDF(version="4.10")
    file.append([
        Signal(numpy.arange(20), time, name=each, unit=unit, conversion=conversion if each == where else None)
        for each, unit in units.items()
    ])
    if where == "time":
        group = file.groups[0]
        group.channels[file.masters_db[0]].conversion = conversion
    file.save(f"{sys.argv[1]}/{name}.mf4", overwrite=True)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files. asammdf warns as it is imported, so it writes in its own process."""
    folder = tmp_path_factory.mktemp("mdf4")
    subprocess.run([sys.executable, "-W", "ignore", "-c", _WRITE, str(folder)], check=True, capture_output=True)
    return folder


@pytest.mark.parametrize(
    ("name", "where"), one_quick([("formula", "torque_nm"), ("clock", "time"), ("ranges", "torque_nm")])
)
def test_a_formula_in_a_file_is_refused_and_named(folder: Path, name: str, where: str) -> None:
    with pytest.raises(InvalidError, match="needs a formula") as caught:
        read(folder / f"{name}.mf4", "torque_nm:torque_nm")
    assert where in caught.value.detail
    assert caught.value.errors[0].code == "algebraic_conversion"


@pytest.mark.parametrize(
    ("name", "expected"),
    one_quick([("linear", 2.0 * np.arange(20) + 1.0), ("rational", np.arange(20) / 2.0), ("aside", np.arange(20.0))]),
)
def test_conversions_without_a_formula_are_applied(folder: Path, name: str, expected: np.ndarray) -> None:
    assert read(folder / f"{name}.mf4", "torque_nm:torque_nm")["torque_nm"].tolist() == expected.tolist()
