"""`clutchlife simulate`: a campaign to rehearse a diagnosis on, whose answer lies beside it and is not told."""

import json
from pathlib import Path

import pytest

from service.run_files import manifest
from tests.service.clients import clutchlife

QUICK = ("simulate", "--seed", "3", "--tests", "1", "--pressures", "5", "--pressures", "4")


def simulated(folder: Path, *arguments: str, code: int = 0) -> str:
    return clutchlife(*QUICK, "--out", folder, *arguments, code=code)


def test_what_is_hidden_is_in_a_file_and_not_on_the_screen(tmp_path: Path) -> None:
    hide = ("--hide", "torque_zero_shift:1.2", "--hide", "shaft_ripple")
    shown = simulated(tmp_path, *hide, "--frequency", "0.2", "--frequency", "0.5")
    assert "torque_zero_shift" not in shown
    answer = json.loads((tmp_path / "answer.json").read_bytes())
    hidden = answer["hidden"]
    assert answer["halved_at_cycles"] > 1000  # the truth of its life, though the campaign ended long before
    assert [(part["effect"], part["size"], part["unit"]) for part in hidden] == [
        ("torque_zero_shift", 1.2, "Nm"),
        ("shaft_ripple", 0.5, "Nm"),
    ]
    pushed = [run.path.name for run in manifest.find([tmp_path])]
    assert "answer.json" not in pushed
    assert [name for name in pushed if "dynamic" in name] == [
        "sim-3-dynamic-00000-0.5hz.json",
        "sim-3-dynamic-00000.json",
    ]
    loops = json.loads((tmp_path / "sim-3-dynamic-00000.json").read_bytes())["channels"]
    assert {round(pressure) for pressure in loops["pressure_bar"][::500]} == {4, 5}


def test_the_plate_is_measured_where_that_is_asked_for(tmp_path: Path) -> None:
    for rise, folder in ((None, tmp_path / "none"), (25.0, tmp_path / "warm"), (0.0, tmp_path / "cold")):
        simulated(folder, *(() if rise is None else ("--plate-rise", str(rise))))
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
    assert words in " ".join(simulated(tmp_path, *arguments, code=64).split())
    assert not (tmp_path / "answer.json").exists()


def test_a_film_is_in_the_loops_only_where_it_is_asked_for_and_stated(tmp_path: Path) -> None:
    """A plain campaign held one that nothing mentioned, and its clutch was out of specification."""
    torques = []
    for folder, options in ((tmp_path / "plain", ()), (tmp_path / "film", ("--film",))):
        simulated(folder, *options)
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
    simulated(tmp_path, "--hide", "oil_temperature", "--no-dynamic")
    plan = tmp_path / "plan.csv"
    plan.write_text(PLAN, "utf-8")
    for alternative in ("2", "1", "1"):
        simulated(tmp_path, "--plan", str(plan), "--alternative", alternative)
    runs = {path.stem: json.loads(path.read_bytes()) for path in tmp_path.glob("sim-3-planned-*.json")}
    assert sorted(runs) == [f"sim-3-planned-{name}" for name in (
        "1-00000", "2-00000", "3-00500", "4-00500", "5-00500", "6-00500"
    )]  # fmt: skip
    assert (tmp_path / "sim-3-duty-00500.json").exists()
    opened, light, warm, again = (runs[f"sim-3-planned-{name}"]["channels"] for name in (
        "1-00000", "2-00000", "3-00500", "5-00500"
    ))  # fmt: skip
    assert max(map(abs, opened["torque_nm"])) < 0.2
    assert light["time_s"][-1] == pytest.approx(8.1, abs=0.05)
    assert max(light["speed_rpm"]) == pytest.approx(2000, abs=5)
    assert warm["speed_rpm"] == [1970.0, 20.0, 1970.0, 20.0]
    assert warm["oil_temperature_c"] == pytest.approx([60.0] * 4, abs=5)
    assert warm["torque_nm"] == pytest.approx(again["torque_nm"], rel=0.05)
    assert warm["torque_nm"] != again["torque_nm"]


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ("nothing", "is not a plan of a diagnosis (it has no tests)"),
        (PLAN.replace("4 5", "4 x"), "pressures_bar.1: must be a number"),
        ("{}", "is not a plan of a diagnosis"),
    ],
)
def test_what_is_no_plan_is_refused_in_a_line(tmp_path: Path, written: str, words: str) -> None:
    simulated(tmp_path, "--no-dynamic")
    (tmp_path / "p").write_text(written, "utf-8")
    assert words in " ".join(simulated(tmp_path, "--plan", str(tmp_path / "p"), code=64).split())
