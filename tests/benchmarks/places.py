"""What a column costs in the database and in stores beside it, by its length: the choice of `MAX_INLINE`.

The places take turns; a bucket is that of a server that speaks S3 on the same machine (moto), as near as one can be.
"""

import os
import statistics
import tempfile
import time
from collections.abc import Callable
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path

import numpy as np

from service.workflows import raw_records
from storage import channels, clutches, runs
from storage.blobs import raw_stores
from storage.blobs.stores import DATABASE
from storage.engine.opening import open_database
from tests.storage.blobs.stores import CREDENTIALS, new_bucket, s3_server
from tests.storage.samples import clutch_row, new_run

#: Values of a column, which take 6 to 7 bytes each.
LENGTHS = (600, 2_500, 5_000, 10_000, 20_000, 40_000, 160_000)
REPEATS = 15


def measured(folder: Path, places: dict[str, str]) -> list[tuple[int, dict[str, tuple[float, float]]]]:
    """(kB, place -> (ms to write, ms to read), medians) of a run with one column, by its length."""
    limit, channels.MAX_INLINE = channels.MAX_INLINE, 0
    opened = {name: open_database(f"sqlite:///{folder}/{number}.db") for number, name in enumerate(places)}
    rows = []
    try:
        for name, place in places.items():
            raw_records.use(opened[name], place)
            with opened[name].writing() as connection:
                clutches.insert(connection, clutch_row())
        rng, number = np.random.default_rng(1), 0
        for length in LENGTHS:
            taken: dict[str, list[tuple[float, float]]] = {name: [] for name in places}
            for _ in range(REPEATS):
                number += 1
                encoded = channels.encoded({"torque_nm": rng.standard_normal(length)})
                for name, database in opened.items():

                    def write() -> int:
                        with database.reading() as connection:  # noqa: B023
                            store = raw_stores.in_use(connection)
                        columns = encoded if store is None else encoded.put(store)  # noqa: B023
                        with database.writing() as connection:  # noqa: B023
                            key = runs.insert(connection, new_run(number))  # noqa: B023
                            channels.write(connection, key, columns)
                        return key

                    def read(key: int) -> None:
                        with database.reading() as connection:  # noqa: B023
                            held = channels.stored_of_run(connection, key)
                        channels.values_of(held)

                    taken[name].append(timed(write, read))
            size = len(encoded.columns[0][3]) / 1000
            medians = {name: tuple(map(statistics.median, zip(*times, strict=True))) for name, times in taken.items()}
            rows.append((round(size), medians))
    finally:
        channels.MAX_INLINE = limit
        for database in opened.values():
            database.close()
    return rows  # type: ignore[return-value]


def timed(write: Callable[[], int], read: Callable[[int], None]) -> tuple[float, float]:
    """Milliseconds of both."""
    begin = time.perf_counter()
    key = write()
    between = time.perf_counter()
    read(key)
    return 1e3 * (between - begin), 1e3 * (time.perf_counter() - between)


def main() -> None:
    """The table as Markdown."""
    with tempfile.TemporaryDirectory() as folder, redirect_stderr(StringIO()), s3_server() as endpoint:
        os.environ.update(CREDENTIALS | {"AWS_ENDPOINT_URL": endpoint})
        places = {"database": DATABASE, "folder": f"folder://{folder}/raw", "bucket": new_bucket(endpoint)}
        rows = measured(Path(folder), places)
    print("| a column of | " + " | ".join(f"{name}: written, read, ms" for name in places) + " |")
    print("|---|" + "---|" * len(places))
    for size, medians in rows:
        cells = " | ".join(f"{written:.1f}, {read:.1f}" for written, read in medians.values())
        print(f"| {size} kB | {cells} |")


if __name__ == "__main__":
    main()
