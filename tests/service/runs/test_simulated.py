"""Simulated runs as files of every format and back: the same bits, fits and loops; campaigns to rehearse a diagnosis on."""

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
from models.rig.programme import RigProgramme
from models.rig.sampled import DynamicTest, RawTest
from models.rig.simulated_runs import SimulatedRun
from models.rig.stationary import SHARP
from service.clutch.incoming_run import sampled_record, stationary_plateaus
from service.readers import sandbox
from service.readers.detect import Format
from service.runs import manifest
from service.runs.json_run import read_run
from service.runs.record_writer import RecordFormat, require_writer, write_record
from service.runs.simulated import simulated_body, simulated_channels, simulated_head
from service.runs.upload import read_file_run
from tests.service import clients
from tests.support import clutchlife, one_quick

GEOMETRY = Geometry()
FORMATS = ("csv", "tdms", "mdf4")


def measured(programme: RigProgramme) -> list[SimulatedRun]:
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
    stationary, dynamic = measured(RigProgramme(dynamic=DynamicTest()))
    read = {run.kind: run for run in map(incoming, runs_in(campaign(form)))}
    fits = fit_curves(curves_by_pressure(stationary.plateaus, GEOMETRY))
    again = fit_curves(curves_by_pressure(stationary_plateaus(read["stationary_stribeck"].channels), GEOMETRY))
    for fit, back in zip(fits, again, strict=True):
        assert back.parameters.as_array() == pytest.approx(fit.parameters.as_array(), rel=1e-5)
    loops = evaluate_loops(dynamic.record, GEOMETRY, None)
    back_loops = evaluate_loops(sampled_record(read["dynamic_stribeck"].channels), GEOMETRY, None)
    assert [loop.area for loop in back_loops] == pytest.approx([loop.area for loop in loops], rel=1e-5)


def test_a_posted_body_says_what_the_simulated_run_is() -> None:
    run_in = next(simulate(7, programme=RigProgramme(engagements=True)))
    body = simulated_body(run_in)
    assert body["origin"] == "simulated"
    assert body["duty"]["energy_per_cycle_kj"] == pytest.approx(run_in.duty.energy_per_cycle / 1000)
    assert read_run(json.dumps(body).encode()).kind == "run_in"
    assert set(body["channels"]) == {"time_s", "pressure_bar", "speed_rpm", "torque_nm", "oil_temperature_c"}
    assert max(body["channels"]["speed_rpm"]) == pytest.approx(1200, rel=0.01)


def test_a_raw_stationary_test_is_written_and_read(tmp_path: Path) -> None:
    (run,) = measured(RigProgramme(raw=RawTest(rate=10.0)))
    path = tmp_path / "raw.csv"
    write_record(path, RecordFormat.CSV, simulated_channels(run), simulated_head(run))
    run_read = read_file_run(path, filename="raw.csv", kind="stationary_stribeck", cycles=0.0)
    record = sampled_record(run_read.channels)
    assert record.time.size == 14_000
    assert record.torque == pytest.approx(run.record.torque, abs=1e-7)
    assert path.read_text(encoding="utf-8").startswith("# run_id sim-7-stationary-00000, kind stationary_stribeck")


def test_columns_are_rounded_to_nine_digits_and_to_the_nearest_double() -> None:
    (run,) = measured(RigProgramme())
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


# --- A campaign to rehearse a diagnosis on, whose answer lies beside it and is not told.


QUICK = ("simulate", "--seed", "3", "--tests", "1", "--pressures", "5", "--pressures", "4")


def rehearsed(folder: Path, *arguments: str, code: int = 0) -> str:
    return clients.clutchlife(*QUICK, "--out", folder, *arguments, code=code)


def test_what_is_hidden_is_in_a_file_and_not_on_the_screen(tmp_path: Path) -> None:
    hide = ("--hide", "torque_zero_shift:1.2", "--hide", "shaft_ripple")
    shown = rehearsed(tmp_path, *hide, "--frequency", "0.2", "--frequency", "0.5")
    assert "torque_zero_shift" not in shown
    answer = json.loads((tmp_path / "answer.json").read_bytes())
    assert answer["halved_at_cycles"] > 1000  # the truth of its life, though the campaign ended long before
    hidden = [(part["effect"], part["size"], part["unit"]) for part in answer["hidden"]]
    assert hidden == [("torque_zero_shift", 1.2, "Nm"), ("shaft_ripple", 0.5, "Nm")]
    pushed = [run.path.name for run in manifest.find([tmp_path])]
    assert "answer.json" not in pushed
    dynamic = [name for name in pushed if "dynamic" in name]
    assert dynamic == ["sim-3-dynamic-00000-0.5hz.json", "sim-3-dynamic-00000.json"]
    loops = json.loads((tmp_path / "sim-3-dynamic-00000.json").read_bytes())["channels"]
    assert {round(pressure) for pressure in loops["pressure_bar"][::500]} == {4, 5}


