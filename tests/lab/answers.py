"""The answers of a simulated campaign, of every GET route with its arguments: stored before a change of the code and
compared after it, byte by byte.

    python -m tests.lab.answers keep FILE       stores them
    python -m tests.lab.answers compare FILE    shows those that differ, and fails where there are some

What differs from run to run stands masked: times of the service's own clock, names that it draws, and releases of the code.
"""

import json
import re
import sys
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fastapi.testclient import TestClient

from service.cli.demo import life
from service.runs.simulated import simulated_body, simulated_inspection
from tests.service.changes import stand_in_engine
from tests.service.clients import client_on
from tests.support import stationary

SEED = 7
ENGINE = f"{stand_in_engine.__name__}:diagnose"
#: Up to here the simulated life is posted.
LAST_CYCLES = 9000
CRITERIA = [
    {"quantity": "mean_cof", "fraction": 0.5},
    {"quantity": "slope", "pressure_bar": 5, "speed_rpm": 500},
    {"quantity": "static_torque_nm", "pressure_bar": 5, "fraction": 0.6},
]
#: A time of the service's clock, a name that is drawn, and the release.
_MASKED = (
    (re.compile(r"20[2-9]\d-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}\+00:00"), "TIME"),
    (re.compile(r"""(?<=["'/ ])[0-9a-f]{16}(?=["'/?. ]|$)"""), "NAME"),
    (re.compile(r"\b1\.0\.0\+[0-9a-f]{16}\b"), "BUILD"),
)
ARGUMENTS = {
    "/v1/clutches": ("", "?sort=name&limit=1", "?held=true", "?state=normal", "?find=b"),
    "/v1/clutches/{clutch_id}/runs": ("", "?limit=2", "?state=held", "?kind=stationary_stribeck"),
    "/v1/clutches/{clutch_id}/runs/{run_id}": ("", "?points=20"),
    "/v1/clutches/{clutch_id}/remaining-useful-life": (
        "", "?method=ukf", "?method=grid", "?pressure_bar=5", "?at_cycles=3000", "?quantity=static_torque_nm",
        "?quantity=breakaway_cof_ratio", "?criterion=slope", "?life=1", "?quantity=film_time&method=ukf",
        "?quantity=nothing",
    ),
    "/v1/clutches/{clutch_id}/remaining-useful-life.csv": ("", "?method=ukf", "?at_cycles=3000"),
    "/v1/clutches/{clutch_id}/degradation": (
        "", "?method=ukf", "?quantity=slope", "?quantity=mean_cof&draws=3", "?quantity=attractor", "?at_cycles=3000",
        "?quantity=stop_time_s", "?life=1", "?until=20000&quantity=mean_cof", "?limit=2",
    ),
    "/v1/clutches/{clutch_id}/stribeck": ("", "?limit=1"),
    "/v1/clutches/{clutch_id}/engagement": ("", "?at_cycles=1000"),
    "/v1/clutches/{clutch_id}/scores": ("", "?method=grid"),
    "/v1/clutches/{clutch_id}/loops": ("", "?limit=1"),
    "/v1/clutches/{clutch_id}/series": ("", "?quantity=health", "?quantity=slope&limit=3"),
    "/v1/fleet/totals": ("", "?find=b"),
}  # fmt: skip
#: Answers about this process, and those whose order or content depends on what was quicker.
LEFT_OUT = (
    "/metrics", "/livez", "/readyz", "/v1/jobs", "/v1/jobs/{job_id}", "/v1/webhooks/{webhook_id}/deliveries",
    "/v1/alarms", "/v1/alarms/{alarm_id}", "/v1/alarms/events", "/v1/alarms/events/{event_id}",
)  # fmt: skip


def masked(content: bytes) -> str:
    text = content.decode("utf-8", "backslashreplace")
    for pattern, name in _MASKED:
        text = pattern.sub(name, text)
    return text


