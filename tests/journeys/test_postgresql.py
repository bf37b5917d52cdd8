"""A service on PostgreSQL answers as one on a file does: the same is sent to both, and every address is asked of both; and
where its database goes from a file to a server and back, its answers and every table are the same."""

import csv
import io
import json
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest

from tests.service.changes import stand_in_engine
from tests.service.web.routes.surfaces import FRESH, WORN, png
from tests.storage.engine.postgresql.server import PostgresServer
from tests.storage.test_transfer import digests
from tests.support import PRESSURES_BAR, Server, clutchlife, serving, stationary

#: What hangs on the clock or is drawn at random.
OF_ITS_OWN = re.compile(
    r"time|(received_|created_|finished_|adopted_|asked_|started_|exported_)?at|(diagnosis|job|request)_id|progress"
)
#: A moment of today, as tables state it.
MOMENT = re.compile(r"\d{4}-\d\d-\d\dT[\d:.]+\+00:00")
#: Addresses that describe the process, not what is stored.
OF_THE_PROCESS = ("/livez", "/readyz", "/metrics", "/openapi.json")
LISTS = ("/v1/clutches", *(f"/v1/clutches/b2/{name}" for name in ("runs", "changes", "diagnoses")))
ENVIRONMENT = {"CLUTCHLIFE_ENGINE": f"{stand_in_engine.__name__}:diagnose"}


@pytest.fixture
def both(tmp_path: Path, postgresql: PostgresServer) -> Iterator[tuple[Server, Server]]:
    """A service on a file and one on a server, with the same content."""
    address = postgresql.fresh()
    with ExitStack() as stack:
        databases = (tmp_path / "clutchlife.db", address)
        servers = [stack.enter_context(serving(each, loaded=True, environment=ENVIRONMENT)) for each in databases]
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(fill, [server.url for server in servers]))
        yield servers[0], servers[1]
    postgresql.drop(address)


def sampled(cycles: float, run_id: str) -> dict[str, Any]:
    """A test as a record of samples."""
    plateaus = stationary(cycles, pressures=PRESSURES_BAR[:2])["channels"]
    channels = {name: np.repeat(column, 60).tolist() for name, column in plateaus.items()}
    channels["time_s"] = [number / 20 for number in range(len(channels["torque_nm"]))]
    return {"kind": "stationary_stribeck", "cycles": cycles, "run_id": run_id, "channels": channels}


def fill(url: str) -> None:
    """Everything that a service takes in, in an order that is not that of cycles or names."""
    with httpx2.Client(base_url=url, timeout=120) as http:
        post_runs(http)
        reason = {"reason": "Öl \u2264 20 °C"}
        http.post("/v1/clutches/b2/runs/s2000/withdraw", json=reason).raise_for_status()
        http.patch("/v1/clutches/B10", json={"archived": True} | reason).raise_for_status()
        for sent in (FRESH, WORN):
            location = http.post("/v1/clutches/bench/inspections", json=sent).headers["location"]
        photograph = {"content": png(1), "headers": {"Content-Type": "image/png"}}
        http.post(f"{location}/photographs", **photograph).raise_for_status()
        for clutch in ("bench", "b2"):
            address = f"/v1/clutches/{clutch}/diagnoses"
            http.post(address, json={"adopt": False}, headers={"Prefer": "wait=60"}).raise_for_status()


def post_runs(http: httpx2.Client) -> None:
    """Clutches, and runs of every kind."""
    for clutch in ("bench", "Bench", "b2", "B10", "empty"):
        http.post("/v1/clutches", json={"clutch_id": clutch}).raise_for_status()
    runs: list[tuple[str, dict[str, Any]]] = []
    for cycles in (2000, 0, 1000, 3000):
        runs += [("bench", stationary(cycles, run_id=f"S{cycles}")), ("b2", stationary(cycles, run_id=f"s{cycles}"))]
    duty = {"cycles": 500, "energy_per_cycle_kj": 12.25}
    runs += [
        ("bench", {"kind": "duty_cycles", "cycles": 3000, "run_id": "d", "duty": duty}),
        ("bench", sampled(4500, "sampled")),
        ("bench", stationary(50, run_id="odd", wear=-60.0)),
        ("B10", stationary(0, run_id="first", pressures=PRESSURES_BAR[:2])),
        ("b2", {"kind": "maintenance", "cycles": 4500, "run_id": "rebuild", "event": "rebuild"}),
        ("b2", stationary(5000, run_id="after", wear=0.0)),
    ]
    for clutch, body in runs:
        answer = http.post(f"/v1/clutches/{clutch}/runs", json=body)
        assert answer.status_code == 201, answer.text


def addresses(http: httpx2.Client) -> list[str]:
    """Every address that may be asked, with every name that it may have."""
    found = []
    for path, methods in http.get("/openapi.json").json()["paths"].items():
        if "get" not in methods or path in OF_THE_PROCESS:
            continue
        clutches = ("bench", "Bench", "b2", "B10", "unknown") if "{clutch_id}" in path else ("",)
        for clutch in clutches:
            filled = [path.replace("{clutch_id}", clutch)]
            for kind in ("run", "inspection", "diagnosis", "photograph"):
                filled = [each.replace(f"{{{kind}_id}}", name) for each in filled for name in names(http, kind, each)]
            found += filled
    return found


