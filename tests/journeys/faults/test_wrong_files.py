"""Wrong files through the route, against a service in a process of its own: refused by the contract, and nothing else.

After each of them the service answers, the clutch is as it was, and neither the service nor its readers have grown.
"""

import gzip
import http.client
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest

from tests.lab.benchmarks.memory import added
from tests.service.readers.sample_files import UNITS, csv_text, record, write_mdf, write_parquet, write_tdms
from tests.support import ONCE, Server, serving, stationary

CLUTCH = "/v1/clutches/c1"
#: A service at rest takes some 130 MB. What refusing a file may add, in it and in its readers together [bytes]: a reader
#: of MDF4 alone takes 150 MB before it has read a byte.
MOST_ADDED = 300 << 20
HEADER = "time_s,pressure_bar,speed_rpm,torque_nm\n"


class Watched:
    """A service that runs, with a clutch that has a run, and the memory that its processes take."""

    def __init__(self, server: Server, client: httpx2.Client, folders: tuple[Path, Path]) -> None:
        self.http = client
        self.own, self.temporary = folders
        self._pid = server.pid
        client.post("/v1/clutches", json={"clutch_id": "c1"})
        client.post(f"{CLUTCH}/runs", json=stationary(0, run_id="known"))
        self.before = self.state()

    def state(self) -> list[Any]:
        """All answers about the clutch, with their ETags."""
        answers = [self.http.get(f"{CLUTCH}{path}") for path in ("", "/runs", "/remaining-useful-life", "/loops")]
        return [(answer.status_code, answer.headers["etag"], answer.json()) for answer in answers]

    def post(self, content: bytes, *, name: str = "run.csv", **query: str) -> tuple[httpx2.Response, int]:
        """The answer, and by how much the memory of the service and its readers had grown at most meanwhile."""
        parameters = {"kind": "dynamic_stribeck", "cycles": "0", "filename": name} | query
        answers: list[httpx2.Response] = []
        grown = added(
            self._pid, lambda: answers.append(self.http.post(f"{CLUTCH}/runs/file", params=parameters, content=content))
        )
        return answers[0], grown

    def refuse(self, content: bytes, *, name: str = "run.csv", status: int = 422, **query: str) -> dict[str, Any]:
        """Post what must not be taken; the problem."""
        answer, grown = self.post(content, name=name, **query)
        assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json"), answer.text
        problem: dict[str, Any] = answer.json()
        assert problem["status"] == status
        assert problem["detail"]
        assert len(problem["errors"]) <= 50
        assert all(error["code"] != "too_slow" for error in problem["errors"]), "its reader has used up its time"
        assert grown < MOST_ADDED, f"{grown >> 20} MB"
        assert self.state() == self.before
        return problem


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Watched]:
    folder, temporary = tmp_path_factory.mktemp("wrong"), tmp_path_factory.mktemp("temporary")
    with (
        serving(folder / "a.db", loaded=True, environment={"TMPDIR": str(temporary)}) as server,
        httpx2.Client(base_url=server.url, timeout=120) as client,
    ):
        yield Watched(server, client, (folder / "a.db-files", temporary))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("write", "name", "cuts"),
    [(write_tdms, "a.tdms", 24), (write_parquet, "a.parquet", 6), (write_mdf, "a.mf4", 5)],
    ids=["TDMS", "Parquet", "MDF4"],
)
def test_a_file_cut_off_anywhere(
    service: Watched, tmp_path: Path, write: Callable[..., Path], name: str, cuts: int
) -> None:
    """In its head, in its data, in its tail, at random places, and a byte before its end; and whole it is taken, as a
    control."""
    whole = write(tmp_path / name, record(400), units=UNITS).read_bytes()
    places = {1, 3, 9, len(whole) - 1, *np.geomspace(20, len(whole) - 2, cuts - 4).astype(int).tolist()}
    if write is not write_parquet:  # whose end is read first
        places |= set(np.random.default_rng(20131113).integers(1, len(whole), 12).tolist())
    for place in sorted(places):
        service.refuse(whole[:place], name=name)
    service.http.post("/v1/clutches", json={"clutch_id": "control"})
    parameters = {"kind": "dynamic_stribeck", "cycles": "0", "filename": name, "run_id": name}
    assert service.http.post("/v1/clutches/control/runs/file", params=parameters, content=whole).status_code == 201


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["CSV", "TDMS", "Parquet"])
def test_a_gzip_bomb(service: Watched, kind: str, tmp_path: Path) -> None:
    """Half a gigabyte out of half a megabyte."""
    head = {
        "CSV": HEADER.encode(),
        "TDMS": write_tdms(tmp_path / "a.tdms", record(10), units=UNITS).read_bytes(),
        "Parquet": b"PAR1",
    }[kind]
    packed = BytesIO()
    with gzip.GzipFile(fileobj=packed, mode="wb", compresslevel=9) as bomb:
        bomb.write(head)
        for _ in range(512):
            bomb.write((b"0,0,0,0\n" if kind == "CSV" else bytes(8)) * (1 << 17))
    problem = service.refuse(packed.getvalue(), name=f"run.{kind.lower()}.gz", status=413)
    assert "must not unpack to more than" in problem["detail"] or "must not have more than" in problem["detail"]


