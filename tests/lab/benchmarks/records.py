"""A raw record of 1,400 s at 1 kHz and five channels, from a file to the fitted receipt, through the service."""

import statistics
import tempfile
import time
from functools import partial
from pathlib import Path

import httpx2
import numpy as np

from tests.lab.benchmarks.memory import added, family_seconds
from tests.lab.measuring import show
from tests.models.records.raw_records import RPM, make, protocol
from tests.service.readers.sample_files import UNITS, write_mdf, write_parquet, write_tdms
from tests.support import served

SEED = 20131113
_DIGITS = {"time_s": 3, "pressure_bar": 4, "speed_rpm": 2, "torque_nm": 4, "oil_temperature_c": 3}
_TIMES = 3


def write_records(folder: Path) -> dict[str, Path]:
    """The same record, rounded as recorders round, in every format that is read."""
    record = make(*protocol(), np.random.default_rng(SEED), tau=0.1).record
    columns = {
        "time_s": record.time,
        "pressure_bar": record.pressure / 1e5,
        "speed_rpm": record.speed / RPM,
        "torque_nm": record.torque,
        "oil_temperature_c": record.oil_temperature - 273.15,
    }
    columns = {name: np.round(column, _DIGITS[name]) for name, column in columns.items()}
    table = folder / "record.csv"
    number = [f"%.{_DIGITS[name]}f" for name in columns]
    np.savetxt(
        table, np.column_stack(list(columns.values())), fmt=number, delimiter=",", header=",".join(columns), comments=""
    )
    german = folder / "german.csv"
    german.write_bytes(
        b"Datum;" + table.read_bytes().translate(bytes.maketrans(b",.", b";,")).replace(b"\n", b"\n2;")[:-2]
    )
    return {
        "CSV": table,
        "CSV, decimal commas and a column of words": german,
        "TDMS": write_tdms(folder / "record.tdms", columns, units=UNITS),
        "Parquet": write_parquet(folder / "record.parquet", columns, units=UNITS),
        "MDF4": write_mdf(folder / "record.mf4", columns, units=UNITS),
    }


def records() -> None:
    """Time from the file to the receipt, the best and the median of three; the service's own time of the processor, its
    children's included, which others at work do not lengthen as much; and what a fresh service grew by before them."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, path in write_records(Path(folder)).items():
            with served() as (server, client):
                client.post("/v1/clutches", json={"clutch_id": "bench"})
                grown = added(server.pid, partial(_posted, client, path, 0))
                taken, worked = [], []
                for number in range(1, _TIMES + 1):
                    before = family_seconds(server.pid)
                    taken.append(_posted(client, path, number))
                    worked.append(family_seconds(server.pid) - before)
            rows.append(
                {
                    "file": name,
                    "MB": f"{path.stat().st_size / 1e6:.0f}",
                    "best, s": f"{min(taken):.2f}",
                    "median, s": f"{statistics.median(taken):.2f}",
                    "of the processor, least, s": f"{min(worked):.2f}",
                    "added memory at most, MB": f"{grown / 2**20:.0f}",
                }
            )
    show("## A record of 1,400 s at 1 kHz, five channels: from the file to the fitted receipt, over a socket", rows)


def _posted(client: httpx2.Client, path: Path, cycles: int) -> float:
    """Seconds from the first byte sent to the receipt. A run of other cycles is another run."""
    asked = {"kind": "stationary_stribeck", "cycles": str(cycles), "filename": path.name}
    if path.name == "german.csv":
        asked["map"] = ",".join(f"{name}:{name}" for name in _DIGITS)
    content = path.read_bytes()
    begun = time.perf_counter()
    answer = client.post("/v1/clutches/bench/runs/file", params=asked, content=content)
    taken = time.perf_counter() - begun
    assert answer.status_code == 201, answer.text
    assert len(answer.json()["fits"]) == 7
    return taken
