"""Files of every format with bytes changed: read to checked columns or refused; the reader neither ends nor hangs.

CI changes some; `make faults` changes files of each format for ten minutes, or for `MINUTES=`.
"""

import os
import tempfile
import time
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import xlsxwriter  # type: ignore[import-untyped]

from service.columns import check_arrays
from service.errors import InvalidError, ServiceError, TooLargeError
from service.readers.limits import LIMITS
from service.readers.read_file import read_file
from tests.service.readers.sample_files import UNITS, csv_text, record, write_mdf, write_parquet, write_tdms

#: Little files are read soon, by the time of a processor; what is wrong with a changed one shows as well in few rows. On a
#: machine with other work a reader waits: of an MDF4 file for 122 s, of which it used 1 s.
COLUMNS = record(rows=60)
SOON = replace(LIMITS, seconds=10, wall_seconds=1200)
#: Numbers that lengths, offsets and types are overwritten with.
EXTREMES = [value.to_bytes(8, "little") for value in (0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1)]


def write_csv(path: Path, columns: Mapping[str, np.ndarray], **_: object) -> Path:
    path.write_text(csv_text(columns), encoding="utf-8")
    return path


def write_workbook(path: Path, columns: Mapping[str, np.ndarray], **_: object) -> Path:
    book = xlsxwriter.Workbook(path)
    sheet = book.add_worksheet()
    for place, (name, values) in enumerate(columns.items()):
        sheet.write_column(0, place, [name, *values.tolist()])
    book.close()
    return path


def write_matlab(path: Path, columns: Mapping[str, np.ndarray], **_: object) -> Path:
    scipy.io.savemat(path, columns)
    return path


def write_hdf5(path: Path, columns: Mapping[str, np.ndarray], **_: object) -> Path:
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file.create_dataset(name, data=values)
    return path


def write_zip(path: Path, columns: Mapping[str, np.ndarray], **_: object) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("run.csv", csv_text(columns))
    return path


WRITERS: dict[str, Callable[..., Path]] = {
    "run.csv": write_csv,
    "run.xlsx": write_workbook,
    "run.mat": write_matlab,
    "run.h5": write_hdf5,
    "run.zip": write_zip,
    "run.tdms": write_tdms,
    "run.mf4": write_mdf,
    "run.parquet": write_parquet,
}


def with_a_bit_flipped(content: bytes, rng: np.random.Generator) -> bytes:
    """What a reader often still reads, with a value changed."""
    data = bytearray(content)
    data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
    return bytes(data)


def changed(content: bytes, rng: np.random.Generator) -> bytes:
    """A file with one to four changes: bits flipped, extreme numbers, blocks cut out, doubled or moved, the end cut off."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        if not data:
            break
        at = int(rng.integers(len(data)))
        length = int(rng.integers(1, 64))
        match int(rng.integers(7)):
            case 0:
                data[at] ^= 1 << int(rng.integers(8))
            case 1:
                width = int(rng.choice([1, 2, 4, 8]))
                data[at : at + width] = EXTREMES[int(rng.integers(len(EXTREMES)))][:width]
            case 2:
                data[at : at + length] = rng.bytes(length)
            case 3:
                del data[at : at + length]
            case 4:
                data[at:at] = data[at : at + length] * int(rng.integers(1, 50))
            case 5:
                other = int(rng.integers(len(data)))
                data[at : at + length] = data[other : other + length]
            case _:
                del data[max(at, 1) :]
    return bytes(data)


def cases(name: str, few: int, many: int) -> list[object]:
    return [
        pytest.param(name, few, id=f"{few} of {name}"),
        pytest.param(name, many, id=f"{many} of {name}", marks=pytest.mark.slow),
    ]


def refusal_of(path: Path, name: str) -> ServiceError | None:
    """Why a changed file is refused, if it is."""
    try:
        check_arrays(read_file(path, filename=name, limits=SOON).columns)
    except (InvalidError, TooLargeError) as error:
        return error
    return None


def is_of_the_reader(refusal: ServiceError) -> bool:
    """Whether a file was refused because the process that read it took too long or gave no answer.

    One that asks for more memory than it may have says so itself, which is its answer to a file that announces too much. A
    library's C code that crashes ends that process alone, and the file is refused as damaged: what the process is for
    (scipy 1.15 does so on one of the 200 damaged MATLAB files here).
    """
    return any(error.code == "too_slow" for error in refusal.errors) or "its reader" in refusal.detail


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "number"),
    # a reader of CSV is a function, the others are processes of which the one of MDF4 takes longest to start
    [
        *cases("run.csv", 400, 10_000),
        *cases("run.zip", 100, 5_000),
        *cases("run.tdms", 8, 200),
        *cases("run.xlsx", 8, 200),
        *cases("run.mat", 8, 200),
        *cases("run.h5", 8, 200),
        *cases("run.mf4", 6, 120),
        *cases("run.parquet", 8, 200),
    ],
)
def test_a_changed_file_is_read_or_refused(
    name: str, number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    content = WRITERS[name](tmp_path / name, COLUMNS, units=UNITS).read_bytes()
    rng = np.random.default_rng([number, *name.encode()])
    path = tmp_path / f"changed-{name}"
    refused, faults = 0, []
    for index in range(number):
        path.write_bytes(changed(content, rng) if index % 3 else with_a_bit_flipped(content, rng))
        if refusal := refusal_of(path, name):
            refused += 1
            if is_of_the_reader(refusal):
                faults.append(f"file {index}: {refusal.detail}")
    assert faults == []
    assert refused > 0
    # a sum of what it holds is in an archive: nothing that was changed is read
    assert name == "run.zip" or number - refused >= max(1, number // 20), (
        "hardly any is read: the changes show little of what follows"
    )
    assert list((tmp_path / "temporary").iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_files_that_are_changed_for_minutes_are_read_or_refused(name: str, tmp_path: Path) -> None:
    """No seed: what is found is kept in the message, as the seed of its file."""
    content = WRITERS[name](tmp_path / name, COLUMNS, units=UNITS).read_bytes()
    path = tmp_path / f"changed-{name}"
    first = time.time_ns()
    end = time.monotonic() + 60 * float(os.environ.get("CLUTCHLIFE_FUZZ_MINUTES", "0.2"))
    faults, number = [], 0
    while time.monotonic() < end and len(faults) < 10:
        rng = np.random.default_rng(first + number)
        path.write_bytes(changed(content, rng))
        refusal = refusal_of(path, name)
        if refusal and is_of_the_reader(refusal):
            faults.append(f"seed {first + number}: {refusal.detail}")
        number += 1
    print(f"{number} changed files of {name}")
    assert faults == []
    assert number > 0


@pytest.mark.slow
def test_what_is_not_changed_is_read(tmp_path: Path) -> None:
    for name, write in WRITERS.items():
        columns = read_file(write(tmp_path / name, COLUMNS, units=UNITS), filename=name).columns
        for channel, values in COLUMNS.items():
            np.testing.assert_allclose(columns[channel], values, rtol=0, atol=1e-5)
