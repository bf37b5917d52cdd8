"""What a column costs in the database and in stores beside it, by its length: the choice of `MAX_INLINE`.

The places take turns; a bucket is that of a server that speaks S3 on the same machine (moto), as near as one can be.
"""

import itertools
import os
import statistics
import tempfile
import time
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
from unittest.mock import patch

import numpy as np

from service.workflows import raw_records
from storage import channels, clutches, runs
from storage.blobs import raw_stores
from storage.blobs.stores import DATABASE
from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.measuring import table
from tests.storage.blobs.stores import CREDENTIALS, new_bucket, s3_server
from tests.storage.samples import clutch_row, new_run

#: Values of a column, which take 6 to 7 bytes each.
LENGTHS = (600, 2_500, 5_000, 10_000, 20_000, 40_000, 160_000)
REPEATS = 15


def measured(folder: Path, places: dict[str, str]) -> list[tuple[str, ...]]:
    """By a column's length [kB]: ms to write a run with it and to read it, medians, a cell a place."""
    opened = {name: open_database(f"sqlite:///{folder}/{number}.db") for number, name in enumerate(places)}
    for name, place in places.items():
        raw_records.use(opened[name], place)
        with opened[name].writing() as connection:
            clutches.insert(connection, clutch_row())
    rng, numbers, rows = np.random.default_rng(1), itertools.count(1), []
    for length in LENGTHS:
        taken: dict[str, list[tuple[float, float]]] = {name: [] for name in places}
        for number in itertools.islice(numbers, REPEATS):
            encoded = channels.encoded({"torque_nm": rng.standard_normal(length)})
            for name, database in opened.items():
                taken[name].append(timed(database, number, encoded))
        medians = (tuple(map(statistics.median, zip(*times, strict=True))) for times in taken.values())
        size = round(len(encoded.columns[0][3]) / 1000)
        rows.append((f"{size} kB", *("{:.1f}, {:.1f}".format(*each) for each in medians)))
    for database in opened.values():
        database.close()
    return rows


def timed(database: Database, number: int, encoded: channels.Encoded) -> tuple[float, float]:
    begun = time.perf_counter()
    with database.reading() as connection:
        store = raw_stores.in_use(connection)
    columns = encoded if store is None else encoded.put(store)
    with database.writing() as connection:
        key = runs.insert(connection, new_run(number))
        channels.write(connection, key, columns)
    between = time.perf_counter()
    with database.reading() as connection:
        held = channels.stored_of_run(connection, key)
    channels.values_of(held)
    return 1e3 * (between - begun), 1e3 * (time.perf_counter() - between)


def main() -> None:
    with (
        tempfile.TemporaryDirectory() as folder,
        redirect_stderr(StringIO()),
        s3_server() as endpoint,
        patch.object(channels, "MAX_INLINE", 0),
    ):
        os.environ.update(CREDENTIALS | {"AWS_ENDPOINT_URL": endpoint})
        places = {"database": DATABASE, "folder": f"folder://{folder}/raw", "bucket": new_bucket(endpoint)}
        rows = measured(Path(folder), places)
    print("\n".join(table(["a column of", *(f"{name}: written, read, ms" for name in places)], rows)))


if __name__ == "__main__":
    main()
