"""Simulated runs as files of every format, and back: the same bits, the same fits, the same loops; and what push finds."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from models.clutch import Geometry
from models.friction.identification import fit_curves
from models.loops.dynamic_test import evaluate_loops
from models.records.runs import curves_by_pressure
from models.rig.campaign import simulate
from models.rig.programme import Programme
from models.rig.sampled import DynamicTest, RawTest
from models.rig.simulated_runs import RunKind, SimulatedRun
from service.lives.incoming_run import sampled_record, stationary_plateaus
from service.readers import sandbox
from service.readers.detect import Format
from service.run_files import manifest
from service.run_files.json_run import read_run
from service.run_files.record_writer import RecordFormat, require_writer, write_record
from service.run_files.simulated import simulated_body, simulated_channels, simulated_head
from service.run_files.upload import read_file_run

GEOMETRY = Geometry()
FORMATS = ("csv", "tdms", "mdf4")


def measured(programme: Programme) -> list[SimulatedRun]:
    return [run for run in simulate(7, programme=programme, most_tests=1) if run.duty is None]


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A short campaign by the command, in a folder a format. MDF4's package warns as it is loaded: not in this process."""
    folder = tmp_path_factory.mktemp("campaigns")
    for form in ("json", *FORMATS):
        simulated("--out", folder / form, "--format", form)
    return {form: folder / form for form in ("json", *FORMATS)}


def simulated(*options: str | Path) -> subprocess.CompletedProcess[str]:
    """`clutchlife simulate` with one test at most."""
    called = [sys.executable, "-m", "service.cli.main", "simulate", "--seed", "7", "--tests", "1", *map(str, options)]
    return subprocess.run(called, check=True, capture_output=True, text=True)


def incoming(found: manifest.FoundRun) -> Any:
    """A run's file as the service would read it."""
    if found.asked is None:
        return read_run(found.path.read_bytes())
    asked = dict(found.asked)
    return read_file_run(found.path, cycles=float(asked.pop("cycles")), **asked)


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_holds_the_run_bit_for_bit(campaigns: dict[str, Path], form: str) -> None:
    plain, other = ([incoming(found) for found in manifest.find([campaigns[name]])] for name in ("json", form))
    assert len(plain) == 3
    assert {run.run_id: run.content_sha256 for run in plain} == {run.run_id: run.content_sha256 for run in other}
    assert {path.suffix for path in campaigns[form].iterdir()} == {".json", RecordFormat(form).suffix}


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_gives_the_same_fits_and_loops(campaigns: dict[str, Path], form: str) -> None:
    stationary, dynamic = measured(Programme(dynamic=DynamicTest()))
    read = {run.kind: run for run in map(incoming, manifest.find([campaigns[form]]))}
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
    found = read_file_run(path, filename="raw.csv", kind="stationary_stribeck", cycles=0.0)
    record = sampled_record(found.channels)
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


@pytest.mark.parametrize(("form", "kind"), [(RecordFormat.TDMS, Format.TDMS), (RecordFormat.MDF4, Format.MDF4)])
def test_a_missing_package_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: RecordFormat, kind: Format
) -> None:
    module, _, extra = sandbox.READERS[kind]
    monkeypatch.setitem(sandbox.READERS, kind, (module, "no_such_package", extra))
    with pytest.raises(ValueError, match=rf"install clutchlife\[{extra}\]"):
        require_writer(form)
    with pytest.raises(ValueError, match="is not written here"):
        write_record(tmp_path / "a", form, {"torque_nm": np.ones(2)}, {})
    assert list(tmp_path.iterdir()) == []
    require_writer(RecordFormat.CSV)


def test_options_leave_out_and_put_in(tmp_path: Path) -> None:
    simulated("--out", tmp_path, "--no-dynamic", "--raw", "--raw-rate", "20", "--ageing", "energy")
    bodies = {path.stem: json.loads(path.read_bytes()) for path in tmp_path.glob("sim-*.json")}
    assert set(bodies) == {"sim-7-run-in-00000", "sim-7-stationary-00000"}
    assert len(bodies["sim-7-stationary-00000"]["channels"]["time_s"]) == 28_000


class TestManifest:
    def entry(self, **more: object) -> dict[str, object]:
        return {"file": "a.csv", "kind": RunKind.STATIONARY_STRIBECK.value, "cycles": 500} | more

    def write(self, folder: Path, content: object) -> None:
        (folder / "a.csv").write_text("torque_nm\n1\n", encoding="utf-8")
        (folder / manifest.MANIFEST).write_text(json.dumps(content), encoding="utf-8")

    def test_says_beside_a_record_what_its_channels_do_not(self, tmp_path: Path) -> None:
        self.write(tmp_path, [self.entry(run_id="r1", map="torque_nm:Mz")])
        (tmp_path / "b.json").write_text('{"cycles": 100}', encoding="utf-8")
        (tmp_path / "c.TDMS").write_bytes(b"TDSm")
        found = manifest.find([tmp_path])
        asked = {"kind": "stationary_stribeck", "cycles": "500.0", "run_id": "r1", "map": "torque_nm:Mz"}
        assert [(run.path.name, run.asked) for run in found] == [
            ("b.json", None),
            ("a.csv", asked | {"filename": "a.csv"}),
        ]
        assert manifest.find([tmp_path / "a.csv"]) == [found[1]]
        assert manifest.find([tmp_path / "c.TDMS"])[0].asked is None
        assert [path.name for path in manifest.unlisted([tmp_path])] == ["c.TDMS"]

    @pytest.mark.parametrize(
        ("content", "rule"),
        [
            ({"file": "a.csv"}, "must hold a list"),
            (["a.csv"], "must hold file, kind, cycles"),
            ([{"file": "a.csv", "kind": "x"}], "must hold file, kind, cycles"),
            ([{"file": "a.csv", "kind": "x", "cycles": 0, "speed": 1}], "at most run_id"),
            ([{"file": "a.csv", "kind": "x", "cycles": -1}], "cycles must be a number that is not negative, got -1"),
            ([{"file": "a.csv", "kind": "x", "cycles": True}], "cycles must be a number"),
            ([{"file": "a.csv", "kind": "x", "cycles": float("nan")}], "cycles must be a number"),
            ([{"file": "a.csv", "kind": 7, "cycles": 0}], "kind must be a text, got 7"),
        ],
    )
    def test_refuses_what_is_none(self, tmp_path: Path, content: object, rule: str) -> None:
        self.write(tmp_path, content)
        with pytest.raises(ValueError, match=rule):
            manifest.find([tmp_path])

    def test_refuses_a_file_that_is_not_there(self, tmp_path: Path) -> None:
        self.write(tmp_path, [self.entry(file="other.csv")])
        with pytest.raises(FileNotFoundError, match=r"runs\.json\[0\]: .*other\.csv is not there"):
            manifest.find([tmp_path])
