"""MDF4 files: what the file says is read, what it would have computed is refused."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from service.errors import InvalidError
from service.readers.read_file import read_file, reading_of
from tests.support import one_quick

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
        read_file(folder / f"{name}.mf4", filename=f"{name}.mf4", reading=reading_of("torque_nm:torque_nm"))
    assert where in caught.value.detail
    assert caught.value.errors[0].code == "algebraic_conversion"


@pytest.mark.parametrize(
    ("name", "expected"),
    one_quick([("linear", 2.0 * np.arange(20) + 1.0), ("rational", np.arange(20) / 2.0), ("aside", np.arange(20.0))]),
)
def test_other_conversions_are_applied_and_other_channels_hinder_nothing(
    folder: Path, name: str, expected: np.ndarray
) -> None:
    assert (
        read_file(folder / f"{name}.mf4", filename=f"{name}.mf4", reading=reading_of("torque_nm:torque_nm"))
        .columns["torque_nm"]
        .tolist()
        == expected.tolist()
    )
