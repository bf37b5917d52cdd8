"""A clock that a file states for one channel, in every format: the channel is put onto the torque's, or the file is refused.

The torque begins half a second after the other channels, and all three follow one signal of time.
"""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd  # type: ignore[import-untyped]
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter  # type: ignore[import-untyped]

from service.errors import InvalidError
from service.readers.assemble import Channels
from service.readers.read_file import read_file, reading_of
from tests.service.readers.sample_files import read_content

ROWS, STEP, LATE = 300, 0.01, 0.5
TIME = np.round(STEP * np.arange(ROWS), 2)
LATER = np.round(TIME + LATE, 2)
PRESSURE, SPEED, TORQUE = np.full(ROWS, 5.0), 100 + 10 * TIME, 20 + LATER


def assert_together(read: Channels) -> None:
    """At each time each channel has the value of its signal; the torque's times are those of the record."""
    time = read.columns["time_s"]
    np.testing.assert_allclose(read.columns["speed_rpm"], 100 + 10 * (read.columns["torque_nm"] - 20), atol=1e-6)
    np.testing.assert_allclose(np.diff(time), STEP, atol=1e-6)
    assert time.size == ROWS - round(LATE / STEP)
    assert [notice.code for notice in read.notices] == ["brought_to_one_clock"]