@pytest.mark.slow
def test_an_archive_and_a_table_of_words(service: Watched) -> None:
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("run.csv", csv_text(record(100)))
    service.http.post("/v1/clutches", json={"clutch_id": "packed"})
    for name in ("run.zip", "run.csv", "run.xlsx"):  # a ZIP is read whatever its name is
        parameters = {"kind": "dynamic_stribeck", "cycles": "0", "filename": name}
        answer = service.http.post("/v1/clutches/packed/runs/file", params=parameters, content=packed.getvalue())
        assert answer.status_code in (200, 201), answer.text
    service.refuse((HEADER + "a,b,c,d\n" * 100_000).encode())
    problem = service.refuse(b'{"kind": "stationary_stribeck"}', name="run.json")
    assert {error["code"] for error in problem["errors"]} <= {""}


def test_a_file_larger_than_is_taken(service: Watched) -> None:
    """Refused by what it announces, before any of it is sent."""
    asking = http.client.HTTPConnection(str(service.http.base_url.host), service.http.base_url.port, timeout=30)
    asking.putrequest("POST", f"{CLUTCH}/runs/file?kind=dynamic_stribeck&cycles=0")
    asking.putheader("Content-Length", str(1 << 40))
    asking.endheaders()
    answer = asking.getresponse()
    assert (answer.status, answer.headers["content-type"]) == (413, "application/problem+json")
    asking.close()
    assert service.state() == service.before


@pytest.mark.slow
def test_many_at_once(service: Watched) -> None:
    """Eight senders of cut-off files at a time: all are refused, and the service lives."""
    address = service.http.base_url.join(f"{CLUTCH}/runs/file?kind=dynamic_stribeck&cycles=0&filename=a.tdms")
    with ThreadPoolExecutor(8) as pool:
        sent = [pool.submit(ONCE.post, address, content=b"TDSm" + bytes(40)) for _ in range(8)]
    assert [each.result().status_code for each in sent] == [422] * 8
    assert service.state() == service.before


def test_nothing_is_left_on_the_disk(service: Watched) -> None:
    """Neither beside the database, where files are kept meanwhile, nor in the system's folder, which may be memory."""
    begun, before = service.own.stat().st_mtime_ns, set(service.temporary.iterdir())
    service.refuse(gzip.compress(b"TDSm" + bytes(100)), name="a.tdms.gz")
    service.refuse(b"MDF     4.10" + bytes(100), name="a.mf4")
    assert service.own.stat().st_mtime_ns > begun, "the readers use another folder: this test sees nothing"
    assert list(service.own.iterdir()) == []
    assert set(service.temporary.iterdir()) <= before  # its processes' own socket
