"""How requests grow with the tests of one life: `python -m tests.scale.long_life`, the last table of `make scale`.

Two services run side by side, on a life of 100 tests and on one of 1,000, and are asked in turn: a run more, and what it
makes new. Ends with an error where a POST to the longer life takes more than MOST_TIMES as long, or its degradation more
than MOST_SECONDS.
"""

import argparse
import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator

import httpx2

from tests.measuring import table
from tests.scale.copies import bodies, life, name
from tests.support import serving

SHORT, LONG, ROUNDS = 100, 1_000, 40
#: What a POST may take at LONG as a multiple of one at SHORT, and a degradation that is computed anew [s].
MOST_TIMES, MOST_SECONDS = 1.5, 2.0
JSON = {"Content-Type": "application/json"}
POST, DEGRADATION = "POST a run", "GET degradation, the first after a POST"


def asked(http: httpx2.Client, runs: list[bytes], times: dict[str, list[float]]) -> Iterator[None]:
    """Runs, after each fifth of which degradation is asked for; in ms by what is asked, one step at a time."""
    address = f"/v1/clutches/{name(0)}"

    def timed(title: str, method: str, path: str, **request: object) -> None:
        start = time.perf_counter()
        http.request(method, f"{address}{path}", **request).raise_for_status()
        times[title].append(1e3 * (time.perf_counter() - start))

    for number, run in enumerate(runs):
        timed(POST, "POST", "/runs", content=run, headers=JSON)
        yield
        if number % 5 == 4:
            timed(DEGRADATION, "GET", "/degradation")
            yield
            timed("GET remaining life", "GET", "/remaining-useful-life")
            timed("GET runs, 10 of them", "GET", "/runs?limit=10")
            yield


def measured(short: int, long: int) -> list[dict[str, float]]:
    """Medians in ms by what is asked, of lives of so many tests; the first requests, for which processes load what they
    need, are left out."""
    runs = bodies(long + ROUNDS)
    with tempfile.TemporaryDirectory() as folder:
        addresses = [f"sqlite:///{folder}/{tests}.db" for tests in (short, long)]
        for tests, address in zip((short, long), addresses, strict=True):
            life(address, runs[:tests])
        times: list[dict[str, list[float]]] = [defaultdict(list) for _ in addresses]
        with serving(addresses[0]) as first, serving(addresses[1]) as second:
            steps = [
                asked(httpx2.Client(base_url=server.url, timeout=150), runs[tests : tests + ROUNDS], taken)
                for server, tests, taken in zip((first, second), (short, long), times, strict=True)
            ]
            for _ in zip(*steps, strict=True):
                pass
    return [{title: statistics.median(each[len(each) // 5 :]) for title, each in taken.items()} for taken in times]


def main(short: int, long: int) -> None:
    """The table. Raises SystemExit where what is wanted is not met."""
    of_short, of_long = measured(short, long)
    rows = [
        (f"{title}, ms", f"{few:.1f}", f"{of_long[title]:.1f}", f"{of_long[title] / few:.2f}")
        for title, few in of_short.items()
    ]
    print("", *table(("one life of stationary tests, sqlite", short, long, "ratio"), rows), sep="\n")
    if of_long[POST] > MOST_TIMES * of_short[POST] or of_long[DEGRADATION] > 1e3 * MOST_SECONDS:
        raise SystemExit(f"wanted: a POST within {MOST_TIMES} times, a degradation within {MOST_SECONDS} s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--short", type=int, default=SHORT)
    parser.add_argument("--long", type=int, default=LONG)
    arguments = parser.parse_args()
    main(arguments.short, arguments.long)