class Answers(dict[str, str]):
    """Answers by their requests, as they are asked for."""

    def __init__(self, http: TestClient) -> None:
        self.http = http

    def ask(self, method: str, address: str, **sent: Any) -> Any:
        """The answer, which is noted with its status and content type; runs are sent with a time of start."""
        if method == "POST" and address.endswith("/runs"):
            start = datetime(2026, 1, 1, tzinfo=UTC) + timedelta(hours=sent["json"]["cycles"] / 100)
            sent["json"] = sent["json"] | {"started_at": start.isoformat()}
        answer = self.http.request(method, address, **sent)
        name = masked(f"{method} {address}".encode())
        number = next(number for number in count() if f"{name} {number}" not in self)
        kind = answer.headers.get("content-type", "").partition(";")[0]
        self[f"{name} {number}"] = f"{answer.status_code} {kind}\n{masked(answer.content)}"
        return answer.json() if kind == "application/json" else None


def campaign(answers: Answers) -> None:
    """A simulated life with a held run, an end and a rebuild; one with criteria; a small one, edited; and all else."""
    ask = answers.ask
    ask("POST", "/v1/clutches", json={"clutch_id": "a", "origin": "simulated"})
    ask("POST", "/v1/clutches", json={"clutch_id": "b", "end_of_life": {"cof_fraction": 0.8, "criteria": CRITERIA}})
    ask("POST", "/v1/clutches", json={"clutch_id": "c"})
    ask("POST", "/v1/webhooks", json={"url": "https://192.0.2.1/hook", "secret": "wet-clutch-7000"})
    rule = {"clutch_id": "b", "quantity": "health", "below": 0.9}
    ask("POST", "/v1/alarms", json=rule)
    ask("POST", "/v1/alarms", json={"quantity": "state"})
    for run in life.runs(SEED):
        if run.cycles <= LAST_CYCLES:
            ask("POST", "/v1/clutches/a/runs", json=simulated_body(run))
    for cycles, surface in life.inspections(SEED, LAST_CYCLES):
        ask("POST", "/v1/clutches/a/inspections", json=simulated_inspection(surface, cycles))
    for cycles in (0.0, 1000.0, 2000.0, 3000.0, 5000.0, 8000.0, 12000.0):
        ask("POST", "/v1/clutches/b/runs", json=stationary(cycles, run_id=f"b{cycles:g}"))
    ask("POST", "/v1/clutches/b/runs", json=stationary(120000.0, run_id="b-slip", wear=0.2))
    end = {"kind": "maintenance", "cycles": 12500.0, "event": "end_of_life", "reason": "worn", "run_id": "b-end"}
    for cycles in (0.0, 1000.0, 2000.0):
        ask("POST", "/v1/clutches/c/runs", json=stationary(cycles, run_id=f"c{cycles:g}"))
    ask("POST", "/v1/clutches/c/runs", json=end | {"run_id": "c-end", "cycles": 2500.0})
    ask(
        "POST",
        "/v1/clutches/c/runs",
        json={"kind": "maintenance", "cycles": 3000.0, "event": "rebuild", "run_id": "c-r"},
    )
    for cycles in (3000.0, 4000.0, 5000.0, 7000.0):
        ask("POST", "/v1/clutches/c/runs", json=stationary(cycles, run_id=f"c{cycles:g}-2", wear=(cycles - 3000) / 2e4))
    ask("POST", "/v1/clutches/c/runs/c1000/withdraw", json={"reason": "unplugged"})
    ask("POST", "/v1/clutches/c/runs/c1000/restore", json={"reason": "plugged"})
    ask("PATCH", "/v1/clutches/c/runs/c4000-2", json={"cycles": 4100, "reason": "typed"})
    ask("PATCH", "/v1/clutches/c", json={"reason": "drawing", "friction_material": "paper"})
    ask(
        "PUT",
        "/v1/rigs/bench",
        json={"name": "bench", "columns": [{"title": "n", "channel": "speed_rpm", "unit": "rpm"}]},
    )
    content = "pressure_bar;speed_rpm;torque_nm\n" + "\n".join(
        f"{p};{n};{t}" for p, n, t in zip(*stationary(6000.0)["channels"].values(), strict=True)
    )
    query = "?kind=stationary_stribeck&cycles=6000&filename=c.csv&run_id=c-file"
    ask("POST", f"/v1/import/preview{query.replace('&run_id=c-file', '')}", content=content)
    ask("POST", f"/v1/clutches/c/runs/file{query}", content=content)
    ask("POST", f"/v1/clutches/c/runs/file{query}", content=content)
    plan = {"programme": [{"cycles": 500, "energy_per_cycle_kj": 20}], "pace_cycles_per_hour": 100}
    ask("POST", "/v1/clutches/a/remaining-useful-life/forecast", json=plan)
    ask("POST", "/v1/clutches/b/remaining-useful-life/forecast", json=plan)
    waiting = {"headers": {"Prefer": "wait=120"}}
    ask("POST", "/v1/clutches/c/diagnoses", json={"adopt": False}, **waiting)
    everything(answers)
    ask("POST", "/v1/clutches/b/runs", json=end)
    ask("POST", "/v1/clutches/b/runs/b-slip/confirm", json={"reason": "so it was"})
    ask("POST", "/v1/jobs", json={"kind": "replay", "clutch_id": "c"}, **waiting)
    ask("POST", "/v1/jobs", json={"kind": "fleet_refresh"}, **waiting)
    everything(answers)