def names(http: httpx2.Client, kind: str, address: str) -> list[str]:
    """The names that stand in the list before a name in an address; an empty one where none stands there."""
    before, mark, _ = address.partition(f"/{{{kind}_id}}")
    if not mark:
        return [""]
    answer = http.get(before.removesuffix("/photographs") if kind == "photograph" else before).json()
    items = answer.get("photographs", []) if kind == "photograph" else answer.get("items", [])
    return [item[f"{kind}_id"] for item in items]


def shared(found: dict[str, Any]) -> dict[str, Any]:
    """An object of JSON, or a row, without what hangs on the clock or on chance."""
    return {name: each for name, each in found.items() if not OF_ITS_OWN.fullmatch(name)}


def content(answer: httpx2.Response) -> Any:
    """What both services must answer alike: status, and body."""
    kind = answer.headers["content-type"]
    if "json" in kind:
        return answer.status_code, answer.json(object_hook=shared)
    if "csv" in kind:
        return answer.status_code, [shared(row) for row in csv.DictReader(io.StringIO(answer.text))]
    return answer.status_code, answer.content


def asked(server: Server) -> dict[str, Any]:
    """address -> what it answers, diagnoses by their place in the list."""
    with httpx2.Client(base_url=server.url, timeout=120, headers={"Prefer": "wait=60"}) as http:
        answers = {address: content(http.get(address)) for address in addresses(http)}
        answers |= {f"{address} in pages": (200, in_pages(http, address)) for address in LISTS}
        ids = {id_: f"diagnosis {clutch} {place}" for clutch in ("bench", "b2") for place, id_ in listed(http, clutch)}
    return {re.sub(r"(?<=diagnoses/)\w+", lambda match: ids[match[0]], name): each for name, each in answers.items()}


def in_pages(http: httpx2.Client, address: str) -> list[Any]:
    """A list as its pages of two items give it."""
    page = http.get(address, params={"limit": 2}).json(object_hook=shared)
    items: list[Any] = page["items"]
    while page["next"] is not None:
        page = http.get(address, params={"limit": 2, "cursor": page["next"]}).json(object_hook=shared)
        items += page["items"]
    return items


def listed(http: httpx2.Client, clutch: str) -> list[tuple[int, str]]:
    items = http.get(f"/v1/clutches/{clutch}/diagnoses").json()["items"]
    return [(place, item["diagnosis_id"]) for place, item in enumerate(items)]


def exported(server: Server, folder: Path) -> dict[str, Any]:
    """What `clutchlife export` writes of a clutch; of tables, which hold moments, those in which no moment stands differ in
    nothing, the others in the moments alone."""
    clutchlife("export", "bench", "--out", folder, "--url", server.url)
    files = {}
    for path in sorted(each for each in folder.rglob("*") if each.is_file()):
        name, text = str(path.relative_to(folder)), path.read_bytes()
        if path.suffix == ".json":
            files[name] = json.loads(text, object_hook=shared)
        elif path.suffix == ".csv":
            files[name] = MOMENT.sub("", text.decode())
        else:  # the same table, packed
            files[name] = path.suffix in (".parquet", ".xlsx") or text
    return files


@pytest.mark.slow
def test_every_answer_is_that_of_a_service_on_a_file(both: tuple[Server, Server], tmp_path: Path) -> None:
    on_file, on_server = (asked(server) for server in both)
    assert on_file.keys() == on_server.keys()
    differing = [address for address, answer in on_file.items() if on_server[address] != answer]
    assert differing == []
    assert sum(status == 200 for status, _ in on_file.values()) > 100
    for address in LISTS:
        assert on_server[f"{address} in pages"][1] == on_server[address][1]["items"]
    states = [item["state"] for item in on_file["/v1/clutches/bench/runs"][1]["items"]]
    assert {"accepted", "held"} <= set(states), "the negative control: runs that differ in what they are"
    assert " 0 findings" in clutchlife("verify", "--sample", "1", "--database", both[1].address)
    files = [exported(server, tmp_path / str(number)) for number, server in enumerate(both)]
    assert files[0] == files[1]
    assert len(files[0]) > 10


@pytest.mark.slow
def test_there_and_back_answers_and_tables_are_the_same(tmp_path: Path, postgresql: PostgresServer) -> None:
    on_server = postgresql.empty()
    in_file, back = (f"sqlite:///{tmp_path}/{name}.db" for name in ("first", "back"))
    with serving(in_file, loaded=True, environment=ENVIRONMENT) as server:
        fill(server.url)
        answers = asked(server)
        running = clutchlife("migrate", "--from", in_file, "--to", on_server, code=1)
        assert "a service uses this database already" in running
    before = digests(in_file)
    said = clutchlife("migrate", "--from", in_file, "--to", on_server)
    assert f"{sum(rows for rows, _ in before.values())} rows of 5 clutches are the same in both databases" in said
    assert "must be empty" in clutchlife("migrate", "--from", in_file, "--to", on_server, code=1)
    assert digests(on_server) == before
    clutchlife("migrate", "--from", on_server, "--to", back)
    assert digests(back) == before
    assert " 0 findings" in clutchlife("verify", "--sample", "1", "--database", back)
    for address in (on_server, back):
        with serving(address, loaded=True, environment=ENVIRONMENT) as server:
            again = asked(server)
        assert again.keys() == answers.keys()
        assert [name for name, answer in answers.items() if again[name] != answer] == []
    postgresql.drop(on_server)
