"""`make scale`: what requests, pages and commands cost with many clutches in one database, beside few, as Markdown.

One file, or with `--server postgresql` a PostgreSQL server that is started for it.

Both services run side by side and are asked in turn, so that what else the machine does falls on both.
"""

import argparse
import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx2
import sqlalchemy as sa
from playwright.sync_api import Browser

from storage.engine.sqlite.database import back_up
from tests.browser.driving import chromium
from tests.lab.benchmarks.memory import held, held_alone
from tests.lab.benchmarks.pages import marked
from tests.lab.measuring import table
from tests.lab.scale.copies import bodies, kilobytes, life, multiply, name
from tests.storage.engine.postgresql.server import postgresql_server
from tests.support import serving

FEW, ROUNDS, SCREENS = 10, 30, 7
JSON = {"Content-Type": "application/json"}

#: Milliseconds by what was asked.
Times = defaultdict[str, list[float]]


def timed(times: Times, title: str, ask: Callable[..., httpx2.Response], *arguments: Any) -> None:
    start = time.perf_counter()
    answer = ask(*arguments)
    times[title].append(1e3 * (time.perf_counter() - start))
    answer.raise_for_status()


def asked(http: httpx2.Client, runs: list[bytes], clutches: int, states: int, times: Times) -> Iterator[None]:
    """Runs of new clutches; then, of clutches that have so many, one run more and what pages ask; one step at a time."""

    def post(clutch: str, number: int) -> httpx2.Response:
        return http.post(f"/v1/clutches/{clutch}/runs", content=runs[number], headers=JSON)

    for clutch in ("new-1", "new-2", "new-3"):
        http.post("/v1/clutches", json={"clutch_id": clutch}).raise_for_status()
        for number in range(10):
            title = "POST a run to a clutch of 4 to 9" if number > 3 else "POST a run to a clutch of 0 to 3"
            timed(times, title, post, clutch, number)
            yield
    for number in range(ROUNDS):
        clutch = name(number % FEW)
        title = f"POST a run to a clutch of {states}"
        timed(times, title, post, clutch, states + number // FEW)
        for title, address in (
            ("GET remaining life", f"/v1/clutches/{clutch}/remaining-useful-life"),
            ("GET runs, 10 of them", f"/v1/clutches/{clutch}/runs?limit=10"),
            ("GET clutches, the first 10", "/v1/clutches?limit=10"),
            ("GET clutches, 80 from the middle by offset", f"/v1/clutches?limit=80&offset={clutches // 2}"),
            ("GET clutches, found by a name", f"/v1/clutches?find={name(clutches - 1)}"),
            ("GET fleet totals", "/v1/fleet/totals"),
            ("GET metrics", "/metrics"),
            ("GET readyz", "/readyz"),
        ):
            timed(times, title, http.get, address)
            yield


def first_screen(browser: Browser, url: str) -> float:
    """Milliseconds from the address until the fleet's first rows are shown, in a browser that has nothing of it."""
    context = browser.new_context(viewport={"width": 1360, "height": 900})
    page = context.new_page()
    page.goto(url)
    shown = marked(page, "fleet-shown")
    assert page.locator("table.fleet tbody tr").count() >= FEW
    context.close()
    return shown


def backup_speed(address: str) -> dict[str, float]:
    """MB a second of a backup, where it is of a file: a server's is not ours."""
    if not address.startswith("sqlite"):
        return {}
    path = Path(address.removeprefix("sqlite:///"))
    target = path.with_suffix(".copy")
    start = time.perf_counter()
    back_up(address, target)
    taken = time.perf_counter() - start
    target.unlink()
    return {"backup, MB/s": path.stat().st_size / taken / 1e6}


def size_of(address: str) -> int:
    """Bytes of a database."""
    if address.startswith("sqlite"):
        return Path(address.removeprefix("sqlite:///")).stat().st_size
    with sa.create_engine(address, poolclass=sa.NullPool).connect() as connection:
        return connection.execute(sa.select(sa.func.pg_database_size(sa.func.current_database()))).scalar_one()


def side_by_side(
    addresses: list[str], runs: list[bytes], counts: tuple[int, int], states: int
) -> list[dict[str, float]]:
    """What a service on each database costs, asked in turn, by what is asked: medians in ms, and MB."""
    found = [backup_speed(address) for address in addresses]
    few, many = (serving(address) for address in addresses)
    times: list[Times] = [defaultdict(list) for _ in addresses]
    with few as first, many as second, chromium() as browser:
        servers = (first, second)
        clients = [httpx2.Client(base_url=server.url, timeout=60) for server in servers]
        steps = [
            asked(http, runs, count, states, taken) for http, count, taken in zip(clients, counts, times, strict=True)
        ]
        for _ in zip(*steps, strict=True):
            pass
        for _ in range(SCREENS):
            for server, taken in zip(servers, times, strict=True):
                taken["the fleet page's first screen"].append(first_screen(browser, server.url))
        return [
            {f"{title}, ms": statistics.median(each) for title, each in taken.items()}
            | backup
            | {
                "memory of the service alone, MB": held_alone(server.pid) / 1e6,
                "memory of the service and its workers, MB": held(server.pid) / 1e6,
                "the database, MB": size_of(address) / 1e6,
            }
            for address, backup, server, taken in zip(addresses, found, servers, times, strict=True)
        ]


@contextmanager
def two_databases(server: str) -> Iterator[list[str]]:
    """The addresses of two empty databases of that kind."""
    if server == "postgresql":
        with postgresql_server() as running:
            yield [running.fresh(), running.fresh()]
    else:
        with tempfile.TemporaryDirectory() as folder:
            yield [f"sqlite:///{folder}/{which}.db" for which in ("few", "many")]


def main(clutches: int, states: int, server: str) -> None:
    """The table."""
    runs = bodies(states + ROUNDS)
    with two_databases(server) as addresses:
        for count, address in zip((FEW, clutches), addresses, strict=True):
            life(address, runs[:states])
            multiply(address, count)
        sizes = kilobytes(addresses[0])
        few, many = side_by_side(addresses, runs, (FEW, clutches), states)
    rows = []
    for title, beside in few.items():
        here, digits = many[title], 2 if title.endswith(", ms") else 0
        rows.append((title, f"{beside:.{digits}f}", f"{here:.{digits}f}", f"{here / beside:.2f}"))
    head = (f"clutches of {states} stationary tests, {server}", FEW, clutches, "ratio")
    print("", *table(head, rows), sep="\n")
    filters = sizes.pop("filters") / FEW
    each = ", ".join(f"{title} {size:.1f} kB" for title, size in sizes.items())
    print(f"\nA run takes {each}, a clutch's filters {filters:.0f} kB.")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--clutches", type=int, default=1_000)
    parser.add_argument("--states", type=int, default=200, help="stationary tests of each")
    parser.add_argument("--server", choices=("sqlite", "postgresql"), default="sqlite", help="of the databases")
    arguments = parser.parse_args()
    main(arguments.clutches, arguments.states, arguments.server)