def everything(answers: Answers) -> None:
    """Every GET route of the description, of every clutch and what it has."""
    http = answers.http
    described = json.loads(http.get("/openapi.json").content)["paths"]
    for path, methods in described.items():
        if "get" in methods and path not in LEFT_OUT:
            for address in addresses(http, path):
                for arguments in ARGUMENTS.get(path, ("",))[: 1 if "unknown" in address else None]:
                    answers.ask("GET", address + arguments, headers={"Prefer": "wait=120"})


def addresses(http: TestClient, path: str) -> Iterator[str]:
    """The path with the names of all that there is."""
    names = {
        "run_id": ("runs?limit=1000", "run_id"),
        "inspection_id": ("inspections", "inspection_id"),
        "diagnosis_id": ("diagnoses", "diagnosis_id"),
    }
    of_all = {
        "/v1/rigs/{name}": ("name", "/v1/rigs"),
        "/v1/webhooks/{webhook_id}": ("webhook_id", "/v1/webhooks"),
    }
    if path in of_all:
        name, listed = of_all[path]
        yield from (path.replace(f"{{{name}}}", item[name]) for item in http.get(listed).json()["items"])
    elif "{clutch_id}" not in path:
        yield path
    elif "photograph_id" not in path:
        for clutch in ("a", "b", "c", "unknown"):
            of_clutch = path.replace("{clutch_id}", clutch)
            name = next((name for name in names if f"{{{name}}}" in path), None)
            if name is None:
                yield of_clutch
            elif clutch != "unknown" and not path.endswith("/file"):
                listed, field = names[name]
                items = http.get(f"/v1/clutches/{clutch}/{listed}").json()["items"]
                yield from (of_clutch.replace(f"{{{name}}}", item[field]) for item in items)


def asked() -> dict[str, str]:
    stand_in_engine.apply()
    with (
        TemporaryDirectory() as folder,
        client_on(f"sqlite:///{folder}/answers.db", max_body_mb=50, engine=ENGINE) as http,
    ):
        answers = Answers(http)
        campaign(answers)
        return dict(answers)


def in_any_order(answer: str) -> str:
    """An answer with the fields of objects in alphabetical order, its numbers as they are written."""
    head, _, body = answer.partition("\n")
    if not head.endswith("json"):
        return answer
    return head + json.dumps(json.loads(body, parse_float=str, parse_int=str), sort_keys=True)


def difference(before: str, after: str) -> str:
    """Where two texts differ first, with what stands around."""
    at = next((i for i, (b, a) in enumerate(zip(before, after, strict=False)) if b != a), min(len(before), len(after)))
    start = max(0, at - 120)
    return f"    before: {before[start : at + 80]!r}\n    after:  {after[start : at + 80]!r}"


def main() -> None:
    command, path = sys.argv[1], Path(sys.argv[2])
    found = asked()
    if command == "keep":
        path.write_text(json.dumps(found, ensure_ascii=False, indent=0), encoding="utf-8")
        print(f"{len(found)} answers are in {path}")
        return
    known = json.loads(path.read_text(encoding="utf-8"))
    differ = [name for name in known.keys() | found.keys() if known.get(name) != found.get(name)]
    wrong = [name for name in differ if in_any_order(known.get(name, "")) != in_any_order(found.get(name, ""))]
    for name in sorted(wrong):
        print(f"{name}\n{difference(known.get(name, ''), found.get(name, ''))}")
    print(f"{len(known)} answers; {len(wrong)} differ, {len(differ) - len(wrong)} in the order of their fields alone")
    print("\n".join(f"  {name}" for name in sorted(set(differ) - set(wrong))))
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
