"""Files of every format with bytes changed: read to checked columns or refused; the reader neither ends nor hangs.

`make slow` changes some; `make faults` changes files of each format for ten minutes, or for `MINUTES=`.
"""

import os
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pandas as pd  # type: ignore[import-untyped]
import pytest
import scipy.io

from service.channels import check_columns
from service.errors import InvalidError, ServiceError, TooLargeError
from service.readers.limits import LIMITS
from service.readers.read_file import read_file
from service.readers.table import Reading
from service.runs.suggestion import suggestion_of
from tests.service.readers.sample_files import UNITS, read_content, record, write_mdf, write_parquet, write_tdms

#: Little files are read soon, by the time of a processor; what is wrong with a changed one shows as well in few rows. On a
#: machine with other work a reader waits: of an MDF4 file for 122 s, of which it used 1 s.
COLUMNS = record(rows=60)
SOON = replace(LIMITS, seconds=10, wall_seconds=1200)
#: Numbers that lengths, offsets and types are overwritten with.
EXTREMES = [value.to_bytes(8, "little") for value in (0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1)]


NAMES = ["run.csv", "run.xlsx", "run.mat", "run.h5", "run.zip", "run.tdms", "run.mf4", "run.parquet"]


def written(folder: Path, name: str) -> bytes:
    """A file of that format."""
    path, frame = folder / name, pd.DataFrame(COLUMNS)
    match path.suffix:
        case ".csv":
            frame.to_csv(path, index=False)
        case ".zip":
            frame.to_csv(path, index=False, compression={"method": "zip", "archive_name": "run.csv"})
        case ".xlsx":
            frame.to_excel(path, index=False)
        case ".mat":
            scipy.io.savemat(path, COLUMNS)
        case ".h5":
            with h5py.File(path, "w") as file:
                file.update(COLUMNS)
        case ".tdms":
            write_tdms(path, COLUMNS, units=UNITS)
        case ".mf4":
            write_mdf(path, COLUMNS, units=UNITS)
        case ".parquet":
            write_parquet(path, COLUMNS, units=UNITS)
    return path.read_bytes()


def changed(content: bytes, rng: np.random.Generator, *, one_bit: bool) -> bytes:
    """A file with one to four changes: bits flipped, extreme numbers, blocks cut out, doubled or moved, the end cut off.

    `one_bit`: what a reader often still reads, with a value changed.
    """
    data = bytearray(content)
    for _ in range(1 if one_bit else int(rng.integers(1, 5))):
        if not data:
            break
        at = int(rng.integers(len(data)))
        length = int(rng.integers(1, 64))
        match 0 if one_bit else int(rng.integers(7)):
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


def refusal_of(path: Path, name: str) -> ServiceError | None:
    """Why a changed file is refused, if it is."""
    try:
        check_columns(read_file(path, filename=name, limits=SOON).columns)
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


#: Files of each format that are changed at least. The reader of CSV is a function, the others are processes, of which the
#: one of MDF4 takes longest to start.
NUMBERS = dict.fromkeys(NAMES, 200) | {"run.csv": 10_000, "run.zip": 5_000, "run.mf4": 120}


#: Of so many refused files one is asked for a suggestion, which reads it several times.
_SUGGESTED = 5


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_changed_file_is_read_or_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first files are the same in every run, those that follow while there is time are new; a fault names its seed."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    content = written(tmp_path, name)
    path = tmp_path / f"changed-{name}"
    end = time.monotonic() + 60 * float(os.environ.get("CLUTCHLIFE_FUZZ_MINUTES", "0.2"))
    tried, refused, faults = 0, 0, []
    while tried < NUMBERS[name] or (time.monotonic() < end and len(faults) < 10):
        seed = tried if tried < NUMBERS[name] else time.time_ns()
        rng = np.random.default_rng([seed, *name.encode()])
        path.write_bytes(changed(content, rng, one_bit=tried % 3 == 0))
        tried += 1
        if refusal := refusal_of(path, name):
            refused += 1
            if tried % _SUGGESTED == 0:  # what is refused is looked at once more, for a suggestion
                suggestion_of(path, filename=name, reading=Reading())
            if is_of_the_reader(refusal):
                faults.append(f"seed {seed}: {refusal.detail}")
    assert faults == []
    assert refused > 0
    # a sum of what it holds is in an archive: nothing that was changed is read
    read = tried - refused
    assert name == "run.zip" or read >= max(1, tried // 20), "the changes show little of what follows a first check"
    assert list((tmp_path / "temporary").iterdir()) == []


@pytest.mark.slow
def test_what_is_not_changed_is_read(tmp_path: Path) -> None:
    for name in NAMES:
        columns = read_content(tmp_path, written(tmp_path, name), name=name).columns
        for channel, values in COLUMNS.items():
            np.testing.assert_allclose(columns[channel], values, rtol=0, atol=1e-5)
