"""What the rigs post: whole simulated lives, their bodies made before the clock starts."""

import gzip
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from models.rig import campaign
from models.rig.sampled import DynamicTest, RawTest, sampled_test
from models.rig.simulated_runs import RunKind, SimulatedRun
from models.rig.stationary import PLATEAU_DURATION, Sensor
from models.rig.truth import SimulatedClutch
from service.runs.record_writer import RecordFormat, write_record
from service.runs.simulated import simulated_body, simulated_channels, simulated_clutch_body, simulated_head
from tests.service.readers.sample_files import write_parquet

#: Stationary tests in a life. In the variant with sampled records every tenth has a dynamic test after it, and every fifth
#: is a recorder's file: about one post in ten, since a duty block stands before most tests.
TESTS = 40
DYNAMIC_EVERY = 10
RAW_EVERY = 5
#: Samples of a recorder's file; the protocol's 280 plateaus take 1,400 s.
SAMPLES = 200_000
_RAW = RawTest(rate=SAMPLES / (280 * PLATEAU_DURATION))
_RAW_CHANNELS = ("time_s", "pressure_bar", "speed_rpm", "torque_nm")
#: Maintenance by the number of the stationary test that it follows.
_MAINTENANCE = {13: ("oil_change", "new oil"), 26: ("rest", "three days")}
#: The arguments of a client's `request`.
Request = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Post:
    """One run as it is sent: its body, or the parameters and the place of a recorder's file."""

    run_id: str
    kind: str
    content: bytes = b""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    path: Path | None = None

    @property
    def raw(self) -> bool:
        """Whether it is a recorder's file."""
        return self.path is not None

    @property
    def sampled(self) -> bool:
        """Whether it is a sampled record, a recorder's file or a dynamic test, which takes its time."""
        return self.raw or self.kind == RunKind.DYNAMIC_STRIBECK.value

    def request(self, clutch_id: str) -> Request:
        """The request for a clutch."""
        address = f"/v1/clutches/{clutch_id}/runs"
        if self.path is None:
            return posted(address, self.content)
        return {
            "method": "POST",
            "url": f"{address}/file",
            "params": self.parameters,
            "content": self.path.read_bytes(),
        }


def posted(address: str, content: bytes, **headers: str) -> Request:
    """A POST of JSON."""
    return {
        "method": "POST",
        "url": address,
        "content": content,
        "headers": {"Content-Type": "application/json"} | headers,
    }


def registration(clutch_id: str, fluid: str) -> Request:
    """The registration of a simulated clutch. Clutches of a fluid are a fleet of their own."""
    return posted("/v1/clutches", json.dumps(simulated_clutch_body(clutch_id) | {"fluid": fluid}).encode())


def life(seed: int, *, raw: Path | None = None, tests: int = TESTS, samples: int = SAMPLES) -> list[Post]:
    """The posts of a simulated life by its seed, in the rig's order; `raw`: the folder for recorders' files, which take the
    place of every fifth stationary test."""
    clutch = campaign.simulated_clutch(seed)
    posts: list[Post] = []
    count = 0
    for run in campaign.simulate(seed, stop_fraction=0.01, most_tests=tests):
        if run.kind is not RunKind.STATIONARY_STRIBECK:
            posts.append(_json_post(run))
            continue
        count += 1
        # by the seed too: rigs that began together do not make their long tests together
        if raw is not None and (count + seed) % RAW_EVERY == 0:
            posts.append(_file_post(run, clutch, seed, raw, samples, parquet=(count + seed) % (2 * RAW_EVERY) == 0))
        else:
            posts.append(_json_post(run))
        posts += [post for post in _after(run, clutch, seed, count) if raw is not None or not post.sampled]
    return posts


def _after(run: SimulatedRun, clutch: SimulatedClutch, seed: int, count: int) -> Iterator[Post]:
    """The dynamic test and the maintenance after a stationary test, where there are any."""
    if (count + seed) % DYNAMIC_EVERY == 0:
        rng = np.random.default_rng([seed, run.cycles])
        record = sampled_test(clutch, run.wear, DynamicTest(), rng, Sensor())
        name = f"sim-{seed}-dynamic-{run.cycles:05d}"
        yield _json_post(replace(run, run_id=name, kind=RunKind.DYNAMIC_STRIBECK, plateaus=None, record=record))
    if count in _MAINTENANCE:
        event, note = _MAINTENANCE[count]
        run_id = f"sim-{seed}-{event}-{run.cycles:05d}"
        body = {"run_id": run_id, "kind": "maintenance", "cycles": run.cycles, "event": event, "note": note}
        yield Post(run_id=run_id, kind="maintenance", content=json.dumps(body | {"origin": "simulated"}).encode())


def _json_post(run: SimulatedRun) -> Post:
    return Post(run_id=run.run_id, kind=run.kind.value, content=json.dumps(simulated_body(run)).encode())


def _file_post(
    run: SimulatedRun, clutch: SimulatedClutch, seed: int, folder: Path, samples: int, *, parquet: bool
) -> Post:
    """The stationary test as its recorder's file: gzipped CSV and, where pyarrow is there, Parquet in turns."""
    rng = np.random.default_rng([seed, run.cycles])
    test = replace(_RAW, rate=_RAW.rate * samples / SAMPLES)
    record = sampled_test(clutch, run.wear, test, rng, Sensor())
    channels = simulated_channels(replace(run, plateaus=None, record=record))
    channels = {name: channels[name] for name in _RAW_CHANNELS}
    path = folder / f"{seed}-{run.cycles:05d}.csv"
    if parquet:
        path = write_parquet(path.with_suffix(".parquet"), channels)
    else:
        write_record(path, RecordFormat.CSV, channels, simulated_head(run))
        packed = gzip.compress(path.read_bytes(), compresslevel=1)
        path = path.rename(path.with_suffix(".csv.gz"))
        path.write_bytes(packed)
    stated = {"kind": run.kind.value, "cycles": run.cycles, "run_id": run.run_id, "origin": "simulated"}
    return Post(run_id=run.run_id, kind=run.kind.value, parameters=stated | {"filename": path.name}, path=path)


def long_file() -> bytes:
    """A recorder's file of a test at eight speeds, 400,000 rows."""
    rng, rows = np.random.default_rng(1), 400_000
    speed = 20.0 + 200.0 * (np.arange(rows) // (rows // 8))
    columns = (
        np.arange(rows) / 1000,
        rng.normal(5.0, 0.01, rows),
        rng.normal(speed, 0.1),
        rng.normal(21.0 - speed / 2000, 0.05),
    )
    text = StringIO("")
    np.savetxt(text, np.column_stack(columns), fmt="%.6f", delimiter=",")
    return f"time [s],p [bar],n [rpm],torque [Nm]\n{text.getvalue()}".encode()
