"""A file of the new format is detected, read in its process, converted and checked."""

import tempfile
from pathlib import Path

import numpy as np
import pytest

from service.errors import InvalidError
from service.readers.read_file import read_file

columns = {"pressure [kPa]": [400.0, 400.0], "speed [rpm]": [100.0, 200.0], "torque [Nm]": [20.0, 19.5]}
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "run.toy"
    rows = np.array(list(columns.values()), dtype="<f8").T
    path.write_bytes(f"TOY1 {','.join(columns)}\n".encode() + rows.tobytes())
    read = read_file(path, filename="run.toy").columns
    assert {name: column.tolist() for name, column in read.items()} == {
        "pressure_bar": [4.0, 4.0],
        "speed_rpm": [100.0, 200.0],
        "torque_nm": [20.0, 19.5],
    }, read
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(InvalidError, match="whole rows of 24 bytes"):
        read_file(path, filename="run.toy")
