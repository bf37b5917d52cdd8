"""Simulated campaigns go through the whole way in text and in a binary format: simulate, push, receipts."""

from pathlib import Path
from typing import Any

import pytest

from tests.support import ONCE, Server, clutchlife


@pytest.mark.slow
def test_campaigns_of_records_are_pushed_without_a_word_on_kind_and_cycles(server: Server, tmp_path: Path) -> None:
    for form in ("csv", "mdf4"):
        folder = tmp_path / form
        assert "3 simulated runs" in clutchlife("simulate", "--film", "--out", folder, "--format", form, "--tests", "1")
        push = ("push", folder, "--clutch", form, "--url", server.url, "--spool", tmp_path / "spool")
        assert "4 stored, 0 known already, 0 refused" in clutchlife(*push)
        assert "0 stored, 4 known already, 0 refused" in clutchlife(*push)
        (inspection,) = ONCE.get(f"{server.url}/v1/clutches/{form}/inspections").json()["items"]
        assert (inspection["cycles"], inspection["roughness_um"], inspection["skewness"]) == (0, 9.52, -0.87)
        items = ONCE.get(f"{server.url}/v1/clutches/{form}/runs").json()["items"]
        runs: dict[str, dict[str, Any]] = {run["kind"]: run for run in items}
        assert set(runs) == {"run_in", "stationary_stribeck", "dynamic_stribeck"}
        assert {(run["origin"], run["cycles"]) for run in items} == {("simulated", 0)}
        assert len(runs["stationary_stribeck"]["fits"]) == 7
        loops = runs["dynamic_stribeck"]["loops"]
        assert [loop["pressure_bar"] for loop in loops] == [4, 4.5, 5, 5.5, 6, 6.5, 7]
        assert {loop["direction"] for loop in loops} == {"higher_accelerating"}
        assert runs["run_in"]["duty"]["energy_per_cycle_kj"] > 0


def test_a_record_that_no_manifest_lists_is_named(server: Server, tmp_path: Path) -> None:
    folder = tmp_path / "csv"
    clutchlife("simulate", "--seed", "7", "--out", folder, "--format", "csv", "--tests", "1", "--no-dynamic")
    (folder / "lonely.csv").write_text("torque_nm\n1\n", encoding="utf-8")
    push = ("push", folder, "--clutch", "sim-7", "--url", server.url, "--spool", tmp_path / "spool")
    output = clutchlife(*push)
    assert "not sent, for their kind and cycles are not known: " in output
    assert "lonely.csv" in output
    assert "3 stored" in output
