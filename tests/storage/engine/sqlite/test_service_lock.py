"""One service of a database at a time: a second one is refused, and a dead one is in nobody's way."""

import os
import signal
from contextlib import closing
from pathlib import Path

import pytest

from storage.engine.errors import ServiceRuns, StorageUnavailable
from storage.engine.opening import open_database
from storage.engine.sqlite.connect import service_lock
from tests.storage.samples import OLD, child, integrity, old_database, revision

HOLDER = """
import sys, time
from pathlib import Path
from storage.engine.sqlite.connect import service_lock
with service_lock(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


def test_a_second_service_is_refused_until_the_first_has_ended_however_it_ends(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    with child(HOLDER, path) as (holder, _, says):
        assert says.readline() == "held\n"
        with (
            pytest.raises(ServiceRuns, match=rf"a\.db: a service uses .* \(process {holder.pid}\)"),
            service_lock(path),
        ):
            pass
        os.kill(holder.pid, signal.SIGKILL)
        holder.wait()
        for _ in range(2):
            with service_lock(path):
                pass


def test_where_no_lock_can_be_made_no_service_starts(tmp_path: Path) -> None:
    with pytest.raises(StorageUnavailable, match="lock of the database"), service_lock(tmp_path / "none" / "a.db"):
        pass


@pytest.mark.usefixtures("later_step")
def test_a_file_is_not_migrated_under_a_running_service(tmp_path: Path) -> None:
    path = old_database(tmp_path)
    with service_lock(path):
        with pytest.raises(ServiceRuns):
            open_database(f"sqlite:///{path}")
        assert revision(path) == OLD
        with closing(open_database(f"sqlite:///{path}", serving=True)) as own:  # the service itself
            assert not own.faults(least_free=0)
            open_database(f"sqlite:///{path}").close()  # a command beside it: nothing is left to migrate
    assert integrity(path) == ["ok"]