def text(titles: list[str], columns: list[np.ndarray], above: str = "") -> str:
    lines = [";".join(titles), *(";".join(f"{value:.4f}" for value in row) for row in zip(*columns, strict=True))]
    return above + "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("common", "own"),
    [
        ("t [s]", "t_M [s]"), ("t [s]", "time_torque [s]"), ("Zeit [s]", "Zeit Drehmoment [s]"),
        ("t [s]", "torque time [s]"),
        ("Zeit [s]", "MomentZeit [s]"), ("t [s]", "t 2 [s]"), ("Time [s]", "Time M [s]"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("torque", ["M [Nm]", "Drehmoment [Nm]"])
def test_a_second_column_of_times_is_that_of_the_channel_that_it_names_or_stands_before(
    tmp_path: Path, common: str, own: str, torque: str
) -> None:
    columns = [TIME, PRESSURE, SPEED, LATER, TORQUE]
    assert_together(read_content(tmp_path, text([common, "p [bar]", "n [1/min]", own, torque], columns)))


def test_a_clock_that_names_its_channel_may_stand_anywhere(tmp_path: Path) -> None:
    titles = ["t_M [s]", "t [s]", "p [bar]", "n [1/min]", "M [Nm]"]
    assert_together(read_content(tmp_path, text(titles, [LATER, TIME, PRESSURE, SPEED, TORQUE])))


def test_a_map_of_the_channels_keeps_the_clock_that_the_file_states(tmp_path: Path) -> None:
    content = text(["t [s]", "p1 [bar]", "n1 [rpm]", "t_Mz [s]", "Mz [Nm]"], [TIME, PRESSURE, SPEED, LATER, TORQUE])
    mapped = "time_s:t,pressure_bar:p1,speed_rpm:n1,torque_nm:Mz"
    assert_together(read_content(tmp_path, content, mapped))
    alone = read_content(tmp_path, content, mapped, time="none")
    assert "time_s" not in alone.columns


@pytest.mark.parametrize("title", ["x_b [s]", "Kanal B [ms]"])
def test_a_clock_of_no_name_that_begins_at_another_time_is_asked_for(tmp_path: Path, title: str) -> None:
    own = LATER * (1000 if "ms" in title else 1)
    content = text(["t [s]", "p [bar]", "n [1/min]", title, "M [Nm]"], [TIME, PRESSURE, SPEED, own, TORQUE])
    with pytest.raises(InvalidError, match=r"0.5 s apart; choose one with time=NAME"):
        read_content(tmp_path, content)
    assert read_content(tmp_path, content, time="t [s]").columns["torque_nm"].size == ROWS


@pytest.mark.parametrize(
    "values", [TIME, TIME + 3600 * 1234, np.full(ROWS, 4.5), TIME[::-1]], ids=["same", "hours", "duration", "down"]
)
def test_a_column_in_a_unit_of_time_that_is_no_clock_is_left_out(tmp_path: Path, values: np.ndarray) -> None:
    content = text(["t [s]", "p [bar]", "n [1/min]", "Betrieb [s]", "M [Nm]"], [TIME, PRESSURE, SPEED, values, TORQUE])
    assert [notice.code for notice in read_content(tmp_path, content).notices] == ["columns_left_out"]


def test_a_clock_of_dates_and_one_of_numbers_are_not_mixed(tmp_path: Path) -> None:
    dates = pd.Timestamp("2026-11-02 07:00:00") + pd.to_timedelta(TIME, unit="s")
    frame = pd.DataFrame({"time": dates, "p [bar]": PRESSURE, "n [rpm]": SPEED, "t_M [s]": TIME, "M [Nm]": TORQUE})
    with pytest.raises(InvalidError, match="points in time and numbers"):
        read_content(tmp_path, frame.to_csv(index=False))


def test_starts_above_each_column_of_a_text_are_used(tmp_path: Path) -> None:
    above = (
        "Druck;Drehzahl;Drehmoment\nbar;1/min;Nm\n"
        "T0 = 02.11.2026 07:00:00.000;T0 = 02.11.2026 07:00:00.000;T0 = 02.11.2026 07:00:00.500\n"
        "dt = 10 ms;dt = 10 ms;dt = 10 ms\n"
    )
    content = above + text(["x"], [PRESSURE, SPEED, TORQUE]).partition("\n")[2]
    assert_together(read_content(tmp_path, content))


HELD = {"pressure": (PRESSURE, "bar"), "speed": (SPEED, "rpm"), "torque": (TORQUE, "Nm")}


def read(path: Path, **options: Any) -> Channels:
    return read_file(path, filename=path.name, reading=reading_of(None, **options))


@pytest.mark.parametrize(
    ("name", "early", "late"),
    [
        *((name, 0.0, LATE) for name in ("start_time", "starting_time", "t0", "start", "start_s", "time_offset", "delay",
                                         "trigger_delay", "offset_s", "t_start")),
        ("start_time", "2026-11-02T07:00:00", "2026-11-02T07:00:00.500"),
        ("start", "2026-11-02 07:00:00+01:00", "2026-11-02 06:00:00.5+00:00"),
        ("start_time", "07:00:00.000", "07:00:00.500"), ("delay", "0 ms", "500 ms"), ("t0", -0.25, 0.25),
    ],
)  # fmt: skip
def test_a_start_beside_a_data_set_is_used(tmp_path: Path, name: str, early: object, late: object) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for title, (values, unit) in HELD.items():
            held = file.create_dataset(title, data=values)
            held.attrs.update({"unit": unit, "dt": STEP, name: late if title == "torque" else early})
    assert_together(read(path))


@pytest.mark.parametrize("way", ["scales", "coordinates", "since", "names"])
def test_a_data_set_that_refers_to_its_times_has_these(tmp_path: Path, way: str) -> None:
    """As NetCDF 4 files do; the names say it where nothing refers."""
    path = tmp_path / "a.nc"
    with h5py.File(path, "w") as file:
        for title, (values, unit) in HELD.items():
            file.create_dataset(title, data=values).attrs["units"] = unit
        own = "time_torque" if way == "names" else "axis_b"
        for title, values in (
            ("axis_a" if own == "axis_b" else "time", TIME),
            (own, TIME if way == "since" else LATER),
        ):
            late = way == "since" and title == own
            moment = "2026-11-02 07:00:00.5" if late else "2026-11-02 07:00:00"
            times = file.create_dataset(title, data=values)
            times.attrs["units"] = f"seconds since {moment}" if way == "since" else "s"
            for channel in (["torque"] if title == own else ["pressure", "speed"]) if way != "names" else []:
                if way == "scales":
                    times.make_scale(title)
                    file[channel].dims[0].attach_scale(times)
                else:
                    file[channel].attrs["coordinates"] = title
    found = read(path)
    notices = tuple(notice for notice in found.notices if notice.code != "columns_left_out")
    assert_together(Channels(columns=found.columns, notices=notices))


def test_each_channel_s_own_vector_of_times_in_matlab_is_used(tmp_path: Path) -> None:
    columns = {"t": TIME, "p": PRESSURE, "n": SPEED, "t_M": LATER, "M": TORQUE}
    units = {"t": "s", "p": "bar", "n": "rpm", "t_M": "s", "M": "Nm"}
    scipy.io.savemat(tmp_path / "a.mat", columns | {f"{name}_unit": unit for name, unit in units.items()})
    assert_together(read(tmp_path / "a.mat"))


def test_each_struct_s_own_vector_of_times_in_matlab_is_used(tmp_path: Path) -> None:
    """As `timeseries` are saved by a struct of each."""
    held = {
        name: {"time": LATER if name == "torque" else TIME, "time_unit": "s", "data": values, "unit": unit}
        for name, (values, unit) in HELD.items()
    }
    scipy.io.savemat(tmp_path / "a.mat", held)
    assert_together(read(tmp_path / "a.mat"))


def test_a_start_among_the_properties_of_a_channel_of_tdms_is_used(tmp_path: Path) -> None:
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(
            [
                ChannelObject(
                    "Rig",
                    name,
                    values,
                    properties={"unit_string": unit, "dt": STEP, "start_time": LATE * (name == "torque")},
                )
                for name, (values, unit) in HELD.items()
            ]
        )
    assert_together(read(tmp_path / "a.tdms"))


def test_the_unit_beside_values_and_their_times_is_that_of_the_values(tmp_path: Path) -> None:
    """A struct of `time`, `data` and `unit`, as Simulink logs signals."""
    signals = {"torque": (TORQUE, "Nm"), "speed": (SPEED, "rpm"), "pressure": (PRESSURE, "bar")}
    held = {name: {"time_s": TIME, "data": values, "unit": unit} for name, (values, unit) in signals.items()}
    scipy.io.savemat(tmp_path / "a.mat", held)
    columns = read_file(tmp_path / "a.mat", filename="a.mat").columns
    np.testing.assert_allclose(columns["time_s"], TIME)
    np.testing.assert_allclose(columns["torque_nm"], TORQUE)