def test_the_plate_is_measured_where_that_is_asked_for(tmp_path: Path) -> None:
    for rise, folder in ((None, tmp_path / "none"), (25.0, tmp_path / "warm"), (0.0, tmp_path / "cold")):
        rehearsed(folder, *(() if rise is None else ("--plate-rise", str(rise))))
        channels = json.loads((folder / "sim-3-stationary-00000.json").read_bytes())["channels"]
        plate = channels.pop("plate_temperature_front_c", None)
        assert (plate is None) == (rise is None)
        if plate is not None:
            above = max(p - oil for p, oil in zip(plate, channels["oil_temperature_c"], strict=True))
            assert above == pytest.approx(25.0, abs=8.0) if rise else above == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--hide", "warm_oil"), "interface_heating (loss of torque at 0.32 W/mm²: 15 %)"),
        (("--hide", "shaft_ripple:loud"), "the size in Nm"),
    ],
)
def test_what_cannot_be_hidden_is_refused_with_what_can(tmp_path: Path, arguments: tuple[str, ...], words: str) -> None:
    assert words in " ".join(rehearsed(tmp_path, *arguments, code=64).split())
    assert not (tmp_path / "answer.json").exists()


def test_a_film_is_in_the_loops_only_where_it_is_asked_for_and_stated(tmp_path: Path) -> None:
    """A plain campaign held one that nothing mentioned, and its clutch was out of specification."""
    torques = []
    for folder, options in ((tmp_path / "plain", ()), (tmp_path / "film", ("--film",))):
        rehearsed(folder, *options)
        torques.append(json.loads((folder / "sim-3-dynamic-00000.json").read_bytes())["channels"]["torque_nm"])
    assert json.loads((tmp_path / "plain" / "answer.json").read_bytes())["hidden"] == []
    (stated,) = json.loads((tmp_path / "film" / "answer.json").read_bytes())["hidden"]
    assert stated["effect"] == "squeeze_film"
    assert max(abs(a - b) for a, b in zip(*torques, strict=True)) > 0.1


PLAN = """test,step,kind,pressures_bar,speeds_rpm,frequency_hz,periods,oil_temperature_c,repeats,cycles,pause_hours,minutes
1,1,stationary_stribeck,4 5,1970 20,,,60.0,2,500.0,0.0,1
2,1,stationary_stribeck,0,20 1970,,,,1,0.0,0.0,1
2,2,dynamic_stribeck,1 1.5,0 2000,0.5,2,,1,0.0,0.0,1
"""


def test_a_plan_is_run_on_the_clutch_that_was_simulated_and_never_twice_the_same(tmp_path: Path) -> None:
    rehearsed(tmp_path, "--hide", "oil_temperature", "--no-dynamic")
    plan = tmp_path / "plan.csv"
    plan.write_text(PLAN, "utf-8")
    for alternative in ("2", "1", "1"):
        rehearsed(tmp_path, "--plan", str(plan), "--alternative", alternative)
    runs = {path.stem: json.loads(path.read_bytes()) for path in tmp_path.glob("sim-3-planned-*.json")}
    names = [f"sim-3-planned-{name}-{'00500' if name > 2 else '00000'}" for name in range(1, 7)]
    assert sorted(runs) == names
    assert (tmp_path / "sim-3-duty-00500.json").exists()
    opened, light, warm, again = (runs[names[place]]["channels"] for place in (0, 1, 2, 4))
    assert max(map(abs, opened["torque_nm"])) < 0.2
    assert light["time_s"][-1] == pytest.approx(8.1, abs=0.05)
    assert max(light["speed_rpm"]) == pytest.approx(2000, abs=5)
    assert warm["speed_rpm"] == [1970.0, 20.0, 1970.0, 20.0]
    assert warm["oil_temperature_c"] == pytest.approx([60.0] * 4, abs=5)
    assert warm["torque_nm"] == pytest.approx(again["torque_nm"], rel=0.05)
    assert warm["torque_nm"] != again["torque_nm"]


def test_what_is_no_plan_is_refused_in_a_line(tmp_path: Path) -> None:
    rehearsed(tmp_path, "--no-dynamic")
    for written, words in (
        ("nothing", "is not a plan of a diagnosis (it has no tests)"),
        (PLAN.replace("4 5", "4 x"), "pressures_bar.1: must be a number"),
        ("{}", "is not a plan of a diagnosis"),
    ):
        (tmp_path / "p").write_text(written, "utf-8")
        assert words in " ".join(rehearsed(tmp_path, "--plan", str(tmp_path / "p"), code=64).split()), written
