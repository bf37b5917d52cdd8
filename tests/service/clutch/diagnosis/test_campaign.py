"""Stored runs as the diagnosis sees them: SI units, the present life, records within bounds; its public report."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from fastapi.testclient import TestClient

from models.diagnosis.campaign import Campaign, EventKind
from models.diagnosis.design.design import build_design
from models.diagnosis.explanations.verdict import Verdict
from models.records.runs import Record
from service.api.life import LifePrediction
from service.clutch.diagnosis import campaign as campaign_module
from service.clutch.diagnosis.campaign import DiagnosedLife, thinned
from service.clutch.diagnosis.report import public
from service.jobs.diagnosis import read_life
from storage.engine.opening import open_database
from tests.models.diagnosis.report.test_summary import findings
from tests.service.clients import post_run
from tests.service.runs.test_upload import dynamic_record, raw_record
from tests.support import PRESSURES_BAR, SPEEDS_RPM, stationary

RUNS = "/v1/clutches/c1/runs"
ALL = 10**9


def post(client: TestClient, *bodies: dict[str, Any]) -> None:
    for body in bodies:
        post_run(client, body)


def campaign(database_url: str, last_run_key: int = ALL) -> DiagnosedLife:
    with closing(open_database(database_url)) as database:
        return read_life(database, "c1", last_run_key=last_run_key)


def idle_record() -> dict[str, list[float]]:
    """A dynamic test with the clutch open."""
    record = dynamic_record()
    return record | {"pressure_bar": [0.0] * len(record["time_s"]), "torque_nm": [0.1 * t for t in record["torque_nm"]]}


def test_each_kind_of_run_arrives_in_si_units_and_nothing_is_written(client: TestClient, database_url: str) -> None:
    duty = {"cycles": 500, "energy_per_cycle_kj": 18.0, "initial_speed_rpm": 2000, "maximum_pressure_bar": 8}
    post(
        client,
        stationary(0, run_id="s0") | {"started_at": "2026-01-01T00:00:00+01:00"},
        {"kind": "duty_cycles", "cycles": 500, "run_id": "d", "duty": duty},
        {"kind": "dynamic_stribeck", "cycles": 500, "run_id": "loops", "channels": dynamic_record()},
        {"kind": "maintenance", "cycles": 500, "run_id": "oil", "event": "oil_change"},
        stationary(500, run_id="s500"),
    )
    path = Path(database_url.removeprefix("sqlite:///"))
    before = path.read_bytes()
    found = campaign(database_url).campaign
    assert path.read_bytes() == before
    assert [run.run_id for run in found.stationary] == ["s0", "s500"]
    assert found.stationary[0].moment == 1767222000.0
    assert found.stationary[1].moment is None
    plateaus = found.stationary[0].plateaus
    assert plateaus.pressure.size == len(PRESSURES_BAR) * len(SPEEDS_RPM)
    assert (plateaus.pressure[0], plateaus.speed[0]) == (pytest.approx(4e5), pytest.approx(20 * np.pi / 30))
    assert found.dynamic[0].record.speed.max() == pytest.approx(2000 * np.pi / 30, rel=1e-3)
    block = found.duty[0]
    assert (block.engagements, block.energy) == (500, 18000.0)
    assert [(each.cycles, each.event) for each in found.maintenance] == [(500.0, EventKind.OIL_CHANGE)]
    assert (found.oil.viscosity_40, found.oil.viscosity_100) == (pytest.approx(56e-6), pytest.approx(9.3e-6))
    assert found.geometry.mean_radius == pytest.approx(0.058)


def test_readings_without_pressure_are_evidence_and_no_curve(client: TestClient, database_url: str) -> None:
    told = stationary(0, run_id="s0")
    open_speeds = [20.0, 500.0, 1000.0, 1970.0]
    added = {"pressure_bar": [0.0, 0.0, 0.02, 0.01], "speed_rpm": open_speeds, "torque_nm": [0.01, 0.05, 0.1, 0.2]}
    told["channels"] = {name: [*values, *added[name]] for name, values in told["channels"].items()}
    post(client, told, {"kind": "dynamic_stribeck", "cycles": 0, "run_id": "idle", "channels": idle_record()})
    found = campaign(database_url).campaign
    assert found.stationary[0].plateaus.pressure.size == len(PRESSURES_BAR) * len(SPEEDS_RPM) + len(open_speeds)
    design = build_design(found)
    assert (~design.closed & design.rows.steady).sum() == len(open_speeds)
    assert (~design.closed & ~design.rows.steady).any()
    # no curve is fitted to them, and that is said
    sweep, idle = (client.get(f"{RUNS}/{name}").json() for name in ("s0", "idle"))
    assert [fit["pressure_bar"] for fit in sweep["fits"]] == sorted(set(PRESSURES_BAR))
    assert any(each["code"] == "unloaded_plateaus" for each in sweep["warnings"])
    assert all(loop["attractor_nm_s"] is None for loop in idle["loops"])


def test_only_the_present_life_counts_from_its_rebuild_on(client: TestClient, database_url: str) -> None:
    rebuild = {"kind": "maintenance", "cycles": 1000, "run_id": "rebuild", "event": "rebuild"}
    post(client, stationary(0, run_id="old"), rebuild, stationary(1000, run_id="a"), stationary(1500, run_id="b"))
    found = campaign(database_url)
    assert [(run.run_id, run.cycles) for run in found.campaign.stationary] == [("a", 0.0), ("b", 500.0)]
    assert [(each.event, each.cycles) for each in found.campaign.maintenance] == [(EventKind.REBUILD, 0.0)]
    earlier = campaign(database_url, last_run_key=1)
    assert [run.run_id for run in earlier.campaign.stationary] == ["old"]
    assert campaign(database_url, last_run_key=0).life is None
    assert campaign(database_url, last_run_key=0).campaign == Campaign()


def test_a_raw_record_gives_plateaus(client: TestClient, database_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    raw = {"kind": "stationary_stribeck", "cycles": 0, "run_id": "raw", "channels": raw_record()}
    post(client, raw, raw | {"cycles": 1000, "run_id": "later"})
    client.post("/v1/clutches/c1/runs/later/confirm", json={"reason": "a bench of two tests"})
    run = campaign(database_url).campaign.stationary[0]
    assert run.plateaus.torque.size == len(run.time) == 24
    assert (np.diff(run.time) > 0).all()
    assert 0 < run.time[0] < 5 < run.time[1]
    assert run.plateaus.speed[-1] == pytest.approx(1970 * np.pi / 30, rel=1e-2)
    monkeypatch.setattr(campaign_module, "MAX_OF_CAMPAIGN", run.record.time.size + 1)
    found = campaign(database_url)
    assert [each.record is None for each in found.campaign.stationary] == [False, True]
    assert ["left out for their size" in note for note in found.notes] == [True]
    monkeypatch.setattr(campaign_module, "MAX_OF_RECORD", 10)
    assert [each.record for each in campaign(database_url).campaign.stationary] == [None, None]


def test_a_record_is_thinned_to_means() -> None:
    time = np.arange(1001) / 100
    record = Record(time=time, pressure=np.full(1001, 5e5), speed=np.sin(time), torque=np.arange(1001.0))
    assert thinned(record, most=1001) is record
    thin = thinned(record, most=300)
    assert thin.time.size == 250
    assert (thin.torque[0], thin.torque[-1]) == (1.5, 997.5)
    assert np.abs(thin.speed - np.sin(thin.time)).max() < 1e-3


def test_the_plate_and_a_declared_filter_reach_the_diagnosis(client: TestClient, database_url: str) -> None:
    raw = {"kind": "stationary_stribeck", "cycles": 0, "run_id": "raw", "channels": raw_record()}
    loops = {"kind": "dynamic_stribeck", "cycles": 0, "run_id": "loops", "channels": dynamic_record()}
    for run in (raw, loops, stationary(500, run_id="rows")):
        run["channels"]["plate_temperature_rear_c"] = [95.0] * len(run["channels"]["torque_nm"])
        post_run(client, run)
    plain = campaign(database_url).campaign
    tables = [*(run.plateaus for run in plain.stationary), *(run.record for run in plain.dynamic)]
    assert all(table.plate_temperature == pytest.approx(368.15) for table in tables)
    edit = {"torque_filter_ms": 100, "reason": "the amplifier"}
    assert client.patch("/v1/clutches/c1", json=edit).status_code == 200
    declared = campaign(database_url).campaign
    before, after = (found.dynamic[0].record for found in (plain, declared))
    late = np.interp(after.time[500:] - 0.1, before.time, before.speed)
    np.testing.assert_allclose(after.speed[500:], late, atol=1.5)  # a delay, but for where the swing turns
    assert np.abs(before.speed[500:] - late).max() > 5
    # dwells begin when the speed has come through the filter
    assert declared.stationary[0].time != plain.stationary[0].time
    assert declared.stationary[0].plateaus.torque == pytest.approx(plain.stationary[0].plateaus.torque, rel=0.01)
    np.testing.assert_array_equal(declared.stationary[1].plateaus.torque, plain.stationary[1].plateaus.torque)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (0.0, 880.0, "If you adopt it, the end is not reached any more: a median of about 880 cycles remains."),
        (880.0, 0.0, "If you adopt it, the end is reached; without it, a median of about 880 cycles remains."),
        (9000.0, 5700.0, "from about 9,000 to about 5,700 cycles."),
    ],
)
def test_an_end_that_adoption_takes_back_is_said_so(before: float, after: float, said: str) -> None:
    """From about 0 to about 880 cycles was all that was said."""
    found = replace(findings(Verdict.CAUSE_NAMED, "pressure_offset"), extension=cast("Any", object()))
    lives = [LifePrediction.model_construct(remaining_cycles={"0.5": median}) for median in (before, after)]
    answer = public(found, origin=0.0, before=lives[0], after=lives[1], notes=())
    assert answer.summary.endswith(said)
