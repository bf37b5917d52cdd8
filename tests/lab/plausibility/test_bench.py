"""The bench on which trials are made sees the same history as the service, and slips change runs."""

import json
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from service import repository
from service.api.clutch import ClutchIn
from service.changes.edit_clutch import register
from service.changes.ingest_run import ingest
from service.runs.json_run import read_run
from storage.engine.opening import open_database
from tests.lab.plausibility import slips
from tests.lab.plausibility.bench import RECEIVED, Bench
from tests.support import stationary


def test_the_history_on_the_bench_is_that_of_the_service(tmp_path: Path) -> None:
    bodies = [stationary(cycles, run_id=f"s{cycles}", pressures=(4.0, 5.0)) for cycles in (500, 0, 1000)]
    bodies.append(
        {"kind": "duty_cycles", "run_id": "d", "cycles": 1000, "duty": {"cycles": 500, "initial_speed_rpm": 2000}}
    )
    bodies.append({"kind": "maintenance", "run_id": "m", "cycles": 700, "event": "rest"})
    bodies = [body | {"started_at": "2026-11-01T08:00:00+00:00"} if k % 2 else body for k, body in enumerate(bodies)]
    bench = Bench({})
    with closing(open_database(f"sqlite:///{tmp_path / 'a.db'}")) as database:
        register(database, ClutchIn(clutch_id="bench"), created_at=RECEIVED)
        for body in bodies:
            bench.accept(body)
            ingest(database, "bench", read_run(json.dumps(body).encode()), received_at=RECEIVED)
        with database.reading() as connection:
            events = repository.state(connection, "bench").events
    assert {event.run_id for event in events if event.dated} == {"s0", "d"}
    for mine, theirs in zip(bench.events, events, strict=True):
        assert mine.cofs.keys() == theirs.cofs.keys()
        for level, value in mine.cofs.items():
            assert value == pytest.approx(theirs.cofs[level], rel=1e-12)
        assert (mine.run_id, mine.cycles, mine.moment, mine.duty, mine.shift, mine.dated) == (
            theirs.run_id,
            theirs.cycles,
            theirs.moment,
            theirs.duty,
            theirs.shift,
            theirs.dated,
        )


def test_a_slip_changes_the_run_or_is_none() -> None:
    rng, honest = np.random.default_rng(3), stationary(7000, run_id="a")
    honest["channels"]["oil_temperature_c"] = [85.0] * len(honest["channels"]["torque_nm"])
    for slip in (slips.CYCLES | slips.UNITS | slips.UNPLUGGED | slips.OTHERS).values():
        wrong = slip(rng, honest)
        assert wrong is not None
        assert wrong != honest
    assert slips.CYCLES["cycles x 10"](rng, honest | {"cycles": 0}) is None


def test_what_maintenance_does_to_the_level_on_the_bench_is_stated_by_hand() -> None:
    bench = Bench({})
    for at, event in enumerate(("rest", "rebuild", "end_of_life")):
        bench.accept({"kind": "maintenance", "event": event, "run_id": event, "cycles": float(at)})
    assert [(event.rebuild, event.shift) for event in bench.events] == [(False, True), (True, False), (False, False)]
