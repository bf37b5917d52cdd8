"""A replay stores the same rows whichever executor computes it, a worker of the cluster killed midway too."""

from contextlib import closing
from pathlib import Path

import pytest
import sqlalchemy as sa

from storage.engine.opening import open_database
from storage.tables import prediction
from tests.lab.scale.replay import on_cluster, replayed, source

CLUTCHES = 8


@pytest.mark.slow
def test_a_replay_stores_the_same_rows_in_this_process_in_a_pool_and_on_a_cluster_with_a_killed_worker(
    tmp_path: Path,
) -> None:
    path = tmp_path / "source.db"
    source(path, 3, CLUTCHES)
    with closing(open_database(f"sqlite:///{path}")) as database, database.writing() as connection:
        connection.execute(sa.delete(prediction))  # so that what is compared was computed again
    local = replayed(path, "local")
    assert local.stored["prediction"][0] == 2 * 3 * CLUTCHES
    assert replayed(path, "processes:2").stored == local.stored
    assert on_cluster(path, CLUTCHES, 1).stored == local.stored
