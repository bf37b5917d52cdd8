"""What a terminal shows of a diagnosis, with and without colours, of full reports and of empty ones."""

import io
import re
from typing import Any

import pytest
from rich.console import Console

from models.diagnosis.campaign import Campaign
from service.api.life import LifePrediction
from service.cli.diagnose import shown
from service.clutch.diagnosis.report import EMPTY, public
from tests.service.changes.stand_in_engine import diagnose

LIFE: dict[str, Any] = {"remaining_cycles": {"0.05": 4000.0, "0.5": 12345.6, "0.95": None}}
STATE = {"adoptable": True, "adopted": True}


def printed(report: dict[str, Any], *, colours: bool = False) -> str:
    text = io.StringIO()
    console = Console(file=text, width=100, force_terminal=colours, color_system="256" if colours else None)
    for part in shown(report):
        console.print(part)
    return text.getvalue()


@pytest.fixture
def report() -> dict[str, Any]:
    diagnosed = diagnose(Campaign(), rng=None)  # type: ignore[arg-type]  # none is drawn without tests
    before, after = (LifePrediction.model_construct(**LIFE | {"status": status}) for status in ("predicted", "reached"))
    return public(diagnosed, origin=500.0, before=before, after=after, notes=("left out",)).model_dump() | STATE


def test_all_that_matters_is_there(report: dict[str, Any]) -> None:
    shown_text = printed(report)
    for words in (
        "Model adequate",
        "A stand-in looked at 0 tests.",
        "torque zero shift",
        "1.5 ± - Nm zero shift",
        "0.3 Nm before, 0.25 Nm after (16.7 ± 2 % less)",
        "Remaining life, baseline: 12,346 cycles (90 %: 4,000 to over 1,000,000)",
        "Remaining life, extended: the end of life is reached",
        "The extended model is adopted",
        "What to test next: read the unloaded zero (distinguishes torque zero shift from no effect at all;",
        "Note: left out",
        "The baseline's error depends on: oil temperature",
    ):
        assert words in shown_text, words
    assert re.search(r"torque zero shift +0\.2 Nm +0\.1 Nm", shown_text)
    assert report["maps"]["axes"]["cycles"] == [500.0, 1500.0, 2500.0]


def test_the_maps_can_be_read_without_colours_and_a_report_without_them(report: dict[str, Any]) -> None:
    lines = [line for line in printed(report).splitlines() if line.startswith("    5 ")]
    # residuals 3, 4, 5 of at most 5 before, a tenth of it after
    assert lines[0].split() == ["5", "++####", "5", "·", "·", "·"]
    assert "\x1b[" not in printed(report)
    assert "\x1b[30;48;5;160m##" in printed(report, colours=True)
    report["maps"]["before"] = {"speed_pressure": [[None] * 3] * 2, "pressure_cycles": [[0.0] * 2] * 3}
    assert "·" in printed(report)
    little = EMPTY.model_dump() | {"verdict": "insufficient_data", "summary": "Two tests."} | STATE | {"adopted": False}
    assert "Too little data" in printed(little)


def test_what_could_be_told_apart_is_shown_where_it_was_asked_for(report: dict[str, Any]) -> None:
    drag = {"effects": ["hydrodynamic_drag", "torque_zero_shift"], "probability": 0.78, "apart": False}
    sure = {"effects": ["oil_change", "running_in"], "probability": 0.98, "apart": True, "key": None, "test": None}
    sweep = {"key": "open_sweep", "test": "stationary test with the clutch open"}
    pairs = [each | {"with_test": 0.98} for each in (drag | sweep, sure)]
    assert "better by this test" not in printed(report)
    text = printed(report | {"isolability": {"pairs": pairs, "unseen": ["channel_delay"]}})
    row = next(line for line in text.splitlines() if "hydrodynamic drag and torque zero shift" in line)
    assert row.split()[-7:-1] == ["test", "with", "the", "clutch", "open", "98"]
    assert "oil change and running in" not in text
    assert "These tests would distinguish 1 of 2 pairs of causes." in text
    assert "These tests cannot show: channel delay." in text


def test_the_heading_has_the_verdicts_word_however_probable_a_cause_is(report: dict[str, Any]) -> None:
    likely = report["candidates"][0] | {"effect": "channel_delay", "probability": 0.99}
    open_beside = {"verdict": "cause_ambiguous", "causes": ["channel_delay", "uncatalogued"], "candidates": [likely]}
    assert "Cause ambiguous: channel delay, uncatalogued " in printed(report | open_beside)
