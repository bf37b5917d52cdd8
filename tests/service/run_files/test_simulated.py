"""Simulated runs as files of every format, and back: the same bits, the same fits, the same loops."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from models.clutch import Geometry
from models.friction.identification import fit_curves
from models.loops.loops import evaluate_loops
from models.records.runs import curves_by_pressure
from models.rig.campaign import simulate, simulated_clutch
from models.rig.hidden import clutch_for
from models.rig.programme import Programme
from models.rig.sampled import DynamicTest, RawTest
from models.rig.simulated_runs import SimulatedRun
from models.rig.stationary import SHARP
from service.lives.incoming_run import sampled_record, stationary_plateaus
from service.readers import sandbox
from service.readers.detect import Format
from service.run_files import manifest
from service.run_files.json_run import read_run
from service.run_files.record_writer import RecordFormat, require_writer, write_record
from service.run_files.simulated import simulated_body, simulated_channels, simulated_head
from service.run_files.upload import read_file_run
from tests.support import clutchlife, one_quick

GEOMETRY = Geometry()
FORMATS = ("csv", "tdms", "mdf4")


def measured(programme: Programme) -> list[SimulatedRun]:
    """The tests of the same campaign as the command makes them."""
    clutch = clutch_for(simulated_clutch(7), {})
    runs = simulate(7, clutch=clutch, sensor=SHARP, programme=programme, most_tests=1)
    return [run for run in runs if run.duty is None]


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """A short campaign by the command, in a folder a format. MDF4's package warns as it is loaded: not in this process."""

    @cache
    def made(form: str) -> Path:
        folder = tmp_path_factory.mktemp("campaigns") / form
        simulated("--out", folder, "--format", form)
        return folder

    return made


def simulated(*options: str | Path) -> str:
    """`clutchlife simulate` with one test at most."""
    return clutchlife("simulate", "--seed", "7", "--tests", "1", *options)


def runs_in(folder: Path) -> list[manifest.RunFile]:
    """The files of runs, not of inspections."""
    return [file for file in manifest.find([folder]) if not file.is_inspection]


def incoming(file: manifest.RunFile) -> Any:
    """A run's file as the service would read it."""
    if file.parameters is None:
        return read_run(file.path.read_bytes())
    parameters = dict(file.parameters)
    return read_file_run(file.path, cycles=float(parameters.pop("cycles")), **parameters)


@pytest.mark.parametrize("form", one_quick(FORMATS))
def test_every_format_holds_the_run_bit_for_bit(campaign: Callable[[str], Path], form: str) -> None:
    plain, other = ([incoming(file) for file in runs_in(campaign(name))] for name in ("json", form))
    assert len(plain) == 3
    assert {run.run_id: run.content_sha256 for run in plain} == {run.run_id: run.content_sha256 for run in other}
    assert {path.suffix for path in campaign(form).rglob("*.*")} == {".json", RecordFormat(form).suffix}


@pytest.mark.parametrize("form", one_quick(FORMATS))
def test_every_format_gives_the_same_fits_and_loops(campaign: Callable[[str], Path], form: str) -> None:
    stationary, dynamic = measured(Programme(dynamic=DynamicTest()))
    read = {run.kind: run for run in map(incoming, runs_in(campaign(form)))}
    fits = fit_curves(curves_by_pressure(stationary.plateaus, GEOMETRY))
    again = fit_curves(curves_by_pressure(stationary_plateaus(read["stationary_stribeck"].channels), GEOMETRY))
    for fit, back in zip(fits, again, strict=True):
        assert back.parameters.as_array() == pytest.approx(fit.parameters.as_array(), rel=1e-5)
    loops = evaluate_loops(dynamic.record, GEOMETRY, None)
    back_loops = evaluate_loops(sampled_record(read["dynamic_stribeck"].channels), GEOMETRY, None)
    assert [loop.area for loop in back_loops] == pytest.approx([loop.area for loop in loops], rel=1e-5)


def test_a_posted_body_says_what_the_simulated_run_is() -> None:
    run_in = next(simulate(7, programme=Programme(engagements=True)))
    body = simulated_body(run_in)
    assert body["origin"] == "simulated"
    assert body["duty"]["energy_per_cycle_kj"] == pytest.approx(run_in.duty.energy_per_cycle / 1000)
    assert read_run(json.dumps(body).encode()).kind == "run_in"
    assert set(body["channels"]) == {"time_s", "pressure_bar", "speed_rpm", "torque_nm", "oil_temperature_c"}
    assert max(body["channels"]["speed_rpm"]) == pytest.approx(1200, rel=0.01)


def test_a_raw_stationary_test_is_written_and_read(tmp_path: Path) -> None:
    (run,) = measured(Programme(raw=RawTest(rate=10.0)))
    path = tmp_path / "raw.csv"
    write_record(path, RecordFormat.CSV, simulated_channels(run), simulated_head(run))
    run_read = read_file_run(path, filename="raw.csv", kind="stationary_stribeck", cycles=0.0)
    record = sampled_record(run_read.channels)
    assert record.time.size == 14_000
    assert record.torque == pytest.approx(run.record.torque, abs=1e-7)
    assert path.read_text(encoding="utf-8").startswith("# run_id sim-7-stationary-00000, kind stationary_stribeck")


def test_columns_are_rounded_to_nine_digits_and_to_the_nearest_double() -> None:
    (run,) = measured(Programme())
    channels = simulated_channels(run)
    witness = [float(f"{value:.9g}") for value in channels["torque_nm"].tolist()]
    assert channels["torque_nm"].tolist() == witness
    assert channels["speed_rpm"][:40].tolist() == [float(rpm) for rpm in range(20, 1971, 50)]
    assert np.abs(channels["torque_nm"] - run.plateaus.torque).max() < 1e-7


def test_options_leave_out_and_put_in(tmp_path: Path) -> None:
    simulated("--out", tmp_path, "--no-dynamic", "--raw", "--raw-rate", "20", "--ageing", "energy")
    bodies = {path.stem: json.loads(path.read_bytes()) for path in tmp_path.glob("sim-*.json")}
    assert set(bodies) == {"sim-7-run-in-00000", "sim-7-stationary-00000"}
    assert len(bodies["sim-7-stationary-00000"]["channels"]["time_s"]) == 28_000


# --- Writing a record file without the package that its format needs.


@pytest.mark.parametrize(("form", "kind"), [(RecordFormat.TDMS, Format.TDMS), (RecordFormat.MDF4, Format.MDF4)])
def test_a_missing_package_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: RecordFormat, kind: Format
) -> None:
    module, _, extra = sandbox.READERS[kind]
    monkeypatch.setitem(sandbox.READERS, kind, (module, "no_such_package", extra))
    with pytest.raises(ValueError, match="pip install -e"):
        require_writer(form)
    with pytest.raises(ValueError, match="files cannot be written"):
        write_record(tmp_path / "a", form, {"torque_nm": np.ones(2)}, {})
    assert list(tmp_path.iterdir()) == []
    require_writer(RecordFormat.CSV)
