"""`clutchlife simulate`: a campaign to rehearse a diagnosis on, whose answer lies beside it and is not told."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.cli.main import app
from service.run_files import manifest

QUICK = ("simulate", "--seed", "3", "--tests", "1", "--pressures", "5", "--pressures", "4")


def simulated(folder: Path, *arguments: str, code: int = 0) -> str:
    done = CliRunner().invoke(app, [*QUICK, "--out", str(folder), *arguments])
    assert done.exit_code == code, done.output
    return done.output


def test_what_is_hidden_is_in_a_file_and_not_on_the_screen(tmp_path: Path) -> None:
    hide = ("--hide", "torque_zero_shift:1.2", "--hide", "shaft_ripple")
    shown = simulated(tmp_path, *hide, "--frequency", "0.2", "--frequency", "0.5")
    assert "torque_zero_shift" not in shown
    hidden = json.loads((tmp_path / "answer.json").read_bytes())["hidden"]
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
        (("--hide", "warm_oil"), "oil_temperature (1 -), interface_heating (15 %)"),
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
    assert not (tmp_path / "plain" / "answer.json").exists()
    (stated,) = json.loads((tmp_path / "film" / "answer.json").read_bytes())["hidden"]
    assert stated["effect"] == "squeeze_film"
    assert max(abs(a - b) for a, b in zip(*torques, strict=True)) > 0.1
